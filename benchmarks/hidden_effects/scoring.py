"""The score of a cell: what the diagnosis said, held against what was hidden."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from diagnosis import Model
from fmus.ship import ship

from .answers import Answer
from .draw import Draw, run_names
from .problems import RUNS, Problem
from .results import Row
from .separation import COEFFICIENTS, NOTHING

EFFECTS = ship().effects

# Coefficients whose change is the same as an effect that does not bear their name.
SAME_AS = {
    "mass": {"m", "I_z"},
    "centre_of_gravity": {"x_g"},
    "added_mass_X": {"X_udot"},
    "added_mass_Y": {"Y_vdot"},
    "added_mass_N": {"N_rdot"},
    "loss_vsp": {"plant_F_vsp"},
    "loss_bow": {"plant_F_bow"},
}
WIDE = 1.96  # standard deviations in half of a 95 % interval
DAMPING = ("X_u", "Y_v", "N_r")
IN_TIME = 0.5  # s, from the end of an outage as it was; half a second moves the ship by millimetres
SMALL = 1e-6  # of a parameter that is stated in the table


def same_coefficients(effect: str) -> set[str]:
    """Nominal coefficients whose change is the same as an effect."""
    named = {EFFECTS[effect].gives} if effect in EFFECTS else set()
    return SAME_AS.get(effect, set()) | named & set(COEFFICIENTS)


def row(problem: Problem, answer: Answer) -> Row:
    """A line of the table."""
    hidden = problem.hidden
    made = Row(
        *problem.key,
        values=" ".join(f"{n}={x:.4g}" for d in hidden for n, x in d.values.items() if abs(x) > SMALL),
        size=" ".join(f"{d.size:.3f}" for d in hidden),
        redrawn=problem.redrawn,
        alike=sorted({e for each in problem.alike for e in each}),
    )
    if "note" in answer:
        made.note = answer["note"]
        return made
    _told(made, answer)
    causes = {e for d in hidden for e in d.right}
    made.true = ["01"[e in causes] for e in made.found]
    made.separable = bool(hidden) and not made.alike
    made.absorbed = any(NOTHING in each for each in problem.alike)
    made.right = bool(hidden) and _right(made, hidden, answer["verdict"])
    if made.kind == "outages":
        made.right = made.right and in_time(answer["effects"][0]["coefficients"], hidden[0])
    made.in_set = any(set(d.right) & set(made.reported) for d in hidden)
    if made.kind == "process noise":
        names, mean, covariance = answer["posterior"]
        shape = (len(names), len(names))  # also where nothing was fitted
        held = off_by(problem, names, np.array(mean), np.reshape(covariance, shape))
        made.intervals, made.covered = len(held[0]), sum(held[0])
        made.damping = [f"{z:.4g}" for z in held[1]]
    else:
        made.intervals, made.covered = _coverage(answer["effects"], hidden)
    return made


def off_by(
    problem: Problem, names: Sequence[str], mean: np.ndarray, covariance: np.ndarray
) -> tuple[list[bool], list[float]]:
    """Of each fitted value whether its 95 % interval holds the truth, and how far damping is off.

    Args:
        problem: with the true ship.
        names: of the fitted values.
        mean, covariance: (q,), (q, q), of their posterior.

    Returns:
        Both; damping X_u, Y_v and N_r in standard deviations.
    """
    values, nominal = {**(problem.vessel or {}), **(problem.thrusters or {})}, Model()
    off = mean - np.array([values.get(n, nominal.value(n)) for n in names])
    inside = np.abs(off) <= WIDE * np.sqrt(covariance.diagonal())
    # With an effect of the same form it is their sum that the data know.
    rows = [np.flatnonzero([n in (c, f"delta_{c}") for n in names]) for c in DAMPING]
    damping = [off[k].sum() / np.sqrt(covariance[np.ix_(k, k)].sum()) for k in rows if k.size]
    return inside.tolist(), [float(z) for z in damping]


def _told(made: Row, answer: Answer) -> None:
    """What the diagnosis says, in its own keys; keys that it does not have stay empty."""
    effects = answer["effects"]
    made.verdict = answer["verdict"]
    made.found = [e["id"] for e in effects]
    sure = [e["confidence"] for e in effects]
    made.confidences = [f"{0.0 if c is None else c:.4g}" for c in sure]
    stated = answer.get("evidence", [None] * len(effects))
    made.evidence = ["" if e is None else " ".join(f"{x:.5g}" for x in e) for e in stated]
    made.reported = [effects[0]["id"], *effects[0]["indistinguishable"]] if effects else []
    made.suspects = [s["name"] for s in answer["suspect_coefficients"]]
    made.withdrawn = [w["id"] for w in answer.get("withdrawn", [])]
    made.possible_ids = [e["id"] for e in answer.get("possibilities", [])]
    made.worse = answer.get("worse", [])
    remainder = answer.get("remainder")
    made.remainder = "" if remainder is None else "01"[bool(remainder["significant"])]
    held_out = next(e for e in answer["errors"] if e["held_out"])["window_position_rmse"]
    made.before_mm, made.after_mm = 1e3 * held_out["before"], 1e3 * held_out["after"]
    if answer["truth_mm"] is not None:
        made.truth_mm = answer["truth_mm"]
    made.seconds = answer["seconds"]
    peers = answer.get("peers", {})
    made.sindy, made.pls = peers.get("sindy", ""), peers.get("pls", "")


def _right(made: Row, hidden: Sequence[Draw], verdict: str) -> bool:
    """Whether all that was hidden was found in as many steps, or a single one as its coefficient."""
    first = made.found[: len(hidden)]
    if all(set(d.right) & set(first) for d in hidden):
        return True
    stated = verdict == "coefficients" and len(hidden) == 1
    return stated and bool(same_coefficients(hidden[0].effect) & set(made.suspects))


def in_time(coefficients: dict[str, Any], hidden: Draw) -> bool:
    """Whether every outage of the training runs was found, and nothing else.

    An end counts as found within IN_TIME or its 95 % interval: where a thruster is hardly commanded,
    nothing tells when it fails.
    """
    for run in run_names(RUNS - 1):
        true = sorted(hidden.during(run).values.values())
        mine = [c for c in coefficients.values() if c["run"] == run]
        found = sorted((c["value"], c["ci95"]) for c in mine)
        if len(found) != len(true):
            return False
        for t, (value, (low, high)) in zip(true, found, strict=True):
            if abs(value - t) > IN_TIME and not low <= t <= high:
                return False
    return True


def _coverage(effects: Sequence[dict[str, Any]], hidden: Sequence[Draw]) -> tuple[int, int]:
    """How many intervals right findings have of parameters that were set, and how many hold them."""
    true = {(d.effect, name): x for d in hidden for name, x in d.values.items()}
    inside = [
        low <= true[e["id"], name] <= high
        for e in effects
        for name, c in e["coefficients"].items()
        if (e["id"], name) in true and c["ci95"] is not None
        for low, high in (c["ci95"],)
        if low is not None and high is not None
    ]
    return len(inside), sum(inside)
