"""The files of a planned run that a simulation or a real ship takes: scenario, and table of commands."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from cosim.results import hulls
from cosim.scenario import find_scenario

from ..predictors.black_box import POSE, TAU
from ..predictors.thrust import LONGEST_STEP
from ..report.finding_text import SHOWN
from ..report.formatting import write_json
from .designing import Designer, ScoredPlan
from .information import Knowledge
from .planned_motion import PlannedMotion
from .spread import Spread

TARGET = [f"{axis}_t{order}" for order in ("", "_dot", "_ddot") for axis in ("x", "y", "psi")]
MEASURED = ["observer.x_m", "observer.y_m", "observer.psi_m"]


def scenario_file(n: int) -> str:
    return f"scenario_{n}.json"


def commands_file(n: int) -> str:
    return f"commands_{n}.csv"


def picture_file(n: int) -> str:
    return f"track_{n}.png"


def write_run(d: Designer, found: ScoredPlan, number: int, folder: Path, ship: str | None) -> None:
    """Write the scenario of a run, and its set points or orders, which a real ship can take.

    With set points, the columns tau_X, tau_Y and tau_N are the force that the likeliest model needs:
    feed-forward. With orders, the track is that of this model.
    """
    h = LONGEST_STEP * d.scale
    (fine,) = d.motions([found.steps], found.size, h)
    orders = d.orders
    if orders is None:
        parts = [fine.eta_dot, fine.eta_ddot, fine.thrust(d.model)]
        given, names, header = "controller", TARGET, [*TARGET, *TAU]
    else:
        assert fine.orders is not None
        parts, given, names = [fine.orders], "thrusters", orders.names
        header = [*POSE, *names]
    table = np.column_stack([fine.time, fine.eta, *parts])
    header = ",".join(["time", *header])
    np.savetxt(folder / commands_file(number), table, "%.10g", delimiter=",", header=header, comments="")
    content = _without_guidance("ellipse" if orders is None else "kvlcc2_zigzag")
    if orders is None:
        content["roles"] = {"target": [f"controller.{n}" for n in TARGET[:3]]}
    else:
        content["fmus"]["thrusters"]["parameters"] = {}
    x, y, psi = map(float, fine.eta[0])
    noise = [float(s) for s in d.data[0].smoothed.noise]
    content["fmus"]["vessel"]["parameters"] = {"x_0": x, "y_0": y, "psi_0": psi}
    content |= {
        "name": f"next_{number}",
        "description": "Designed by cybership next",
        "step": h,
        "stop": round(round(d.limits.seconds / h) * h, 9),
        "recordings": [{"path": commands_file(number), "inputs": {f"{given}.{n}": n for n in names}}],
        "faults": [{"kind": "noise", "signals": MEASURED, "std": noise}],
        "metrics": {},
    }
    if ship is not None:
        content["ship"] = ship
    write_json(folder / scenario_file(number), content)


def _without_guidance(name: str) -> dict[str, Any]:
    """A shipped scenario, to which a recording gives the set points or the orders."""
    content = json.loads(find_scenario(name).read_text(encoding="utf-8"))
    del content["fmus"]["guidance"]
    kept = [c for c in content["connections"] if not any(end.startswith("guidance.") for end in c)]
    return content | {"connections": kept}


def draw(d: Designer, k: Knowledge, motion: PlannedMotion, spread: Spread, path: Path) -> None:
    """Draw a run: basin, target, tracks under each likely hypothesis, outlines of the ship."""
    from matplotlib.figure import Figure

    eta = motion.eta
    basin = d.basin
    figure = Figure(figsize=(8.0, 6.0), dpi=120)
    axes = figure.add_subplot()
    (south, north), (west, east) = basin.north, basin.east
    axes.plot([west, east, east, west, west], [south, south, north, north, south], "k", label="basin")
    for colour, (n, tracks) in enumerate(zip(spread.ids, spread.eta, strict=True)):
        name = f"under {k.hypotheses[n].name}"
        for m, track in enumerate(tracks):
            label = "_" if m else name  # matplotlib leaves a label with an underscore out
            colour_of = {"color": f"C{colour}", "alpha": 0.4, "linewidth": 0.7}
            axes.plot(track[:, 1], track[:, 0], label=label, **colour_of)
    axes.plot(eta[:, 1], eta[:, 0], "k--", linewidth=0.8, label="target")
    for corners in hulls(eta[np.linspace(0, len(eta) - 1, 2 * SHOWN).astype(int)], d.outline):
        axes.plot(*np.vstack([corners, corners[:1]]).T, color="0.5", linewidth=0.5)
    axes.plot(eta[0, 1], eta[0, 0], "ko", markersize=4, label="start")
    axes.set_aspect("equal")
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize="small")
    figure.savefig(path, format="png", bbox_inches="tight")
