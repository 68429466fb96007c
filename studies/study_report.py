"""The report of a study: Markdown with tables and figures, and all numbers as JSON beside it."""

import math
import os
import platform
import re
from collections.abc import Iterable, Sequence
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from cosim import InputError, atomic_write
from diagnosis.report import as_json, finite

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REPORT, RESULTS = "report.md", "results.json"
PACKAGES = ("cybership", "numpy", "scipy", "matplotlib")
DPI = 150


def machine() -> str:
    """One line: what the numbers were made with."""
    versions = []
    for name in PACKAGES:
        try:
            versions.append(f"{name} {metadata.version(name)}")
        except metadata.PackageNotFoundError:
            versions.append(f"{name} not installed")
    return (
        f"{platform.python_implementation()} {platform.python_version()} on {platform.machine()} "
        f"{platform.system()}, {os.cpu_count()} cores; {', '.join(versions)}"
    )


def seeds_line(seeds: Sequence[int]) -> str:
    """The seeds for people: ``seeds 0-9``."""
    gapless = list(seeds) == list(range(seeds[0], seeds[0] + len(seeds)))
    if gapless and len(seeds) > 1:
        return f"seeds {seeds[0]}-{seeds[-1]}"
    return f"seed{'s' if len(seeds) > 1 else ''} {', '.join(map(str, seeds))}"


def cell(value: Any) -> str:
    """A table cell: a number to four digits, anything else as it prints."""
    if isinstance(value, float):
        return f"{value:.4g}" if math.isfinite(value) else "–"
    return str(value).replace("|", "\\|")


class Verdict(NamedTuple):
    """A statement of the thesis, its verdict, and the numbers or the reason.

    Attributes:
        thesis: the statement.
        here: the verdict on today's algorithms; its words decide :attr:`holds`.
        numbers: on which it rests.
        printed: the verdict on the algorithms as printed; empty where there is one form alone.
    """

    thesis: str
    here: str
    numbers: str
    printed: str = ""

    @property
    def holds(self) -> bool | None:
        """Whether the statement holds in every setting, or in none; None: in part, or undecided."""
        said = {bool(HOLDS.fullmatch(word)) for word in DECIDES.findall(self.here)}
        return said.pop() if len(said) == 1 and not OPEN.search(self.here) else None


# Words of a verdict: those that decide, those of them by which it holds, and those that leave it open.
DECIDES = re.compile(r"not reproduced|not reached|reproduced|reversed|reached|\byes\b|\bno\b(?! run)")
HOLDS = re.compile("reproduced|reached|yes")
OPEN = re.compile("undecided|no run|in part|not by all")


def _listed(statements: Sequence[str]) -> str:
    return f": {'; '.join(statements)}" if statements else ""


class Report:
    """Collects pieces and writes them at the end; figures are written as they come.

    Args:
        folder: where the report goes, made when missing.
        title: heading of the report.
        seeds: of the runs; empty where nothing is random.
    """

    def __init__(self, folder: Path, title: str, seeds: Sequence[int] = ()) -> None:
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot write to '{folder}': {error.strerror}") from None
        self.folder = folder
        self._pieces = [f"# {title}"]
        self._tables: list[dict[str, Any]] = []
        self._verdicts: list[Verdict] = []
        self._why = ""
        self._results: dict[str, Any] = {"title": title, "seeds": list(seeds), "machine": machine()}
        ran = f"{seeds_line(seeds).capitalize()}. " if seeds else ""
        self.text(f"{ran}{machine()}.")

    def heading(self, text: str) -> None:
        self._pieces.append(f"## {text}")

    def text(self, paragraph: str) -> None:
        self._pieces.append(" ".join(paragraph.split()))

    def items(self, lines: Iterable[str]) -> None:
        """A list with a point before each line."""
        self._pieces.append("\n".join(f"- {' '.join(line.split())}" for line in lines))

    def table(self, header: Sequence[str], rows: Iterable[Sequence[Any]], words: bool = False) -> None:
        """A table, which ``results.json`` has too; columns are aligned right unless they hold words."""
        side, rows = ":--" if words else "--:", [list(row) for row in rows]
        plain = [[x if isinstance(x, (int, float)) else str(x) for x in row] for row in rows]
        self._tables.append({"header": list(header), "rows": plain})
        lines = [header, [":--", *[side] * (len(header) - 1)], *([cell(c) for c in r] for r in rows)]
        self._pieces.append("\n".join(f"| {' | '.join(line)} |" for line in lines))

    def verdicts(self, name: str, rows: Sequence[Verdict], numbers: str = "numbers") -> None:
        """A table of verdicts, which also go to ``results.json``.

        Args:
            name: in ``results.json``.
            rows: the verdicts.
            numbers: heading of the last column.
        """
        if any(row.printed for row in rows):
            header = ["thesis", "today", "as printed", numbers]
            cells = [[r.thesis, r.here, r.printed or "–", r.numbers] for r in rows]
        else:
            header, cells = ["thesis", "here", numbers], [r[:3] for r in rows]
        self.table(header, cells, words=True)
        self._verdicts += rows
        self.result(name, rows)

    def why(self, reason: str) -> None:
        """The reason for what did not hold, for the head of the report."""
        self._why = reason

    def _opening(self) -> list[str]:
        """What held, what did not, and why; nothing where no statement was judged."""
        by = {h: [v.thesis for v in self._verdicts if v.holds is h] for h in (True, False, None)}
        count = len(self._verdicts)
        lines = [
            f"{len(by[True])} of {count} statements held{_listed(by[True])}.",
            f"{len(by[False])} did not hold{_listed(by[False])}; "
            f"{len(by[None])} hold in part or are undecided{_listed(by[None])}.",
            *([f"Reason: {self._why}"] if self._why else []),
        ]
        return ["\n".join(f"- {line}" for line in lines)] if count else []

    def figure(self, name: str, figure: "Figure", caption: str) -> None:
        """Write ``<name>.png`` and embed it."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        FigureCanvasAgg(figure)
        with atomic_write(self.folder / f"{name}.png") as scratch:
            figure.savefig(scratch, format="png", dpi=DPI)
        self.picture(f"{name}.png", caption)

    def picture(self, path: str, caption: str) -> None:
        """Embed a picture that lies in the report's folder already."""
        self._pieces.append(f"![{caption}]({path})\n\n*{caption}*")

    def result(self, name: str, value: Any) -> None:
        """Numbers for ``results.json``: nested mappings, sequences, named tuples, arrays."""
        self._results[name] = finite(value)

    def write(self) -> Path:
        """Write ``results.json``, then ``report.md``; returns the latter's path."""
        text = as_json({**self._results, "tables": self._tables})
        title, *rest = self._pieces
        page = "\n\n".join([title, *self._opening(), *rest])
        for name, content in ((RESULTS, text), (REPORT, page)):
            with atomic_write(self.folder / name) as scratch:
                scratch.write_text(content + "\n", encoding="utf-8")
        return self.folder / REPORT
