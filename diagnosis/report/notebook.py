"""A diagnosis in a notebook: the finding, a table, pictures."""

from collections.abc import Callable
from html import escape
from math import degrees
from typing import TYPE_CHECKING

from cosim import InputError
from cosim.results import Drawn

from ..session import Comparison
from . import figures, formatting, tracks
from .headline import verdict_title
from .profiles import QUANTITIES, binned_errors
from .result_keys import DiagnosisContent, RunErrors
from .svg import alone, inline, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Picture(Drawn):
    """A figure in the colours of the report; a notebook shows it as SVG."""

    def _repr_svg_(self) -> str:
        with style():
            return alone(inline(self.figure, "picture", "picture of a diagnosis"))


def _drawn(make: "Callable[[], Figure]") -> Picture:
    with style():
        return Picture(make())


class Plots:
    """The pictures of a diagnosis."""

    def __init__(self, content: DiagnosisContent, comparison: Comparison) -> None:
        self._content, self._comparison = content, comparison
        self._learned = any(e.after is not e.before for e in comparison.evaluations)

    def where(self, over: str | None = None) -> Picture:
        """RMS of the model error over a quantity, before and after.

        Args:
            over: name of the quantity; by default the first of the report.

        Raises:
            InputError: there is no such quantity.
        """
        names = {q.name: q for q in QUANTITIES}
        quantity = QUANTITIES[0] if over is None else names.get(over)
        if quantity is None:
            raise InputError(f"no quantity '{over}'; there are {', '.join(names)}")
        c = self._comparison
        errors = binned_errors(quantity, c.evaluations, c.omega_std)
        return _drawn(lambda: figures.profile(quantity, errors, self._learned))

    def omega(self, run: int = 0) -> Picture:
        """The model error over time, and what of it is explained, of the run with this number."""
        e, std = self._comparison.evaluations[run], self._comparison.omega_std[run]
        return _drawn(lambda: figures.model_error(e, std, self._learned))

    def track(self, run: int = 0) -> Picture:
        """Measured and predicted track of the run with this number."""
        return _drawn(lambda: tracks.track(self._comparison.evaluations[run], self._learned))

    def ranking(self) -> Picture:
        """The candidates by their loss.

        Raises:
            InputError: none was compared.
        """
        ranked = [r for r in self._content.ranking if r.score is not None]
        if not ranked:
            raise InputError("no candidates were compared")
        return _drawn(lambda: figures.ranking(ranked))


def as_html(content: DiagnosisContent, plots: Plots) -> str:
    """The finding, the errors of all runs, and where the model fails, as a part of a page."""
    lines = [f"<p><b>{escape(verdict_title(content))}</b></p>"]
    lines += [f"<p>{escape(text)}</p>" for text in (content.sentence, content.remainder.sentence)]
    rows = "".join(
        f"<tr><td>{escape(e.id)}</td><td>{escape(e.equation)}</td></tr>" for e in content.accepted
    )
    lines += [f"<table>{rows}</table>"] if rows else []
    cells = "".join(map(_row, content.errors))
    over = f"over {formatting.number(content.windows.prediction)} s"
    head = f"<tr><th>run</th><th>position {over} [mm]</th><th>heading {over} [°]</th></tr>"
    lines += [f"<table>{head}{cells}</table>"]
    shown = (plots.where(), plots.omega())
    lines += [f'<div style="max-width: 36rem">{p._repr_svg_()}</div>' for p in shown]
    return f"<div>{''.join(lines)}</div>"


def _row(e: RunErrors) -> str:
    pairs = ((e.window_position_rmse, 1e3), (e.window_heading_rmse, degrees(1.0)))
    cells = "".join(
        f"<td>{formatting.number(p.before, factor=f)} → {formatting.number(p.after, factor=f)}</td>"
        for p, f in pairs
    )
    return f"<tr><td>{escape(e.run)}{' (held out)' if e.held_out else ''}</td>{cells}</tr>"
