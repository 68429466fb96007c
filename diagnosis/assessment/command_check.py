"""Whether the commands of a run can be its own, by what the thrusters give and what the ship does."""

from dataclasses import replace

import numpy as np

from ..predictors import Model, WeakWindows, omega, weak_windows
from ..predictors.thrust import full_thrust
from ..predictors.uncertainty import MEASURED
from ..predictors.weak_form import BLOCK, inertial, needed_force
from ..runs import Run, line_beside
from ..runs.columns.columns import TAU, Named
from ..runs.run_constants import DIGITS, NEGLIGIBLE
from .gains import varying
from .reading_odds import most_thrust
from .settings import SETTINGS


def beyond_thrusters(run: Run, model: Model) -> str | None:
    """A clause about commands of a run that a model's thrusters cannot give, where these matter."""
    if run.commands is not None:
        return _beyond_limits(run.commands, run.time, model)
    full, size = full_thrust(model), np.abs(run.tau_cmd)
    beyond = size > SETTINGS.most_gain * full
    share = (size * beyond).sum(axis=0) / np.maximum(size.sum(axis=0), np.finfo(float).tiny)
    if share.max() <= NEGLIGIBLE:
        return None
    ratio = size.max(axis=0) / np.maximum(full, np.finfo(float).tiny)
    k = int(np.argmax(np.where(share > NEGLIGIBLE, ratio, 0.0)))
    rows, unit = int(beyond[:, k].sum()), "N.m" if k == 2 else "N"
    seen = (
        f"{TAU[k]} reaches {size[:, k].max():.4g} {unit}, more than {SETTINGS.most_gain:g} times "
        f"the {full[k]:.4g} {unit} that the thrusters give in {rows} of {len(size)} rows"
    )
    if 2 * rows > len(size):
        ship = model.ship.description
        return (
            f"{seen}: is the ship {ship.title}, of {ship.length:.4g} m? --ship NAME|FILE.toml selects it"
        )
    return f"{seen}: leave false cells empty, and log commands after they are clipped"


def _beyond_limits(commands: np.ndarray, time: np.ndarray, model: Model) -> str | None:
    """A clause about a command (n, k) that is many times its limit, as which it then counts."""
    layout = model.ship.layout_of(commands)
    limits, form = layout.limits(model.drive.params), model.ship.form_of(commands)
    for k, ((name, unit), limit) in enumerate(zip(form.items(), limits, strict=True)):
        most, size = float(np.abs(limit).max()), np.abs(commands[:, k])
        beyond = size > SETTINGS.most_gain * most
        if (layout.round and layout.round[k]) or beyond.mean() <= NEGLIGIBLE:
            continue
        first = int(np.argmax(beyond))
        why = "its unit changes there" if size[:first].any() else "it is in another unit"
        rows = f"{int(beyond.sum())} of {len(size)} rows"
        return (
            f"{name} reaches {size.max():.4g} {unit} and is more than {SETTINGS.most_gain:g} times "
            f"its limit, {most:.4g} {unit}, in {rows}, from {time[first]:.4g} s on; probably {why}"
        )
    return None


def without_force(run: Run, model: Model) -> str:
    """A clause about commands that give no force at all, as where a propeller cannot reverse."""
    beyond = {}
    if run.commands is not None:
        limits = model.ship.layout_of(run.commands).limits(model.drive.params)
        for name, c, (low, high) in zip(run.signals, run.commands.T, limits, strict=True):
            if c.any() and ((c <= low) | (c >= high)).all():
                beyond[name] = f"{name} is beyond its limits, {low:.4g} to {high:.4g}"
    if not beyond:
        return "its commands are zero throughout"
    flipped = {name: Named(name=name, factor=-1.0) for name in beyond}
    clause = (
        f"its commands give no force: {', '.join(beyond.values())}, in all rows; check the sign of "
        "the command"
    )
    return clause + line_beside(run.file, run.layout, flipped)


def constant_commands(run: Run) -> bool:
    """Whether no command of a run varies; a rudder's has no force in ``tau``, that of a ship at rest."""
    return not (np.ptp(run.given, axis=0) > DIGITS * np.abs(run.given).max(axis=0)).any()


