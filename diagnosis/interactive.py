"""The diagnosis from Python: runs from files, and a result that shows itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from cosim import InputError
from fmus.ships.naming import DEFAULT as DEFAULT_SHIP

from . import session
from .assessment.gathering import gather
from .design import Plan, Question, plan_next
from .design.designing import limits_of
from .execution.progress import Advance, silent
from .predictors import (
    Model,
    ModelSource,
    WeakWindows,
    nominal,
    open_model,
    ship_of_model,
    ship_with,
    write_model,
)
from .report.content import Content, file_content
from .report.notebook import Plots, as_html
from .report.page import write_report
from .report.report_data import ReportData
from .report.terminal import as_text, show_calibration, show_comparison, summary
from .runs import Run, read_frame, ship_of_logs
from .search import DEFAULT, Method, Prior, shares
from .verdict.pruning_criteria import PAIRED

if TYPE_CHECKING:
    from typing import TypeAlias

    import pandas

    from cosim import Result

    Source: TypeAlias = str | Path | Result | pandas.DataFrame

AXES = ("X", "Y", "N")
T = TypeVar("T")


def load(
    sources: Source | Sequence[Source],
    anyway: bool = False,
    advance: Advance = silent,
    model: Model | None = None,
    ship: str | Path | None = None,
    horizon: float | None = None,
) -> list[WeakWindows]:
    """Read and smooth measured runs.

    Args:
        sources: one or several: files (CSV, Parquet, MATLAB), folders of logs, results of
            :func:`cosim.simulate`, tables with the columns of a file and units in their names
            (``x [mm]``) or in ``attrs["units"]``.
        anyway: whether a file is used although its units, signs or columns seem wrong.
        advance: receives the name of each step when it begins.
        model: the initial one, by which that is judged, and of whose ship they are; the nominal one by
            default.
        ship: whose nominal model that is: the name of a shipped ship, or the path of a description; by
            default the one that logs among the sources are of.
        horizon: length of the windows in which models predict the runs [s]; by default that of the ship.

    Returns:
        The runs, for :func:`diagnose`, :func:`diagnosis.evaluate` and :class:`diagnosis.Windows`.

    Raises:
        InputError: a run cannot be used, or is given twice.
    """
    import pandas  # a library, and simulations, that take as long to import as a run to read

    from cosim import Result

    every = _listed(sources)
    model = _model_of(model, ship, every)
    found: list[str | Path | Run] = []
    for k, source in enumerate(every, 1):
        if isinstance(source, pandas.DataFrame):
            found.append(read_frame(source, f"table {k}", model.ship))
        elif isinstance(source, Result):
            found.append(source.folder)
        elif isinstance(source, (str, Path)):
            found.append(source)
        else:
            kind = type(source).__name__
            raise InputError(f"a run is a file, a folder, a result or a table, not of type {kind}")
    return gather(found, advance, anyway, model, horizon)


def _model_of(
    model: Model | None,
    name: str | Path | None,
    runs: Sequence[Any],
    file: str | Path | None = None,
) -> Model:
    """The initial model: a given one, or the nominal one of a ship, by default that of the runs.

    Where these name none, it is the one that a model file is of.
    """
    if model is not None and name is not None:
        raise InputError("model already has a ship: give model or ship, not both")
    if model is not None:
        return model
    loaded = [w for w in runs if isinstance(w, WeakWindows)]
    if loaded and name is None:
        return nominal(loaded)
    if name is None:
        files = [getattr(run, "folder", run) for run in runs]  # of a result of a simulation
        stated = ship_of_logs(Path(f) for f in files if isinstance(f, (str, Path)))
        name = stated[0] if stated else ship_of_model(file)
    return Model(ship=ship_with((), name))


def _opened(
    model: Model | ModelSource | str | Path | None,
    map: str | Path | None,  # noqa: A002
    ship: str | Path | None,
    runs: Sequence[Any],
) -> tuple[Model | ModelSource, Model]:
    """The initial model, read if it is a file, and the model of the ship by which runs are read."""
    file = model if isinstance(model, (str, Path)) else None
    of = _model_of(model if isinstance(model, Model) else None, ship, runs, file)
    if isinstance(model, (str, Path)):
        model = open_model(model, map, of.ship)
        of = model.start or of
    return model or of, of


def _are_loaded(runs: Any) -> bool:
    """Whether these are runs from :func:`load`."""
    return bool(runs) and all(isinstance(w, WeakWindows) for w in runs)


def _listed(runs: Any) -> Sequence[Any]:
    """Runs or their sources, of which one may stand alone."""
    return runs if isinstance(runs, (list, tuple)) else [runs]


@dataclass(frozen=True, eq=False, repr=False)
class ShownComparison(session.Comparison):
    """A comparison; shows itself in a terminal as the command does, and in a notebook with pictures."""

    @cached_property
    def _report(self) -> ReportData:
        return ReportData.of(self)

    @property
    def plot(self) -> Plots:
        """Pictures: ``plot.where()``, ``plot.omega()``, ``plot.track()``."""
        return Plots(self._report)

    def write_report(self, path: str | Path = "report.html") -> Path:
        """Write the report of ``python -m diagnosis.compare``: one HTML file that needs no other."""
        return write_report(path, self._report)

    def __repr__(self) -> str:
        return as_text(show_comparison(self._report))

    def _repr_html_(self) -> str:
        return as_html(self._report)


@dataclass(frozen=True, eq=False, repr=False)
class ShownCalibration(session.CalibratedModel):
    """A calibrated model; shows itself in a terminal as ``learn --quick`` does, and in a notebook."""

    @cached_property
    def _report(self) -> ReportData:
        return ReportData.of(self.comparison)

    def __repr__(self) -> str:
        return as_text(show_calibration(self, self._report))

    def _repr_html_(self) -> str:
        return as_html(self._report)


@dataclass(frozen=True, eq=False, repr=False)
class ShownDiagnosis(session.Diagnosis):
    """A diagnosis; shows itself in a terminal in ten lines, and in a notebook with pictures."""

    @cached_property
    def _report(self) -> ReportData:
        return ReportData.of(self)

    @cached_property
    def content(self) -> Content:
        """What ``diagnosis.json`` of the command holds; its keys are attributes as well."""
        return file_content(self._report)

    @property
    def model(self) -> Model:
        """The learned model; where nothing was learned the initial one."""
        return self.learned.model

    @property
    def residual(self) -> pandas.DataFrame:
        """Residual of the learned model: one row a window of the weak form.

        Columns ``run``, ``held_out``, ``time`` (of the middle) [s], ``X``, ``Y`` [N], ``N`` [N m], and
        their standard deviations ``X_std``, ...; ``attrs["units"]`` has the units.
        """
        import pandas

        parts = []
        for e, std in zip(self.comparison.evaluations, self.comparison.omega_std, strict=True):
            columns = {"run": e.name, "held_out": e.held_out, "time": e.weak_windows.middle}
            columns |= {axis: e.after.omega[:, k] for k, axis in enumerate(AXES)}
            columns |= {f"{axis}_std": std[:, k] for k, axis in enumerate(AXES)}
            parts.append(pandas.DataFrame(columns))
        frame = pandas.concat(parts, ignore_index=True)
        units = {"time": "s", "X": "N", "Y": "N", "N": "N.m"}
        frame.attrs["units"] = units | {f"{axis}_std": units[axis] for axis in AXES}
        return frame

    @property
    def plot(self) -> Plots:
        """Pictures: ``plot.where()``, ``omega()``, ``track()``, ``free()``, ``ranking()``."""
        return Plots(self._report)

    def to_ssv(self, path: str | Path = "model.ssv", anyway: bool = False) -> Path:
        """Write the learned model as an SSP parameter set, for ``cosim.simulate(parameters=[...])``.

        Args:
            path: of the file; an older one is replaced.
            anyway: whether to write a model that is not sound, see :attr:`sound`.

        Raises:
            InputError: the model is not sound, or no FMU would take it.
        """
        if not (self.sound or anyway):
            raise InputError("the learned model is not stable, see .stability; anyway=True writes it")
        write_model(Path(path), self.model)
        return Path(path)

    def write_report(self, path: str | Path = "report.html") -> Path:
        """Write the report of ``python -m diagnosis.learn``: one HTML file that needs no other."""
        return write_report(path, self._report)

    def next(
        self,
        minutes: float = 4.0,
        basin: tuple[float, float] | str | Path | None = None,
        runs: int = 1,
        seed: int = 0,
        criterion: str = "certainty",
        advance: Advance = silent,
    ) -> Plan:
        """Design the runs that discriminate the candidate causes that are left.

        Args:
            minutes: length of each run.
            basin: length to the north and to the east [m] about the middle of the measured tracks, or
                the path of a JSON file with its walls. None is what the runs have used, and a ship's
                length more.
            runs: how many.
            seed: of everything random.
            criterion: ``certainty``, ``box-hill``, ``buzzi-ferraris``, ``d-optimal`` or ``a-optimal``.
            advance: receives the name of each step when it begins.

        Returns:
            The plan; ``plan.write(folder)`` writes its scenarios, set points and pictures.

        Raises:
            InputError: no run keeps the limits, or the ship cannot follow a pose.
        """
        data = [e.weak_windows for e in self.comparison.evaluations if not e.held_out]
        limits, name = limits_of(minutes, basin), self.start.ship.name
        ship = None if name == DEFAULT_SHIP else name
        known = Question(data, self.content, self.start, self.prior, limits, criterion, ship)
        return plan_next(known, runs, seed, advance)

    def __repr__(self) -> str:
        return summary(self._report)

    def _repr_html_(self) -> str:
        return as_html(self._report)


def compare(
    runs: Sequence[WeakWindows] | Source | Sequence[Source],
    model: Model | ModelSource | str | Path | None = None,
    map: str | Path | None = None,  # noqa: A002 - as the option of the command
    advance: Advance = silent,
    ship: str | Path | None = None,
) -> ShownComparison:
    """Compare a model with measured runs; ``diagnosis.compare(...)`` calls this.

    Args:
        runs: from :func:`load`, or what that takes.
        model: the nominal one of the runs' ship by default; an FMU, a Python function, or the path of
            what ``--model`` takes.
        map: file that tells which of an FMU's variables are which signals; else its names and units do.
        advance: receives the name of each step when it begins.
        ship: whose nominal model that is, as :func:`load` has it.

    Raises:
        InputError: a run or the model cannot be used.
    """
    given = _listed(runs)
    model, of = _opened(model, map, ship, given)
    loaded = given if _are_loaded(given) else load(given, model=of)
    return _shown(ShownComparison, session.evaluate(loaded, model, advance=advance))


def evaluate(
    runs: Sequence[WeakWindows],
    model: Model | ModelSource | str | Path | None = None,
    after: Model | None = None,
    held_out: Sequence[WeakWindows] = (),
    advance: Advance = silent,
) -> ShownComparison:
    """Compare a model, or two, with measured runs; see :func:`.session.evaluate`."""
    return _shown(ShownComparison, session.evaluate(runs, model, after, held_out, advance))


def _shown(kind: type[T], found: Any, **changes: Any) -> T:
    """A result of the session as one that shows itself."""
    return kind(**{f.name: getattr(found, f.name) for f in fields(found)} | changes)


def diagnose(
    runs: Sequence[WeakWindows] | Source | Sequence[Source],
    held_out: Sequence[WeakWindows] | Source | Sequence[Source] = (),
    prior: Prior = None,
    model: Model | ModelSource | str | Path | None = None,
    advance: Advance = silent,
    seed: int = 0,
    by: str | Method = DEFAULT,
    ship: str | Path | None = None,
    validate: Sequence[WeakWindows] | Source | Sequence[Source] = (),
    pruning: str = PAIRED,
) -> ShownDiagnosis:
    """Learn what a model lacks.

    Args:
        runs: to learn from: from :func:`load`, or what that takes.
        held_out: test runs, likewise: they are predicted, and decide nothing.
        prior: relative standard deviation of every nominal coefficient, or of those named (coefficients
            or groups); 0: exact; None: by where each value comes from.
        model: the initial one; the nominal one of the runs' ship by default; an FMU, a Python function,
            or the path of what ``--model`` takes. The effects of the ship are tried in addition to it.
        advance: receives the name of each step when it begins.
        seed: of everything random.
        by: method of identification, or the name of one.
        ship: whose nominal model is the initial one, as :func:`load` has it.
        validate: validation runs, likewise: they decide what is kept; without any, training data left
            out in turn do.
        pruning: criterion by which effects are rejected: "paired", "bic", or a file.

    Raises:
        InputError: too little data, or a prior that is negative, not finite, or of what is none.
    """
    choices = {"seed": seed, "by": by, "pruning": pruning}
    task = _begun(runs, validate, held_out, prior, model, ship, advance, **choices)
    found = task.diagnose()
    return _shown(ShownDiagnosis, found, comparison=_shown(ShownComparison, found.comparison))


def _begun(
    runs: Any,
    validate: Any,
    held_out: Any,
    prior: Prior,
    model: Any,
    ship: str | Path | None,
    advance: Advance,
    **options: Any,
) -> session.Session:
    """A session of runs and a model, read where they are not; arguments as of :func:`diagnose`."""
    parts = [_listed(runs), _listed(validate), _listed(held_out)]
    model, of = _opened(model, None, ship, [r for p in parts for r in p])
    shares(of.ship, prior)  # before any work
    train, decide, test = (
        p if _are_loaded(p) or not (p or p is parts[0]) else load(p, model=of) for p in parts
    )
    begun = session.begin(train, test, prior, model, advance, validate=decide, **options)
    return begun.with_likelier_commands()


def calibrate(
    runs: Sequence[WeakWindows] | Source | Sequence[Source],
    held_out: Sequence[WeakWindows] | Source | Sequence[Source] = (),
    prior: Prior = None,
    model: Model | ModelSource | str | Path | None = None,
    advance: Advance = silent,
    ship: str | Path | None = None,
    validate: Sequence[WeakWindows] | Source | Sequence[Source] = (),
) -> ShownCalibration:
    """Fit the coefficients of a model to runs, without an effect: what ``learn --quick`` does.

    Args:
        runs, held_out, prior, model, advance, ship, validate: as of :func:`diagnose`.

    Returns:
        The calibrated model, its errors, and what it gains over the initial one.

    Raises:
        InputError: too little data, a prior that is negative or not finite, or no coefficient to fit.
    """
    found = _begun(runs, validate, held_out, prior, model, ship, advance).calibrate()
    if found is None:
        raise InputError("there is no coefficient to calibrate, or the runs do not identify them")
    return _shown(ShownCalibration, found, comparison=_shown(ShownComparison, found.comparison))
