"""The regressions of Table 7.2 by name, and two with nominal columns, 3.2."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from cosim import InputError
from cosim.errors import nearest

from .samples import NU, TAU

BOTH = (*NU, *TAU)
# Products with v that the thesis left out, as their coefficients are small and change sign (7.3).
OF_SWAY = ("|u|v", "|v|v", "|v|r", "|r|v")


@dataclass(frozen=True)
class Recipe:
    """How X is made, and with how many factors.

    Attributes:
        name: of the recipe.
        columns: states that X is made of.
        extended: those whose products |a| b are added.
        left_out: products that are not.
        factors: number of factors; None: by cross-validation, no more than ``most``.
        most: factors that are tried.
        separate: whether each axis of the model error has a regression of its own.
        kind: ``quadratic``, ``nominal`` or ``continuous`` columns.
    """

    name: str
    columns: Sequence[str]
    extended: Sequence[str] = ()
    left_out: Sequence[str] = ()
    factors: int | None = None
    most: int = 10
    separate: bool = False
    kind: str = "quadratic"

    def transformer(self) -> Any:
        """The transformer that makes X.

        Raises:
            InputError: scikit-learn is missing.
        """
        from .organisation import ContinuousNominal, NominalBins, QuadraticExtension

        if self.kind == "quadratic":
            return QuadraticExtension(self.columns, self.extended, self.left_out)
        return {"nominal": NominalBins, "continuous": ContinuousNominal}[self.kind](self.columns)


RECIPES: Mapping[str, Recipe] = {
    r.name: r
    for r in (
        Recipe("PLS1", BOTH, BOTH, factors=7),
        Recipe("PLS2", BOTH, NU, factors=7),
        Recipe("PLS3", BOTH, NU, OF_SWAY, factors=3),
        Recipe("PLS4", NU, NU, most=3, separate=True),
        Recipe("nominal", BOTH, kind="nominal"),
        Recipe("continuous", BOTH, kind="continuous"),
    )
}
DEFAULT = "PLS3"


def recipe(name: str) -> Recipe:
    """A recipe by its name.

    Raises:
        InputError: there is none.
    """
    if name not in RECIPES:
        raise InputError(f"no recipe '{name}'{nearest(name, RECIPES)}; there are {', '.join(RECIPES)}")
    return RECIPES[name]
