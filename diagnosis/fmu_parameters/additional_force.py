"""What may act in addition, on a force input of an FMU: a coefficient times a function of one output."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from cosim.fmu import FeedbackTerm

# Function of an output y that a force goes with; its number is the power of y in the coefficient's unit.
SYMBOLS = ("1", "{y}", "|{y}|{y}", "{y}³")


class EarthDirection(NamedTuple):
    """Along which a force in the earth frame acts, whatever the heading.

    Attributes:
        name: of the force, as ``F_n``.
        heading: output that is the ship's heading.
        turn: heading by that output [rad by its unit].
        parts: input, change of it by 1 N along it, and angle that is added to the heading [rad].
    """

    name: str
    heading: str
    turn: float
    parts: tuple[tuple[str, float, float], ...]


@dataclass(frozen=True)
class AdditionalForce:
    """A term on one input.

    Attributes:
        input: the variable that it acts on.
        output: that it is a function of; empty: constant.
        power: number of the function in :data:`SYMBOLS`.
        rate: whether it is a function of the output's derivative by time.
        coefficient: what the function is multiplied with [N in the earth frame].
        earth: direction of a force in the earth frame, which has parts on several inputs.
    """

    input: str
    output: str = ""
    power: int = 0
    rate: bool = False
    coefficient: float = 1.0
    earth: EarthDirection | None = None

    @property
    def inputs(self) -> list[str]:
        """All variables that it acts on."""
        return [self.input] if self.earth is None else [name for name, *_ in self.earth.parts]

    @property
    def signal(self) -> str:
        """The output that its terms need; empty: none."""
        return self.output if self.earth is None else self.earth.heading

    @property
    def id(self) -> str:
        """As ``f:|v|v``: the input, and what the force goes with."""
        if self.earth is not None:
            return f"earth_force:{self.earth.name}"
        y = f"der({self.output})" if self.rate else self.output
        return f"{self.input}:{SYMBOLS[self.power].format(y=y)}"

    def unit(self, of_input: str, of_output: str) -> str:
        """Unit of the coefficient."""
        if self.earth is not None:
            return "N"
        if not self.power:
            return of_input
        y = f"{of_output}/s" if self.rate else of_output
        return f"{of_input}/({y})" + (f"^{self.power}" if self.power > 1 else "")

    def terms(self, inputs: Sequence[str], outputs: Sequence[str]) -> list[FeedbackTerm]:
        """The force by the numbers of its variables."""
        place = outputs.index(self.signal) if self.signal else 0
        if self.earth is None:
            slot = inputs.index(self.input)
            return [FeedbackTerm(slot, place, self.power, self.rate, self.coefficient)]
        turn = self.earth.turn
        return [
            FeedbackTerm(inputs.index(name), place, 1, False, self.coefficient * gain, turn, phase)
            for name, gain, phase in self.earth.parts
        ]
