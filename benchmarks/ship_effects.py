"""Are hidden causes found on a described ship? ``python -m benchmarks.ship_effects --ship otter``.

A ship sails three runs under commands at random, with one hidden cause or none, or with one that no
candidate expresses; its model is exact, or each of its coefficients is 10 % wrong (one standard
deviation). Two runs are learned from, the third is held out. For each problem the table has what was
found, how sure, and how held-out predictions fell.

Examples:
    python -m benchmarks.ship_effects
    python -m benchmarks.ship_effects --seeds 2 --causes loss,current --out results/otter.csv
"""

import argparse
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

import diagnosis
from diagnosis.predictors import Model, ship_with
from fmus.actuators.response import at_rest, command_response, force_response
from fmus.declare import Component, packer, variables
from fmus.effects import STANDARD
from fmus.ship import Ship
from fmus.ship import ship as with_effects
from fmus.signals import Force
from fmus.vessel.vessel import water_velocity

from .hidden_effects.foreign_physics import shallow_water, slow_gusts, tether

STEP, PERIOD, SECONDS = 0.02, 0.1, 240.0  # s, at the size of CyberShip Enterprise 1
NOISE = (0.002, 0.002, 0.002)  # m, m, rad, at that size
EVERY = round(PERIOD / STEP)
WRONG = 0.1  # standard deviation of what is wrong with each coefficient
SURE = 0.9
FOREIGN = (slow_gusts, shallow_water, tether)  # no candidate expresses them


class Cause(NamedTuple):
    """Something hidden: an effect, its parameters, and coefficients that say the same.

    ``foreign``: no candidate expresses it.
    """

    id: str
    vessel: Mapping[str, float]
    thrusters: Mapping[str, float]
    same: tuple[str, ...] = ()
    foreign: bool = False


def causes(ship: Ship) -> dict[str, Cause]:
    """Causes of a ship's size: none, a weak first actuator, drag, wind, current, lag; foreign ones."""
    assert ship.description is not None
    first, scale = ship.description.actuators[0].name, ship.scale
    full = float(ship.layout.full(ship.nominal_drive.params)[0])
    drag = -0.05 * full / (0.3 * scale.speed) ** 2  # 5 % of full thrust at an easy speed
    return {
        "none": Cause("", {}, {}),
        "loss": Cause(f"loss_{first}", {}, {f"loss_{first}": 0.15}, (f"plant_{first}_k_ahead",)),
        "drag": Cause("X_|u|u", {"delta_X_absu_u": drag}, {}),
        "wind": Cause("earth_force", {"F_n": 0.015 * full, "F_e": -0.01 * full}, {}),
        "current": Cause("current", {"V_n": 0.06 * scale.speed, "V_e": -0.08 * scale.speed}, {}),
        "lag": Cause("lag", {}, {"lag": 0.5 * scale.time}),
        "gusts": Cause("slow gusts", {"gust_force": 0.01 * full}, {}, foreign=True),
        "shoal": Cause(
            "shallow water",
            {"shallow_damping": 0.05 * full / (0.3 * scale.speed), "shallow_edge": 0.0},
            {},
            foreign=True,
        ),
        "tether": Cause(
            "tether",
            {"tether_stiffness": 0.002 * full / scale.length, "tether_slack": 2.0 * scale.length},
            {},
            foreign=True,
        ),
    }


def parameters(
    component: Component, given: Mapping[str, float], wrong: np.random.Generator | None
) -> Any:
    """Parameters of the real ship: nominal ones, wrong or not, and those of the cause."""
    values = {}
    for v in variables(component.params):
        off = 0.0 if wrong is None or v.known is None else WRONG * wrong.standard_normal()
        values[v.name] = v.start * (1.0 + off)
    return packer(component.params)(list({**values, **given}.values()))


def sail(
    ship: Ship,
    cause: Cause,
    rng: np.random.Generator,
    wrong: int | None,
    orders: Iterator[tuple[float, ...]] | None = None,
    seconds: float = SECONDS,
    period: float = PERIOD,
) -> pd.DataFrame:
    """A run of the real ship, as a sensor of its size measures it.

    Args:
        ship: as its model describes it.
        cause: what is hidden.
        rng: of commands and noise.
        wrong: seed of what is wrong with the coefficients; None: nothing is.
        orders: a command for each step (those of :func:`commands`).
        seconds, period: length and time from a sample to the next at the size of CyberShip Enterprise 1.
    """
    off = None if wrong is None else np.random.default_rng(wrong)
    b = ship.vessel.prepared(parameters(ship.vessel, {"x_0": 0.0, "y_0": 0.0, **cause.vessel}, off))
    drive = ship.thrusters.prepared(parameters(ship.thrusters, cause.thrusters, off))
    layout, scale = ship.layout, ship.scale
    h = period / EVERY * scale.time
    s, past = ship.vessel.init(Force(), b.params), at_rest(drive.effects)
    orders = orders or commands(ship, rng)
    rows = []
    for k in range(round(seconds * EVERY / period)):
        now = next(orders)
        if k % EVERY == 0:
            pose = np.array([s.x, s.y, s.psi]) + noise(ship) * rng.standard_normal(3)
            rows.append((k * h, *pose, *now))
        past, given = command_response(past, now, drive, h)
        past, acting = force_response(past, given, drive, h)
        u_c, v_c = water_velocity(s, b)
        met = layout.running(s.t + h, s.u - u_c, s.v - v_c, s.r, given, drive)
        tau = layout.act(acting, met, drive)
        s, _ = ship.vessel.advance(s, Force(*tau), b, h)
    return pd.DataFrame(rows, columns=["time", "x", "y", "psi", *(ship.commands or ())])


