"""A diagnosis in a notebook: the finding, a table, pictures."""

from cosim import InputError
from cosim.results import Drawn

from .headline import cause, headline, verdict_title
from .page import rendered
from .pictures import figures, tracks
from .pictures.chart import Chart
from .report_data import ReportData


class NotebookChart(Drawn):
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

    def where(self, over: str | None = None) -> NotebookChart:
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
        return NotebookChart(figures.profile(covariate, c.before.profiles, after))

    def omega(self, run: int = 0) -> NotebookChart:
        """The model error over time, and what of it is explained, of the run with this number."""
        c = self._comparison
        return NotebookChart(
            figures.model_error(c.evaluations[run], c.omega_std[run], self._data.learned)
        )

    def track(self, run: int = 0) -> NotebookChart:
        """Measured and predicted track of the run with this number."""
        return NotebookChart(tracks.track(self._comparison.evaluations[run], self._data.learned))

    def free(self) -> NotebookChart:
        """The run of which least was used, predicted as a whole, with the cause that was found."""
        return NotebookChart(tracks.free(self._data.least_used, cause(self._data)))

    def ranking(self) -> NotebookChart:
        """The candidates by their loss.

        Raises:
            InputError: none was compared.
        """
        ranked = self._data.ranking
        if not ranked:
            raise InputError("no candidates were compared")
        return NotebookChart(figures.ranking(ranked))


def as_html(r: ReportData) -> str:
    """The finding, the errors of all runs, and where the model fails, as a part of a page."""
    plots = Plots(r)
    return rendered(
        "notebook.html",
        r=r,
        diagnosis=r.diagnosis,
        verdict=verdict_title(r),
        sentence=headline(r),
        pictures=[p._repr_svg_() for p in (plots.where(), plots.omega())],
    )
