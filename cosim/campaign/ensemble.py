"""One scenario with many ships: a model's parameters drawn from what is known of them together.

An ensemble is a campaign whose axes are the parameters, each with the values that were drawn for the
members; noise and faults are the same in each, so that what differs is the model.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table

from cybership.renamed import renamed_keyword
from cybership.scratch_folder import atomic_write

from ..errors import InputError, SimulationError, nearest
from ..results.log import read_log
from ..scenario.schema import LogOptions, Scenario
from ..scenario.shipped import find_parameters
from ..system.preparation import prepare
from ..trials.measures import EVERY
from .conduct import Progress, demand_packages, run_campaign
from .posterior import Posterior, read_posterior
from .run_table import log_folder

if TYPE_CHECKING:
    import pandas

    from ..system.system import System

BANDS = "bands.csv"
PICTURE = "bands.png"
# Rows of a member's log, at the most about: more than a picture has points.
ROWS = 2000
# Quantiles of the bands: the inner one holds 50 %, the outer one 90 % of the members.
QUANTILES = (0.05, 0.25, 0.75, 0.95)
POSE = ("x", "y", "psi")


@renamed_keyword("believe", "controller_model")
def run_ensemble(
    scenario: Scenario,
    posterior: Path,
    members: int,
    out: str | Path | None = None,
    parameters: Sequence[str | Path] = (),
    controller_model: Sequence[str | Path] = (),
    only_own: bool = False,
    workers: int | None = None,
    pictures: bool = True,
    show: Callable[[str], None] = lambda _: None,
    progress: Progress = lambda ended, failed, of: None,
    overwrite: bool = False,
) -> pandas.DataFrame:
    """Run a scenario with parameters drawn from their multivariate normal distribution.

    Members that have finished in the same folder before are not run again. Beside the files of a
    campaign the folder gets ``bands.csv`` and ``bands.png``, see :func:`bands`.

    Args:
        scenario: from :func:`cosim.load_scenario`; its seed is that of the draws, too.
        posterior: ``posterior.json``: mean and covariance of parameters.
        members: how many ships are drawn, at least two.
        out: result folder; default ``results/<name>_ensemble`` in the working directory.
        parameters: SSP parameter sets for the plant, under the values that are drawn.
        controller_model: SSP parameter sets for the controller models in controllers and observers.
        only_own: whether to refuse FMUs with programs that were not built on this computer.
        workers: processes; None is one for each core, 0 runs in this process.
        pictures: whether to draw.
        show: receives notes, a line each.
        progress: receives how many members have ended, how many of them failed, and how many there are.
        overwrite: whether members of another ensemble in the folder may vanish.

    Returns:
        One row a member: the values drawn, metrics, ``status``, ``message``, ``wall_s`` [s], ``hash``.

    Raises:
        InputError: the scenario or the posterior cannot be used; nothing has run.
        SimulationError: no member went through, or the workers were lost.
    """
    if members < 2:
        raise InputError(f"an ensemble needs two members or more; got {members}")
    demand_packages()
    given = read_posterior(posterior)
    overrides, controllers = (list(find_parameters(p)) for p in (parameters, controller_model))
    system = prepare(scenario, overrides, only_own, controller_models=controllers)
    try:
        for warning in system.warnings:
            show(f"warning: {warning}")
        beside = {name for _, content in overrides for name in content.beside}
        axes = _axes(system, given, members, beside, posterior, show)
        base = _resolved(system)
    finally:
        system.close()
    folder = Path("results", f"{scenario.name}_ensemble") if out is None else Path(out)
    content = {"scenario": scenario.name, "axes": axes, "design": "list", "seed": scenario.seed}
    table = run_campaign(
        content,
        folder,
        workers,
        keep_logs=True,
        show=show,
        progress=progress,
        overwrite=overwrite,
        base=base,
    )
    done = table.query("status == 'done'")
    if not len(done):
        raise SimulationError(f"every member failed: {table['message'].iloc[0]}")
    logs = [read_log(log_folder(folder, name), scenario.roles.pose) for name in done["hash"].tolist()]
    poses = np.array([[log[name] for name in scenario.roles.pose] for log in logs])
    poses[:, 2] = np.unwrap(poses[:, 2])
    found = bands(logs[0]["time"], poses)
    with atomic_write(folder / BANDS) as scratch:
        found.to_csv(scratch, index=False, float_format="%.10g")
    if pictures:
        from .charts import draw_bands

        with atomic_write(folder / PICTURE) as scratch:
            draw_bands(found, poses).savefig(scratch, format="png")
    return table


def _axes(
    system: System,
    given: Posterior,
    members: int,
    beside: set[str],
    path: Path,
    show: Callable[[str], None],
) -> dict[str, object]:
    """The axes of the campaign: where each parameter is set, and its value in each member.

    Raises:
        InputError: a name that no FMU here has, or another unit than the FMU's.
    """
    values = given.draws(members, np.random.default_rng(system.scenario.seed))
    axes: dict[str, object] = {}
    for name, unit, drawn in zip(given.names, given.units, values.T, strict=True):
        model, _, parameter = name.partition(".")
        if name in beside:
            show(f"note: '{path}': {name} is not a parameter of an FMU and has no effect here")
            continue
        instances = [n for n, m in system.models.items() if m.name == model]
        if not instances:
            known = nearest(model, {m.name for m in system.models.values()})
            raise InputError(f"'{path}': no model '{model}' for '{name}' runs here{known}")
        declared = system.models[instances[0]].variables
        settable = {n: v for n, v in declared.items() if v.causality == "parameter" and v.type == "Real"}
        if parameter not in settable:
            raise InputError(
                f"'{path}': {model} has no parameter '{parameter}'{nearest(parameter, settable)}"
            )
        variable = settable[parameter]
        if variable.unit is not None and unit != variable.unit.name:
            raise InputError(
                f"'{path}': {name} is in '{unit}', and in '{variable.unit.name}' in the FMU"
            )
        within = np.clip(drawn, variable.min, variable.max)
        if outside := int((within != drawn).sum()):
            show(f"note: {outside} of {members} values drawn for {name} are clipped to its range")
        places = [f"fmus.{instance}.parameters.{parameter}" for instance in instances]
        axes[name] = {"set": places, "values": within.tolist()}
    if not axes:
        raise InputError(f"'{path}' has no parameter of an FMU that runs here")
    return axes


def _resolved(system: System) -> Scenario:
    """The scenario with all start values in it, that logs no more than the pose."""
    scenario = system.scenario
    fmus = {
        name: entry.model_copy(
            update={"parameters": {v.name: x for v, x in system.parameters[name]}, "table": None}
        )
        for name, entry in scenario.fmus.items()
    }
    steps = round(scenario.stop / scenario.step)
    log = LogOptions(
        signals=list(scenario.roles.pose), every=max(1, -(-steps // ROWS)), format="parquet"
    )
    return scenario.model_copy(update={"fmus": fmus, "log": log})


def spread(made: pandas.DataFrame) -> Table:
    """The metrics of the members for the terminal."""
    shown = Table(title="Performance of the members", title_justify="left", box=None, pad_edge=False)
    for name in ("metric", "mean", "5 %", "95 %", "unit", "meaning"):
        shown.add_column(name, justify="right" if name in ("mean", "5 %", "95 %") else "left")
    for name, unit, meaning in EVERY:
        if name in made and len(values := made[name].dropna()):
            numbers = (values.mean(), values.quantile(0.05), values.quantile(0.95))
            shown.add_row(name, *(f"{x:.4g}" for x in numbers), unit, meaning)
    return shown


def bands(time: np.ndarray, poses: np.ndarray) -> pandas.DataFrame:
    """Where the members are, against time.

    Args:
        time: (n,) [s].
        poses: (members, 3, n), north, east [m] and heading, continuous over turns [rad].

    Returns:
        A row an instant: ``time`` [s]; of ``x``, ``y`` [m] and ``psi`` [rad] the ``_mean`` over the
        members and the quantiles ``_5``, ``_25``, ``_75``, ``_95`` [%], between which are 90 and 50 % of
        them; ``track_50`` and ``track_90`` [m], the distances from the mean position within which they
        are.
    """
    import pandas

    columns: dict[str, np.ndarray] = {"time": time}
    for k, name in enumerate(POSE):
        columns[f"{name}_mean"] = poses[:, k].mean(axis=0)
        for q, values in zip(QUANTILES, np.quantile(poses[:, k], QUANTILES, axis=0), strict=True):
            columns[f"{name}_{100.0 * q:g}"] = values
    away = np.linalg.norm(poses[:, :2] - poses[:, :2].mean(axis=0), axis=1)
    for share in (50, 90):
        columns[f"track_{share}"] = np.quantile(away, share / 100.0, axis=0)
    return pandas.DataFrame(columns)
