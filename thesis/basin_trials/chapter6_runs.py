"""The runs of the study of chapter 6: the trials, and experiments on the causes of what they show."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from studies.study_command import progress

from ..monte_carlo import Content, run_all, vary
from .causes import DELAYS
from .found import BLOCKED, FAULTY, FRESH, OPENED, PRINTED, REGULAR, TrialRuns
from .margin import SETTINGS
from .store_contents import logged, store_contents
from .trials import ABS, CLE, CLZ, CONTROLLERS, TRIALS, Sailed, Trial, gains, sailed, scenario

CL = ("controller_cl_win_eps", "controller_cl_win_z2", "controller_cl_svd_eps", "controller_cl_svd_z2")
FEW = 3  # seeds of the experiments in which little is random
OFF = 1e6
OPEN = {f"controller.{name}": OFF for name in ("tau_max", "nu_dot_max", "nu_max")}
# Twice the acceleration that is estimated on the ellipse, a spike's is three times this.
BLOCKER = {"controller.tau_max": 3.0, "controller.nu_dot_max": 0.1, "controller.nu_max": 1.0}
STALE = {"controller.stale": 1.0}
STORES = {
    PRINTED: OPEN | STALE,
    f"{PRINTED}, blocker": BLOCKER | STALE,
    FRESH: OPEN,
    f"{FRESH}, blocker": BLOCKER,
}

Jobs = dict[Any, dict[str, Content]]
# What is hidden in the plant: ``instance.parameter`` -> value.
Plant = Mapping[str, float]


def trials(all_trials: Sequence[Trial], plant: Plant) -> Jobs:
    """(trial, with the guidance fault) -> controller -> scenario."""
    return {
        (t.name, faulty): {c: scenario(t, c, faulty, plant=plant) for c in CONTROLLERS}
        for t in all_trials
        for faulty in (REGULAR, FAULTY)
    }


def spiked(trial: Trial, plant: Plant) -> Jobs:
    """(store, with spikes) -> controller -> scenario."""
    return {
        (store, spikes): {c: scenario(trial, c, spikes=spikes, parameters=p, plant=plant) for c in CL}
        for store, p in STORES.items()
        for spikes in (False, True)
    }


def slow_eight(trial: Trial, plant: Plant) -> Jobs:
    """(blocker, with spikes) -> controller -> scenario: what is not among the trials."""
    return {
        (OPENED, False): {c: scenario(trial, c, spikes=False, plant=plant) for c in (CLZ, CLE)},
        (BLOCKED, True): {c: scenario(trial, c, parameters=BLOCKER, plant=plant) for c in (CLZ, CLE)},
    }


def delayed(trial: Trial, plant: Plant) -> Jobs:
    """(gains, delay of the thrusters [s]) -> controller -> scenario; half a run."""
    half, own = trial._replace(seconds=0.5 * trial.seconds), plant.get("thrusters.delay", 0.0)
    return {
        (name, delay): {
            c: scenario(half, c, False, False, gains(*k) | {"thrusters.delay": own + delay}, plant)
            for c in (ABS, CLZ)
        }
        for name, k in SETTINGS.items()
        for delay in DELAYS
    }


def storing(trial: Trial, plant: Plant) -> dict[str, Content]:
    """Controller -> scenario with spikes and no blocker, of which all is logged that its store needs."""
    return {
        c: vary(scenario(trial, c, parameters=OPEN, plant=plant), log={"signals": logged(f"{c}.fmu")})
        for c in CL
    }


def run(
    out: Path, seeds: Sequence[int], shorter: float, jobs: int | None, plant: Plant, causes: bool
) -> TrialRuns:
    """Everything; the logs of the first seed of each trial stay in ``logs``.

    Args:
        out: folder of the report.
        seeds: of noise, freezes and spikes.
        shorter: factor on the time of every run.
        jobs: runs at a time.
        plant: what is hidden.
        causes: whether the experiments on spikes, stores and delay are made as well.
    """
    every = [t._replace(seconds=shorter * t.seconds) for t in TRIALS]
    few, slow = seeds[:FEW], every[0]
    sailing = trials(every, plant)
    groups = [
        (spiked(slow, plant), few),
        (slow_eight(every[1], plant), seeds),
        (delayed(slow, plant), few),
    ]
    stores = storing(slow, plant)
    if not causes:
        groups, stores = [({}, few)] * 3, {}
    every_group = [(sailing, seeds), *groups, ({"": stores}, few)]
    total = sum(len(c) * len(s) for group, s in every_group for c in group.values())
    with progress(total, "chapter 6") as advance:
        logs = out / "logs"
        first = together(sailing, seeds[:1], logs, jobs, advance)
        rest = together(sailing, seeds[1:], None, jobs, advance)
        sailed_all = {k: {c: first[k][c] + rest[k][c] for c in runs} for k, runs in first.items()}
        others = [together(group, some, None, jobs, advance) for group, some in groups]
        kept = run_all(stores, few, store_contents, None, jobs, advance)
    return TrialRuns(sailed_all, others[0], others[1], others[2], kept)


def folder(key: tuple[str, float]) -> str:
    """A name for the logs of one setting."""
    return f"{key[0]} {float(key[1]):g}".replace(" ", "_").replace(",", "").replace(".", "")


def together(
    group: Jobs, seeds: Sequence[int], logs: Path | None, jobs: int | None, advance: Callable[[], None]
) -> dict[Any, dict[str, list[Sailed]]]:
    """All runs of a group in one pool; logs go to ``<logs>/<folder of the key>/<controller>/<seed>``."""
    flat = {f"{folder(k)}/{c}": content for k, each in group.items() for c, content in each.items()}
    runs = run_all(flat, seeds, sailed, logs, jobs, advance)
    return {k: {c: runs[f"{folder(k)}/{c}"] for c in each} for k, each in group.items()}
