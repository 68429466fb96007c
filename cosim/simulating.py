"""A run from Python: :func:`cosim.simulate`."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, Any, TypedDict

from cybership.renamed import renamed_keyword

from .errors import InputError
from .master import simulation
from .master.ending import Result
from .scenario.load import cut_short, load_scenario, with_settings
from .scenario.schema import Scenario

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .system.instance_pool import InstancePool


_alone = threading.Lock()
_running: threading.Thread | None = None


@contextmanager
def _one_at_a_time() -> Iterator[None]:
    """Wait until no other thread of this process simulates.

    Raises:
        InputError: this thread does.
    """
    global _running
    if _running is threading.current_thread():
        raise InputError("a run cannot start another one in its own process: use processes")
    with _alone:
        _running = threading.current_thread()
        try:
            yield
        finally:
            _running = None


class Options(TypedDict, total=False):
    """What else a run can be distinguished, see :func:`cosim.master.simulation.simulate`."""

    realtime: float | None
    pictures: bool
    only_own: bool
    show: Callable[[str], None]
    progress: Callable[[float], None]
    pool: InstancePool | None
    native: bool | str | None
    overwrite: bool
    measured: Callable[[dict[str, float]], None]


@renamed_keyword("believe", "controller_model")
def simulate(
    scenario: Scenario | str | Path | dict[str, Any],
    out: str | Path | None = None,
    parameters: str | Path | Sequence[str | Path] = (),
    *,
    stop: float | None = None,
    step: float | None = None,
    seed: int | None = None,
    ship: str | Path | None = None,
    log: str | None = None,
    parquet: bool = False,
    set: Mapping[str, Any] | None = None,  # noqa: A002 - as the option of the command
    controller_model: str | Path | Sequence[str | Path] = (),
    **options: Unpack[Options],
) -> Result:
    """Run a scenario, and write its log and metrics.

    In a thread it works, too; several threads wait for each other, as the FMUs of one process share its
    working directory. For runs side by side use processes: :func:`cosim.run_campaign`.

    Args:
        scenario: the name of a shipped one (``"ellipse"``), a file, its content, or what
            :func:`cosim.load_scenario` gives.
        out: result folder; by default ``results/<name>`` in the working directory, or, where another run
            is there, ``results/<name>_2`` and so on.
        parameters: SSP parameter sets for the plant, whose values override the scenario's.
        stop, step: end and base step [s], in place of the scenario's; a run that ends before the window
            of its metrics begins is measured from its start.
        seed: of noise and faults, in place of the scenario's.
        ship: whose FMUs those with a bare name are, in place of the scenario's: the name of a shipped
            one, or the ``.toml`` file that describes it, relative to the working directory.
        log: which signals: ``"all"``, or ``"compact"``, what metrics, pictures and the diagnosis need.
        parquet: whether to write ``log.parquet`` in place of ``log.csv``.
        set: values by their paths, as ``{"vessel.m": 15.0, "controller": "./mine.fmu", "stop": 60.0}``;
            files are relative to the working directory.
        controller_model: SSP parameter sets for the controller models in controllers and observers.
        options: ``realtime``: simulated seconds for each second of wall time. ``pictures``: whether to
            write them. ``only_own``: whether to refuse FMUs with programs that were not built on this
            computer. ``show``: receives notes, a line each. ``progress``: receives the simulated time
            [s]. ``native``: whether to compile. ``overwrite``: use ``results/<name>`` in any case.
            ``measured``: receives the metrics before anything is drawn.

    Returns:
        How it ended, with ``metrics``, ``log``, ``plot()``. A failed or interrupted run keeps its log.

    Raises:
        InputError: the scenario cannot be run; nothing has been written.
    """
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    if log not in (None, "all", "compact"):
        raise InputError(
            f"log is 'all' or 'compact', not {log!r}; signals by name: set={{'log.signals': ...}}"
        )
    if not isinstance(set, (Mapping, NoneType)):
        raise InputError("set is a dict of paths and values, such as {'vessel.m': 15.0}")
    chosen = {"stop": stop, "step": step, "seed": seed, "log.signals": log}
    settings = dict(set or {}) | {path: value for path, value in chosen.items() if value is not None}
    settings |= {"log.format": "parquet"} if parquet else {}
    settings |= {} if ship is None else {"ship": str(ship)}
    if settings:
        scenario = with_settings(scenario, settings.items(), Path.cwd(), "set")
    if "stop" in settings:
        scenario = cut_short(scenario)
    sets, controllers = (
        [p] if isinstance(p, (str, Path)) else p for p in (parameters, controller_model)
    )
    with _one_at_a_time():
        return simulation.simulate(scenario, out, sets, controller_model=controllers, **options)