def contradicted_commands(w: WeakWindows, model: Model) -> str | None:
    """A clause about commands that are constant, or absent, while the motion shows that others acted."""
    tau, run = w.run.tau_cmd, w.run
    largest = np.abs(tau).max()
    varies = np.ptp(tau, axis=0) > DIGITS * largest
    z, inertia = needed_force(w, model), inertial(w, model)
    size = np.sqrt((z**2).mean(axis=0))
    # Both inertia and hull may be inexact.
    uncertain = 2.0 * MEASURED * np.sqrt((inertia**2 + (z - inertia) ** 2).mean(axis=0))
    if constant_commands(run):
        return _varying(w, model, uncertain)
    for k in np.flatnonzero(~varies):
        name, unit, given = TAU[k], "N.m" if k == 2 else "N", float(tau[0, k])
        follows = (z[:, k] * given > 0.0).mean() >= NEGLIGIBLE
        opposed = not follows and size[k] > SETTINGS.least_gain * abs(given)
        if opposed and abs(given) > DIGITS * largest:
            return (
                f"{name} is {given:.3g} {unit} in all rows, and the motion needs "
                f"{z[:, k].mean():.3g} {unit} on average: it is another column, or it was not "
                "logged"
            )
        if name in run.absent and size[k] > uncertain[k]:
            return (
                f"there is no column {name}, and the motion needs {size[k]:.3g} {unit} there; "
                "if nothing was commanded there, give it a column of zeros"
            )
    return None


def _varying(w: WeakWindows, model: Model, uncertain: np.ndarray) -> str | None:
    """A clause about constant commands while the motion needs a force that varies, as in no steady turn.

    Args:
        w, model: windows of the run, and its ship.
        uncertain: (3,), what inertia and hull may be off by [N, N, N m].
    """
    varies = varying(w, omega(w, model))
    if not (varies > np.maximum(uncertain, NEGLIGIBLE * most_thrust(w, model))).any():  # as of gusts
        return None
    k = int(np.argmax(varies / np.maximum(uncertain, np.finfo(float).tiny)))
    return (
        f"all its commands are constant, and the motion needs a force that varies by {varies[k]:.3g} "
        f"{'N.m' if k == 2 else 'N'} on {TAU[k]}: they are other columns, or were not logged"
    )


def lasting(force: np.ndarray, block: np.ndarray) -> np.ndarray:
    """RMS (3,) of the mean of a force (K, 3) [N, N, N m] over the windows of each block (K,).

    A command lasts, so its force does; gusts over the measured wind and noise average out.
    """
    _, at = np.unique(block, return_inverse=True)
    mean = np.stack([np.bincount(at, f) for f in force.T], axis=1) / np.bincount(at)[:, None]
    return np.sqrt((mean[at] ** 2).mean(axis=0))


def moves_on(w: WeakWindows, model: Model) -> str | None:
    """A line about a ship that goes on as before where all of its commands are zero; None: it does not.

    What it needs is compared with what it needs usually, both as of :func:`lasting` and in excess of the
    measured wind.
    """
    s, tau = w.smoothed, w.run.tau_cmd
    # Beyond a limit it is a command, though it gives no force; a rudder has one under way.
    given = np.abs(tau if w.run.commands is None else w.run.commands)
    always = replace(w.run, tau_cmd=np.ones_like(tau), commands=None)
    every = weak_windows(replace(s, track=replace(s.track, run=always)))
    resting = (every.held @ given).max(axis=1) == 0.0
    if w.every * resting.sum() < BLOCK * w.scale.time:  # the ship may not have forgotten its thrust
        return None
    still = lasting(needed_force(every, model)[resting], every.block[resting])
    size = lasting(needed_force(w, model), w.block)
    if 2.0 * np.median(still / size) < 1.0:  # on two axes of three: one may be so by chance
        return None
    if not (still > NEGLIGIBLE * most_thrust(w, model)).any():  # it drifts
        return None
    return (
        f"all commands are zero for {w.every * resting.sum():.0f} s, and the motion needs "
        f"{still[0]:.3g} N, {still[1]:.3g} N, {still[2]:.3g} N.m there, as before: they count as not "
        "logged"
    )


def idle(run: Run, least: float) -> np.ndarray:
    """(n,), rows in which all commands are zero for so long [s] at least."""
    zero = np.abs(run.given).max(axis=1) == 0.0
    part = np.cumsum(np.diff(zero, prepend=zero[0]))
    begin, end = (np.full(part[-1] + 1, sign * np.inf) for sign in (1.0, -1.0))
    stamped = np.isfinite(run.time)
    np.minimum.at(begin, part[stamped], run.time[stamped])
    np.maximum.at(end, part[stamped], run.time[stamped])
    return zero & (end - begin >= least)[part]
