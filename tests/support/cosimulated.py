"""Ships of the hidden effects one by one in co-simulation, against which fleets are held."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import cosim
from benchmarks.hidden_effects.manoeuvres import GUIDANCE, Manoeuvre
from benchmarks.hidden_effects.simulated_runs import (
    COMMANDS,
    FAR,
    FORCE,
    MEASURED,
    OMEGA,
    OTHER,
    SETTLED,
    SHIP,
    TARGET,
    Hidden,
    RunawayError,
    Voyage,
    scenario,
)
from diagnosis import Run
from fmus.build import BuildError, native_targets
from fmus.build import build as build_fmus

from .project import ROOT

HERE = ROOT / "benchmarks" / "hidden_effects"


def sail(manoeuvre: Manoeuvre, hidden: Hidden, noise: float, seed: int, fmus: Path) -> Voyage:
    """Run the ship along a manoeuvre.

    Arguments as of :func:`benchmarks.hidden_effects.simulated_runs.scenario`; :func:`build` made the FMUs.

    Raises:
        RunawayError: the ship did not stay on its path.
    """
    content = scenario(manoeuvre, hidden, noise, seed, fmus)
    with TemporaryDirectory() as folder:
        result = cosim.simulate(cosim.load_scenario(content), folder)
        if result.status == "interrupted":
            raise KeyboardInterrupt
        if result.status != "done":
            raise RunawayError(result.message)
        log = cosim.read_log(folder)
    eta, nu, nu_dot, tau, omega, pose, commands, target = (
        np.column_stack([log[name] for name in names])
        for names in (SHIP[:3], SHIP[3:6], SHIP[6:], FORCE, OMEGA, MEASURED, COMMANDS, TARGET)
    )
    tracking = log["time"] > SETTLED
    if np.hypot(*(eta[tracking, :2] - target[tracking]).T).max() > FAR:
        raise RunawayError(f"more than {FAR:g} m from the target")
    measured = Run(manoeuvre.kind, log["time"], pose, commands)
    return Voyage(measured, eta, nu, nu_dot, tau, omega)


def build(folder: Path) -> None:
    """Put all FMUs that runs need into a folder."""
    names = ["vessel", "thrusters", "observer_kalman", "controller_abs", *GUIDANCE]
    files = [HERE / f"{name}.py" for name in OTHER]
    try:
        build_fmus([*names, *files], folder, native=native_targets())
    except BuildError:  # no compiler
        build_fmus([*names, *files], folder)
