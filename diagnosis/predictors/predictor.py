"""What predicts measured runs: one protocol, and the table of what ``--model`` can name.

A :class:`ModelSource` is a model as it is given: a parameter set, an FMU, a Python function. Bound to
some runs it is a :class:`Predictor`. All else in the diagnosis knows these two only.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from cosim import InputError
from fmus.ship import Ship

from ..execution.progress import Advance, silent
from ..runs import Smoothed
from .ship_model import Model
from .weak_form import WeakWindows
from .windows import Windows


class UnmatchedError(InputError):
    """Variables that are needed are not known by their names, or not in the map.

    Attributes:
        proposal: the content of a map with those that are known.
    """

    def __init__(self, message: str, proposal: Mapping[str, Any]) -> None:
        super().__init__(message)
        self.proposal = proposal


@dataclass(frozen=True)
class PredictorDescription:
    """How a predictor that is not a model of this project predicts, for the report.

    Attributes:
        kind: ``FMU``, ``Python function``.
        name, sha256: of its file; an empty hash where there is none.
        map: which of its variables is which signal; empty where names are fixed.
        whole_runs: see :attr:`Predictor.whole`.
        run_in: name of a run -> its first part that does not count [s].
        sentences: the same for a reader.
        confinement: what confines the processes that it runs in, in words, "unconfined" where nothing
            does; empty where it is not a program of its own.
        outside: files beyond its own and those of the system that it has opened or tried to.
    """

    kind: str
    name: str
    sha256: str
    map: Mapping[str, Any]
    whole_runs: bool
    run_in: Mapping[str, float]
    sentences: Sequence[str]
    confinement: str = ""
    outside: Sequence[str] = ()


class Execution(NamedTuple):
    """How a model that is a program is run.

    Attributes:
        timeout: longest wall time of a prediction [s]; None: as usual.
        step: length of its steps [s]; None: as it declares.
        confined: whether it is kept from files, network and other processes, where the system can.
    """

    timeout: float | None = None
    step: float | None = None
    confined: bool = True


DEFAULT_EXECUTION = Execution()


class Predictor(Protocol):
    """Predicts the motion of one ship along measured runs.

    A predictor guarantees:

    - It changes no argument but ``WeakWindows.memory``, a store of intermediate results.
    - The same arguments give the same numbers, to the bit on one machine.
    - All quantities are in SI: pose (x, y, psi) [m, m, rad] north, east and clockwise, with the
      heading of residuals wrapped. Velocity (u, v, r) [m/s, m/s, rad/s] of the body over ground; force
      [N, N, N m].
    - A prediction that diverges has values that are not finite, and raises nothing.
    - A run that it cannot predict is an :class:`cosim.InputError` in one line, which names the run.

    Attributes:
        name: of the model, as messages have it.
        model: a described ship that moves as the predictor does along its runs. Its slopes by parameters
            and its model error (:func:`.weak_form.omega`) are those of the predictor, and what is
            learned is an addition to it. It may have a force over time that holds in these runs alone.
        parametric: whether ``model`` is the predictor itself. Its coefficients can then be fitted and
            calibrated, its stability is judged, and its actuators' outputs are compared.
        whole: whether a run is predicted from the predictor's own start, as its velocity cannot be set.
    """

    @property
    def name(self) -> str: ...
    @property
    def model(self) -> Model: ...
    @property
    def parametric(self) -> bool: ...
    @property
    def whole(self) -> bool: ...

    def run_in(self, smoothed: Smoothed) -> float:
        """The first part of a run that does not count [s]; zero unless :attr:`whole`."""
        ...

    def windows(self, runs: Sequence[Smoothed], length: float) -> Windows | None:
        """The windows in which a run is predicted.

        Args:
            runs: the run, or several states of it, which are predicted together.
            length: of the windows [s]; of no effect where runs are predicted as a whole.

        Returns:
            None: no window has enough samples.

        Raises:
            InputError: the run is shorter than its run-in.
        """
        ...

    def residuals(self, windows: Windows, learned: Sequence[Model] = ()) -> list[np.ndarray]:
        """Measured minus predicted pose at the samples of windows.

        Args:
            windows: from :meth:`windows`, or the same with finer steps.
            learned: ``model`` with additions, each.

        Returns:
            (samples, 3) [m, m, rad] by the predictor, then by it with each of the additions.

        Raises:
            InputError: the predictor fails.
        """
        ...

    def free_runs(
        self, smoothed: Smoothed, learned: Model | None = None, begin: float = -np.inf
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """A run as it is predicted from one state by its commands.

        Args:
            smoothed: the run.
            learned: ``model`` with additions; None: there are none.
            begin: the state is that of the last sample before [s], else of the first there is.

        Returns:
            Times (n,) [s], and the pose (n, 3) [m, m, rad] by the predictor, and with the additions.

        Raises:
            InputError: the predictor fails.
        """
        ...

    def in_windows(self) -> "Predictor":
        """Predictor of windows that begin in a measured state: itself, or ``model`` in its place."""
        ...

    def description(self) -> PredictorDescription | None:
        """How it predicts; None for a model of this project."""
        ...

    def write(
        self, folder: Path, learned: Model | None = None, runs: Sequence[WeakWindows] = ()
    ) -> list[str]:
        """Write what is needed to use the predictor again, with additions if there are some.

        Args:
            folder: for the files, which are among :data:`WRITTEN`.
            learned: ``model`` with additions; None: there are none.
            runs: of which they were learned.

        Returns:
            What was written, or why it was not, a sentence each.

        Raises:
            InputError: a parameter that no FMU would take.
        """
        ...


@runtime_checkable
class ModelSource(Protocol):
    """A model as it is given, before the runs are known.

    Attributes:
        name: as messages have it.
        start: model of the ship, by which runs are read and judged; None: that of the runs.
        parametric: as of :class:`Predictor`.
    """

    @property
    def name(self) -> str: ...
    @property
    def start(self) -> Model | None: ...
    @property
    def parametric(self) -> bool: ...

    def on(self, runs: Sequence[WeakWindows], advance: Advance = silent) -> Predictor:
        """The predictor of some runs.

        Args:
            runs: of one ship, no two of the same name.
            advance: receives the name of what takes a while.

        Raises:
            InputError: the model does not fit the runs, or fails.
        """
        ...


# Ending -> module and function of what opens such a file; imported when it is needed. The function gets
# the path and the ship, that of an FMU also the map of --map and how it is run.
SOURCES = {
    ".fmu": ("fmu.foreign_fmu", "Fmu"),
    ".ssp": ("fmu.foreign_fmu", "Fmu"),
    ".json": ("fmu.foreign_fmu", "Fmu"),
    ".py": ("python_function", "open_function"),
    ".ssv": ("described_ship", "open_parameters"),
}
# Files that predictors write.
WRITTEN = MODEL, FOUND, MAP = "model.ssv", "found.fmu", "map.json"


def open_model(
    path: str | Path | None,
    map: str | Path | None = None,  # noqa: A002 - as the option of the commands
    ship: Ship | None = None,
    execution: Execution = DEFAULT_EXECUTION,
) -> ModelSource:
    """The model in a file, by its ending; any other ending is that of a parameter set.

    Args:
        path: of the file; None: the nominal model.
        map: file that tells which of its variables are which signals.
        ship: that it is a model of; None: that of the runs.
        execution: how an FMU is run.

    Raises:
        InputError: no such file, or not what its name says; a map or execution for what is no FMU.
    """
    module, opens = SOURCES.get("" if path is None else Path(path).suffix, SOURCES[".ssv"])
    opened = getattr(import_module(f".{module}", __package__), opens)
    if opens == "Fmu":
        return opened(path, map, ship, execution)
    if map is not None:
        raise InputError("--map belongs to an FMU: --model NAME.fmu is missing")
    if execution != DEFAULT_EXECUTION:
        raise InputError(
            "--timeout, --step and --unconfined belong to an FMU: --model NAME.fmu is missing"
        )
    return opened(None if path is None else Path(path), ship)
