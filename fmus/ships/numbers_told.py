"""Numbers of a ship's file: in SI or in prime units, where each comes from, and how well it is known."""

import re
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    PositiveFloat,
    Tag,
    model_validator,
)

from ..base_units import base_exponents
from ..declare import DeclarationError
from ..ship_description import GUESSED, Value

FACTOR = re.compile(r"\|[uvr]\||[uvr]")  # of a product of speeds

Finite = Annotated[float, Field(allow_inf_nan=False, strict=True)]


def _without_control(text: str) -> str:
    """A text that an FMU's XML can hold."""
    if wrong := next((c for c in text if not (c.isprintable() or c in "\n\t")), ""):
        raise ValueError(f"has the control character {wrong!a}")
    return text


Text = Annotated[str, AfterValidator(_without_control)]


class StrictTable(BaseModel):
    """A table in which a key that is not known is an error."""

    model_config = ConfigDict(extra="forbid", strict=False)


class Number(StrictTable):
    """A number, where it comes from, and its standard deviation."""

    value: Finite | None = Field(None, description="in SI units")
    prime: Finite | None = Field(None, description="in place of value: in prime units, see prime")
    origin: Text = Field(GUESSED, description="weighed, tank test, borrowed, guessed, or a publication")
    std: PositiveFloat | None = Field(
        None, description="standard deviation in the unit of the number", allow_inf_nan=False
    )
    rel_std: float | None = Field(
        None, ge=0.0, le=10.0, description="standard deviation relative to the value; 0: exact"
    )

    @model_validator(mode="after")
    def _one(self) -> "Number":
        if (self.value is None) == (self.prime is None):
            raise ValueError("a number has value or prime")
        if self.std is not None and self.rel_std is not None:
            raise ValueError("a number has std or rel_std, not both")
        return self

    def named(self, name: str, unit: str, of: "Prime | None") -> Value:
        """The number as components read it.

        Args:
            name: of the parameter.
            unit: of the parameter.
            of: what a number in prime units is over.

        Raises:
            DeclarationError: it is in prime units, of a unit that has none or on a ship that has none.
        """
        size = 1.0 if self.prime is None else _size(name, unit, of)
        value = size * (self.prime or self.value or 0.0)
        share, std = 0.5 if self.rel_std is None else self.rel_std, size * (self.std or 0.0)
        return Value(name, value, self.origin, std / abs(value) if std and value else share, std)


class Prime(NamedTuple):
    """What numbers in prime units are over: length L [m], and mass rho L^2 d / 2 [kg]."""

    length: float
    mass: float


def _size(name: str, unit: str, of: Prime | None) -> float:
    if of is None:
        raise DeclarationError(f"{name}: a number in prime units needs the table 'prime'")
    powers = base_exponents(unit)
    if powers.get("s"):
        raise DeclarationError(f"{name}: a number in {unit} has no prime unit without a speed")
    return of.mass ** powers.get("kg", 0) * of.length ** powers.get("m", 0)


def _form(given: Any) -> str:
    return "table" if isinstance(given, (dict, Number)) else "number"


Given = Annotated[
    Annotated[Finite, Tag("number")] | Annotated[Number, Tag("table")], Discriminator(_form)
]


def valued(name: str, given: "float | Number", unit: str, of: Prime | None) -> Value:
    number = given if isinstance(given, Number) else Number.model_validate({"value": given})
    return number.named(name, unit, of)


def _speed(factor: str) -> int:
    """The place of a factor's speed among u, v and r."""
    return "uvr".index(factor.strip("|"))


class Term(Number):
    """A damping force: a coefficient times a product of u, v, r, |u|, |v| and |r|."""

    axis: Literal["X", "Y", "N"]
    product: Annotated[str, Field(max_length=40, description="such as u, |u|u, uv or |v|r")]

    @property
    def name(self) -> str:
        """The name of the coefficient, absolute values first, as in Y_absr_v."""
        factors = FACTOR.findall(self.product)
        sizes = [f"abs{x[1]}_" for x in sorted(factors, key=_speed) if len(x) == 3]
        speeds = [x for x in sorted(factors, key=_speed) if len(x) == 1]
        return "".join([f"{self.axis}_", *sizes, *speeds]).removesuffix("_")

    @model_validator(mode="after")
    def _is_product(self) -> "Term":
        if not self.product or FACTOR.sub("", self.product):
            raise ValueError(
                f"'{self.product}' is not a product of u, v, r, |u|, |v| and |r|, such as |u|u or uv"
            )
        return self
