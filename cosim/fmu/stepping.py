"""Steps of an FMU in this process, and the handling of a discarded step (FMI 2.0.4, 4.2.2).

An FMU that discards a step may report how far it got. If its state can be restored and it takes steps of
any length, the step is repeated in shorter ones.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from typing import NamedTuple

from .component import DISCARD, PENDING, FmuComponent

DO_STEP_STATUS, LAST_SUCCESSFUL_TIME, TERMINATED = 0, 2, 3  # of fmi2StatusKind
# Wall time between two polls for the end of an asynchronous step [s]; chosen: well below a usual step.
POLL_INTERVAL = 1e-4
# Shorter steps tried in place of one; by then halving has reached the resolution of a double (2**-53).
MOST_TRIES = 60


class Steps(NamedTuple):
    """Steps of an FMU.

    Attributes:
        step: ``step(t)`` steps from t [s].
        settle: ``settle(t, status, saved)`` brings the step from t to its end after the first call of
            fmi2DoStep has returned ``status``, worse than a warning; ``saved`` tells whether the state
            of before has been saved.
        saves: whether the state is saved before each step.
    """

    step: Callable[[float], None]
    settle: Callable[[float, int, bool], None]
    saves: bool


def single_steps(component: FmuComponent, h: float) -> Steps:
    """Steps of length h [s]; one that does not succeed ends the run."""
    do_step, now = component.function("fmi2DoStep"), ctypes.c_double()
    arguments = (
        ctypes.c_void_p.from_param(component.pointer),
        now,
        ctypes.c_double.from_param(h),
        ctypes.c_int.from_param(1),
    )

    def step(t: float) -> None:
        now.value = t
        if (status := do_step(*arguments)) >= DISCARD:
            settle(t, status, False)

    def settle(t: float, status: int, saved: bool) -> None:
        if (status := _awaited(component, status)) >= DISCARD:
            _refuse(component, t, status)

    return Steps(step, settle, False)


def redoing_steps(component: FmuComponent, h: float) -> Steps:
    """The same for an FMU whose state can be restored: a discarded step is repeated in shorter ones."""
    do_step = component.function("fmi2DoStep")
    save, restore = component.function("fmi2GetFMUstate"), component.function("fmi2SetFMUstate")
    pointer, state = ctypes.c_void_p(component.pointer), component.saved_state

    def begin(t: float, length: float) -> tuple[int, bool]:
        """Save the state and call fmi2DoStep; its status, and whether the state is saved."""
        saved = save(pointer, ctypes.byref(state)) < DISCARD
        return attempt(t, length, saved), saved

    def attempt(t: float, length: float, saved: bool) -> int:
        # The last argument promises that the state will not be restored.
        return do_step(pointer, ctypes.c_double(t), ctypes.c_double(length), int(not saved))

    def step(t: float) -> None:
        status, saved = begin(t, h)
        if status >= DISCARD:
            settle(t, status, saved)

    def settle(t: float, status: int, saved: bool) -> None:
        end = goal = t + h
        tries = 0
        while True:
            status = _awaited(component, status)
            if status < DISCARD:
                if goal == end:
                    return
                t, goal = goal, end
                status, saved = begin(t, goal - t)
            else:
                last, done = _progress(component) if status == DISCARD else (None, False)
                tries += 1
                shorter = last if last is not None and t < last < goal else t + (goal - t) / 2
                can_go_on = status == DISCARD and saved and not done and t < shorter < goal
                if not can_go_on or tries > MOST_TRIES or restore(pointer, state) >= DISCARD:
                    _refuse(component, t, status)
                goal = shorter
                status = attempt(t, goal - t, saved)

    return Steps(step, settle, True)


def _awaited(component: FmuComponent, status: int) -> int:
    """Status of a step that the FMU may still be computing after fmi2DoStep has returned."""
    if status != PENDING:
        return status
    pointer, found = ctypes.c_void_p(component.pointer), ctypes.c_int(status)
    ask = component.function("fmi2GetStatus")
    while found.value == PENDING and ask(pointer, DO_STEP_STATUS, ctypes.byref(found)) < DISCARD:
        if found.value == PENDING:
            time.sleep(POLL_INTERVAL)
    return found.value


def _refuse(component: FmuComponent, t: float, status: int) -> None:
    """End the run because of a step from t [s], with what the FMU reports of it."""
    note, complaint = "", component.complaint
    if status == DISCARD and not component.is_python:  # pythonfmu cannot report more, and logs so
        last, done = _progress(component)
        if done:
            note = "; it requests the end of the simulation" + (
                "" if last is None else f" at t = {last:.12g} s"
            )
        elif last is not None:
            note = f"; it stopped at t = {last:.12g} s"
    component.complaint = complaint
    component.check(f"the step from t = {t} s", status, note)


def _progress(component: FmuComponent) -> tuple[float | None, bool]:
    """After a discarded step: how far the FMU got [s], if it reports that; whether it asks to end."""
    pointer, last, done = ctypes.c_void_p(component.pointer), ctypes.c_double(), ctypes.c_int()
    reached = component.function("fmi2GetRealStatus")(pointer, LAST_SUCCESSFUL_TIME, ctypes.byref(last))
    ended = component.function("fmi2GetBooleanStatus")(pointer, TERMINATED, ctypes.byref(done))
    return last.value if reached < DISCARD else None, ended < DISCARD and bool(done.value)
