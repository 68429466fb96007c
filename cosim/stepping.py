"""Steps of an FMU in this process, and what may be done when it discards one (FMI 2.0.4, 4.2.2).

An FMU that discards a step may tell how far it got. If it can be set back and takes steps of any length,
the step is done again in shorter ones.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from .access import DISCARD, PENDING

if TYPE_CHECKING:
    from .instance import Instance

DO_STEP_STATUS, LAST_SUCCESSFUL_TIME, TERMINATED = 0, 2, 3  # of fmi2StatusKind
GLANCE = 1e-4  # s between two questions whether a step is over
# Shorter steps in place of one, before the FMU is believed that it cannot go on.
MOST_TRIES = 60


def plain(instance: Instance, h: float) -> Callable[[float], None]:
    """Steps of length h [s]: a function of the time t [s] at which a step begins.

    A step that does not succeed ends the run.
    """
    do_step, now = instance.function("fmi2DoStep"), ctypes.c_double()
    arguments = (
        ctypes.c_void_p.from_param(instance.component),
        now,
        ctypes.c_double.from_param(h),
        ctypes.c_int.from_param(1),
    )

    def step(t: float) -> None:
        now.value = t
        status = do_step(*arguments)
        if status >= DISCARD and (status := _awaited(instance, status)) >= DISCARD:
            _refuse(instance, t, status)

    return step


def redoing(instance: Instance, h: float) -> Callable[[float], None]:
    """The same for an FMU that can be set back: a discarded step is done again in shorter ones."""
    do_step = instance.function("fmi2DoStep")
    save, restore = instance.function("fmi2GetFMUstate"), instance.function("fmi2SetFMUstate")
    component, state = ctypes.c_void_p(instance.component), instance.saved_state

    def step(t: float) -> None:
        end = goal = t + h
        length, tries = h, 0
        saved = save(component, ctypes.byref(state)) < DISCARD
        while True:
            # The last argument promises that the FMU will not be set back.
            status = do_step(component, ctypes.c_double(t), ctypes.c_double(length), int(not saved))
            status = _awaited(instance, status)
            if status < DISCARD:
                if goal == end:
                    return
                t, goal = goal, end
                saved = save(component, ctypes.byref(state)) < DISCARD
            else:
                last, done = _progress(instance) if status == DISCARD else (None, False)
                tries += 1
                shorter = last if last is not None and t < last < goal else t + (goal - t) / 2
                can_go_on = status == DISCARD and saved and not done and t < shorter < goal
                if not can_go_on or tries > MOST_TRIES or restore(component, state) >= DISCARD:
                    _refuse(instance, t, status)
                goal = shorter
            length = goal - t

    return step


def _awaited(instance: Instance, status: int) -> int:
    """What became of a step that the FMU may still be doing, after fmi2DoStep has returned."""
    if status != PENDING:
        return status
    component, found = ctypes.c_void_p(instance.component), ctypes.c_int(status)
    ask = instance.function("fmi2GetStatus")
    while found.value == PENDING and ask(component, DO_STEP_STATUS, ctypes.byref(found)) < DISCARD:
        if found.value == PENDING:
            time.sleep(GLANCE)
    return found.value


def _refuse(instance: Instance, t: float, status: int) -> None:
    """End the run because of a step from t [s], with what the FMU tells of it."""
    note, complaint = "", instance.complaint
    if status == DISCARD and not instance.is_python:  # pythonfmu knows no more, and logs that
        last, done = _progress(instance)
        if done:
            note = "; it asks to end the simulation" + ("" if last is None else f" at t = {last:.12g} s")
        elif last is not None:
            note = f"; it got to t = {last:.12g} s"
    instance.complaint = complaint
    instance.check(f"the step from t = {t} s", status, note)


def _progress(instance: Instance) -> tuple[float | None, bool]:
    """After a discarded step: how far the FMU got [s], if it tells, and whether it wants to end."""
    component, last, done = ctypes.c_void_p(instance.component), ctypes.c_double(), ctypes.c_int()
    told = instance.function("fmi2GetRealStatus")(component, LAST_SUCCESSFUL_TIME, ctypes.byref(last))
    asked = instance.function("fmi2GetBooleanStatus")(component, TERMINATED, ctypes.byref(done))
    return last.value if told < DISCARD else None, asked < DISCARD and bool(done.value)
