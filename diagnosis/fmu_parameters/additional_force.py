"""What may act in addition, on a force input of an FMU: a coefficient times a function of one output."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from cosim.fmu import FeedbackTerm


class Shape(NamedTuple):
    """A function of one output; ``power`` of it is in the unit of its coefficient."""

    symbol: str
    power: int


SHAPES = (
    Shape("{y}", 1),
    Shape("|{y}|{y}", 2),
    Shape("{y}³", 3),
)
CONSTANT = Shape("1", 0)


@dataclass(frozen=True)
class AdditionalForce:
    """A term on one input.

    Attributes:
        input: the variable that it acts on.
        output: that it is a function of; empty: constant.
        shape: number of the function in :data:`SHAPES`; -1: constant.
        rate: whether it is a function of the output's derivative by time.
        coefficient: what the function is multiplied with.
    """

    input: str
    output: str = ""
    shape: int = -1
    rate: bool = False
    coefficient: float = 1.0

    @property
    def _shape(self) -> Shape:
        return CONSTANT if self.shape < 0 else SHAPES[self.shape]

    @property
    def id(self) -> str:
        """As ``f:|v|v``: the input, and what the force goes with."""
        y = f"der({self.output})" if self.rate else self.output
        return f"{self.input}:{self._shape.symbol.format(y=y)}"

    def unit(self, of_input: str, of_output: str) -> str:
        """Unit of the coefficient."""
        if not self._shape.power:
            return of_input
        y = f"{of_output}/s" if self.rate else of_output
        return f"{of_input}/({y})" + (f"^{self._shape.power}" if self._shape.power > 1 else "")

    def term(self, inputs: Sequence[str], outputs: Sequence[str]) -> FeedbackTerm:
        """The force by the numbers of its variables."""
        place = outputs.index(self.output) if self.output else 0
        slot = inputs.index(self.input)
        return FeedbackTerm(slot, place, self._shape.power, self.rate, self.coefficient)