def noise(ship: Ship) -> np.ndarray:
    """(3,), standard deviation of a measured pose [m, m, rad]."""
    return np.multiply(NOISE, (ship.scale.length, ship.scale.length, 1.0))


def commands(ship: Ship, rng: np.random.Generator) -> Iterator[tuple[float, ...]]:
    """Commands that hold for 2 to 6 s each, as forces ahead and turning moments at random."""
    layout, params = ship.layout, ship.nominal_drive.params
    most = np.array(layout.full(params))
    while True:
        ahead, aside, turn = rng.uniform(-0.1, 0.35), rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3)
        wanted = most * (ahead, aside, turn)
        now = tuple(float(c) for c in layout.allocate(tuple(wanted.tolist()), params))
        for _ in range(round(rng.uniform(2.0, 6.0) / PERIOD) * EVERY):  # as a log has them
            yield now


def problem(ship: Ship, name: str, seed: int, exact: bool) -> dict[str, Any]:
    """One problem, diagnosed: what was hidden, what was found."""
    cause = causes(ship)[name]
    rng = np.random.default_rng([seed, *name.encode()])
    real = with_effects(STANDARD.plus(FOREIGN), ship.description) if cause.foreign else ship
    runs = [sail(real, cause, rng, None if exact else seed) for _ in range(3)]
    begun = time.perf_counter()
    model = Model(ship=ship)
    smoothed = diagnosis.load(runs, model=model)
    found = diagnosis.diagnose(
        smoothed[:2], smoothed[2:], prior=0.0 if exact else WRONG, model=model
    ).content
    stated = [e for e in found.effects if not cause.id or e.id != cause.id]
    sets = {i for e in found.effects for i in (e.id, *e.indistinguishable)}
    said = found.verdict != "none"
    suspects = [s.name for s in found.suspect_coefficients]
    named = cause.id in sets or bool(set(suspects) & set(cause.same))
    error = next(e for e in found.errors if e.held_out).window_position_rmse
    return {
        "cause": name,
        "seed": seed,
        "exact": exact,
        "verdict": found.verdict,
        "found": " ".join(f"{e.id}:{e.confidence or 0.0:.2f}" for e in found.effects),
        "suspect": " ".join(suspects),
        "right": said if cause.foreign else named if cause.id else not found.effects,
        "wrong and sure": sum((e.confidence or 0.0) >= SURE for e in stated),
        "before": error.before,
        "after": error.after,
        "seconds": time.perf_counter() - begun,
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=(__doc__ or "").partition("\n")[0],
        epilog=(__doc__ or "").partition("\n\n")[2],
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--ship", default="otter", metavar="NAME|FILE.toml", help="(otter)")
    parser.add_argument("--seeds", type=int, default=1, help="problems of each cause (1)")
    parser.add_argument(
        "--causes", help="some of none,loss,drag,wind,current,lag,gusts,shoal,tether (all)"
    )
    parser.add_argument("--kinds", default="exact,wrong", help="model exact, or 10 %% wrong (both)")
    parser.add_argument("--out", type=Path, help="CSV file for the table")
    options = parser.parse_args()
    ship = ship_with((), options.ship)
    if not ship.description.allocates:
        parser.error(f"{options.ship} has no thrust allocation, which its commands come from")
    names = options.causes.split(",") if options.causes else list(causes(ship))
    rows = []
    for kind in options.kinds.split(","):
        for seed in range(options.seeds):
            for name in names:
                rows.append(problem(ship, name, seed, kind == "exact"))
                print(
                    ", ".join(
                        f"{k} {v:.3g}" if k in NUMBERS else f"{k} {v}" for k, v in rows[-1].items()
                    ),
                    flush=True,
                )
                if options.out:
                    pd.DataFrame(rows).to_csv(options.out, index=False)
    table = pd.DataFrame(rows)
    summary = table.groupby(["exact", "cause"])[["right", "wrong and sure"]].agg(["sum", "count"])
    print(summary.to_string())


NUMBERS = ("before", "after", "seconds")

if __name__ == "__main__":
    main()
