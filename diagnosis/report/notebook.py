"""A diagnosis in a notebook: the finding, a table, pictures."""

from collections.abc import Sequence
from html import escape
from math import degrees

from cosim import InputError
from cosim.results import Drawn

from ..predictors.evaluation import Evaluation
from . import figures, formatting, tracks
from .chart import Chart
from .headline import headline, verdict_title
from .report_data import ReportData


class Picture(Drawn):
    """A chart of the report; a notebook shows it as SVG."""

    def __init__(self, chart: Chart) -> None:
        super().__init__(chart.figure())
        self.chart = chart

    def _repr_svg_(self) -> str:
        return self.chart.svg("picture", "picture of a diagnosis")


class Plots:
    """The pictures of a diagnosis."""

    def __init__(self, data: ReportData) -> None:
        self._data, self._comparison = data, data.comparison

    def where(self, over: str | None = None) -> Picture:
        """RMS of the model error over a quantity, before and after.

        Args:
            over: name of the quantity; by default the first of the report.

        Raises:
            InputError: there is no such quantity.
        """
        names = {label.partition(" [")[0]: c for c, label in figures.LABELS.items()}
        covariate = names.get(over or next(iter(names)))
        if covariate is None:
            raise InputError(f"no quantity '{over}'; there are {', '.join(names)}")
        c = self._comparison
        after = c.after.profiles if self._data.learned else None
        return Picture(figures.profile(covariate, c.before.profiles, after))

    def omega(self, run: int = 0) -> Picture:
        """The model error over time, and what of it is explained, of the run with this number."""
        c = self._comparison
        return Picture(figures.model_error(c.evaluations[run], c.omega_std[run], self._data.learned))

    def track(self, run: int = 0) -> Picture:
        """Measured and predicted track of the run with this number."""
        return Picture(tracks.track(self._comparison.evaluations[run], self._data.learned))

    def ranking(self) -> Picture:
        """The candidates by their loss.

        Raises:
            InputError: none was compared.
        """
        ranked = self._data.ranking
        if not ranked:
            raise InputError("no candidates were compared")
        return Picture(figures.ranking(ranked))


def as_html(r: ReportData) -> str:
    """The finding, the errors of all runs, and where the model fails, as a part of a page."""
    assert r.diagnosis is not None
    plots, over = Plots(r), f"over {formatting.number(r.lengths[0])} s"
    lines = [f"<p><b>{escape(verdict_title(r))}</b></p>"]
    lines += [f"<p>{escape(text)}</p>" for text in (headline(r), r.diagnosis.remainder.sentence)]
    lines += _table([(e.id, e.equation) for e in r.accepted])
    head = f"<tr><th>run</th><th>position {over} [mm]</th><th>heading {over} [°]</th></tr>"
    lines += _table([(r.called(e), *_changes(e)) for e in r.evaluations], head)
    shown = (plots.where(), plots.omega())
    lines += [f'<div style="max-width: 36rem">{p._repr_svg_()}</div>' for p in shown]
    return f"<div>{''.join(lines)}</div>"


def _changes(e: Evaluation) -> list[str]:
    """Errors of position [mm] and heading [°], before and after."""
    pairs = (
        (e.before.position, e.after.position, 1e3),
        (e.before.heading, e.after.heading, degrees(1.0)),
    )
    return [" → ".join(formatting.number(x, factor=f) for x in pair) for *pair, f in pairs]


def _table(rows: Sequence[Sequence[str]], head: str = "") -> list[str]:
    cells = ("".join(f"<td>{escape(cell)}</td>" for cell in row) for row in rows)
    body = "".join(f"<tr>{row}</tr>" for row in cells)
    return [f"<table>{head}{body}</table>"] if rows else []
