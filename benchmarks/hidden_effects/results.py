"""The table of results: one row for each cell, written as it comes."""

import csv
import os
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from cosim import InputError

from .cells import kind_of
from .simulated_runs import NOISE, POSITION

BETWEEN = "; "


@dataclass
class Row:
    """The result of one cell.

    Attributes:
        effect, noise, coefficients, seed: which cell; ``none`` where nothing was hidden.
        values: parameters of what was hidden.
        size: share of the force on its axis, of each effect.
        redrawn: how often the ship ran away and the effect was drawn smaller.
        verdict: of the diagnosis.
        found: ids in order of acceptance.
        confidences: of each; empty where the method has none.
        true: for each whether it is a true cause, "1" or "0".
        evidence: for each what its confidence is made of; empty where that is not known.
        reported: the first id, and those that the data do not distinguish from it.
        suspects: nominal coefficients that it says are wrong.
        withdrawn: ids that were accepted, and made unseen data worse.
        possible_ids: ids that were accepted, and are not believed.
        worse: position and heading, where predictions of the run held out became worse.
        remainder: whether the model leaves a significant remainder, "1" or "0"; empty if not known.
        intervals, covered: 95 % intervals of right findings, in process noise of all that was fitted,
            and how many hold the true value.
        damping: in process noise, how many standard deviations X_u, Y_v and N_r are off.
        alike: ids that could do the same within 5 %, by the truth; "" is no effect at all.
        separable: there are none.
        absorbed: changes of nominal coefficients alone could do the same.
        right: the right effect came first; of two, both within two steps.
        in_set: the right effect is in the reported set.
        before_mm, after_mm: window position error of the run held out.
        truth_mm: that of the true model: no model can do better.
        seconds: of processor time, from measured runs to the answer.
        sindy, pls: the first effect of PySINDy and of PLS.
        note: why there is no result.
    """

    effect: str
    noise: str
    coefficients: str
    seed: int
    values: str = ""
    size: str = ""
    redrawn: int = 0
    verdict: str = ""
    found: list[str] = field(default_factory=list)
    confidences: list[str] = field(default_factory=list)
    true: list[str] = field(default_factory=list)
    evidence: list[str] = field(default_factory=list)
    reported: list[str] = field(default_factory=list)
    suspects: list[str] = field(default_factory=list)
    withdrawn: list[str] = field(default_factory=list)
    possible_ids: list[str] = field(default_factory=list)
    worse: list[str] = field(default_factory=list)
    remainder: str = ""
    intervals: int = 0
    covered: int = 0
    damping: list[str] = field(default_factory=list)
    alike: list[str] = field(default_factory=list)
    separable: bool = False
    absorbed: bool = False
    right: bool = False
    in_set: bool = False
    before_mm: float = float("nan")
    after_mm: float = float("nan")
    truth_mm: float = float("nan")
    seconds: float = float("nan")
    sindy: str = ""
    pls: str = ""
    note: str = ""

    @property
    def kind(self) -> str:
        """One of :data:`.cells.KINDS`."""
        return kind_of(self.effect)

    @property
    def surest(self) -> float:
        """The largest confidence of a finding that is no true cause; 0 without one."""
        pairs = zip(self.confidences, self.true, strict=True)
        return max((float(c) for c, true in pairs if true == "0"), default=0.0)

    @property
    def reached(self) -> float:
        """The fall of the error as a share of what the true model reaches on the same run."""
        return self.truth_mm / self.after_mm

    @property
    def key(self) -> tuple[str, str, str, int]:
        return self.effect, self.noise, self.coefficients, self.seed

    @property
    def fall(self) -> float:
        """How many times smaller the error became."""
        return self.before_mm / self.after_mm

    @property
    def possible(self) -> float:
        """How many times smaller it is with the true model."""
        return self.before_mm / self.truth_mm

    @property
    def limit(self) -> float:
        """How many times smaller it would be with the true model from the true state: noise is left."""
        return self.before_mm / (1e3 * NOISE[self.noise] * POSITION * 2**0.5)


NAMES = [f.name for f in fields(Row)]
KINDS = {f.name: f.type for f in fields(Row)}


def _text(value: Any) -> str:
    if isinstance(value, list):
        return BETWEEN.join(value)
    return f"{value:.5g}" if isinstance(value, float) else str(value)


def _value(text: str, kind: Any) -> Any:
    if kind == list[str]:
        return text.split(BETWEEN) if text else []
    return text == "True" if kind is bool else kind(text)


class Results:
    """A CSV file that grows row by row."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.rows = _read(path) if path.is_file() else []
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(".part")
        part.write_text("", encoding="utf-8")
        _write(part, [dict(zip(NAMES, NAMES, strict=True)), *map(_cells, self.rows)])
        os.replace(part, path)

    @property
    def done(self) -> set[tuple[str, str, str, int]]:
        """Keys of the cells that are there."""
        return {row.key for row in self.rows}

    def add(self, row: Row) -> None:
        """Keep a row."""
        self.rows.append(row)
        _write(self.path, [_cells(row)])


def _cells(row: Row) -> dict[str, str]:
    return {name: _text(getattr(row, name)) for name in NAMES}


def _write(path: Path, lines: Iterable[dict[str, str]]) -> None:
    with path.open("a", encoding="utf-8", newline="") as file:
        csv.DictWriter(file, NAMES).writerows(lines)
        file.flush()
        os.fsync(file.fileno())


def _read(path: Path) -> list[Row]:
    with path.open(encoding="utf-8", newline="") as file:
        table = csv.DictReader(file)
        if table.fieldnames != NAMES:
            raise InputError(f"'{path}' is a table of another version; name another folder or remove it")
        lines = [line for line in table if None not in line.values()]  # the last may be cut off
    try:
        return [Row(**{name: _value(line[name], KINDS[name]) for name in NAMES}) for line in lines]
    except ValueError as error:
        raise InputError(f"'{path}' cannot be read: {error}") from None
