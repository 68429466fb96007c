"""The master algorithm: the order of steps, and events at their times."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from ..errors import SimulationError
from ..fmu.component import WARNING
from ..fmu.fmu_model import FmuVariable
from ..fmu.instance import Instance
from ..process.run_state import CALLS, INSTANCE, STATE, Owner
from ..scenario.plans import TIME_TOLERANCE
from ..scenario.schema import Event
from ..system.instance_pool import InstancePool
from ..system.system import System
from .stepper import Stepper, ValueTable

# Decimal places of times [s]; chosen: far more than the shortest step, 1e-6 s, has.
PLACES = 12


class Messages:
    """Collects the first warnings and errors that FMUs log.

    Args:
        show: receives each as a line for the user, one that comes again at once only the first time.

    Attributes:
        kept: each as log.json has it.
    """

    KEEP = 200  # messages; chosen: more would fill log.json and the terminal

    def __init__(self, show: Callable[[str], None]) -> None:
        self.count = 0
        self.kept: list[dict[str, Any]] = []
        self._show = show

    def add(self, instance: str, status: int, text: str) -> None:
        if status == 0:  # information only
            return
        self.count += 1
        if self.count <= self.KEEP:
            message = {"instance": instance, "status": status, "text": text}
            if self.kept[-1:] != [message]:
                self._show(f"{instance}: {text}")
            self.kept.append(message)
        elif self.count == self.KEEP + 1:
            self._show(f"FMUs logged more than {self.KEEP} messages; the rest is not shown")


class Master:
    """A system with its FMUs instantiated and initialised; its table holds the values at t = 0.

    Args:
        system: checked system.
        show: receives lines for the user while it runs.
        interrupted: whether the user has asked for the end; read between the calls until it runs.
        pool: gives the instances, and takes them back; by default one that keeps none.

    Raises:
        InputError: an FMU cannot be instantiated.
        SimulationError: its initialisation failed.
        KeyboardInterrupt: interrupted.
    """

    def __init__(
        self,
        system: System,
        show: Callable[[str], None],
        interrupted: Callable[[], bool] = lambda: False,
        pool: InstancePool | None = None,
    ) -> None:
        self.system = system
        self._pool = pool or InstancePool()
        self._owner = Owner()
        apart = [name for name, entry in system.scenario.fmus.items() if entry.isolate]
        STATE.steps(system.order, apart)
        self._interrupted = interrupted
        self.messages = Messages(show)
        self._instances: dict[str, Instance] = {}
        self._initialised = False
        changeable = {f"{e.model}.{e.variable}" for e in system.scenario.events}
        settable = system.fed
        settable |= {
            n for n, s in system.signals.items() if n in changeable and s.variable.causality == "input"
        }
        self.table = ValueTable(system.signals, system.order, settable)
        try:
            for name in system.order:
                model, entry = system.models[name], system.scenario.fmus[name]
                self._instances[name] = self._pool.take(name, model, entry, self.messages.add)
                self._leave_if_interrupted()
            self.steppers = [
                Stepper(system, k, self._instances[name], self.table, settable)
                for k, name in enumerate(system.order)
            ]
            self._originals: dict[str, float] = {}
            self._events = sorted(system.scenario.events, key=lambda e: e.time)
            self._initialise()
        except BaseException:
            self.close()
            raise

    def _leave_if_interrupted(self) -> None:
        if self._interrupted():
            raise KeyboardInterrupt

    def _stepper(self, name: str) -> Stepper:
        return self.steppers[self.system.order.index(name)]

    def _bind_faults(self) -> None:
        """Attach each fault to the inputs or outputs it acts on, with random numbers of its own."""
        declared = self.system.scenario.faults
        seeds = np.random.SeedSequence(self.system.scenario.seed).spawn(len(declared))
        for fault, seed in sorted(zip(declared, seeds, strict=True), key=lambda pair: pair[0].stage):
            signals = [self.system.signals[name] for name in fault.signals]
            stepper = self._stepper(signals[0].instance)
            slots = [self.table.slots[s.name] for s in signals]
            effect = fault.bind(slots, stepper.step_size, np.random.default_rng(seed))
            is_input = signals[0].variable.causality == "input"
            (stepper.input_effects if is_input else stepper.output_effects).append(effect)

    def _initialise(self) -> None:
        system = self.system
        for stepper in self.steppers:
            instance = stepper.instance
            instance.set_up(system.scenario.stop)
            for variable, value in system.parameters[instance.name]:
                instance.set_value(variable, value)
            instance.enter_initialization()
            stepper.read_inputs()
            self._leave_if_interrupted()
        # Values converge in as many sweeps as there are FMUs in a chain; faults act only afterwards.
        for _ in self.steppers:
            before = self.table.row.copy()
            for stepper in self.steppers:
                self._initial_exchange(stepper)
            if np.array_equal(before, self.table.row, equal_nan=True):
                break
        self._bind_faults()
        self.begin_events(0.0)
        for stepper in self.steppers:
            self._initial_exchange(stepper)
        for stepper in self.steppers:
            stepper.instance.exit_initialization()
            STATE.calls(stepper.instance.name, "getting its outputs")
            stepper.read(0.0)
            self._leave_if_interrupted()
        STATE.calls_nothing()
        self._initialised = True

    def _initial_exchange(self, stepper: Stepper) -> None:
        """Set an FMU's inputs and get its outputs in initialisation mode."""
        STATE.calls(stepper.instance.name, "setting its inputs and getting its outputs")
        stepper.exchange(0.0)
        stepper.read(0.0)
        self._leave_if_interrupted()

    def begin_events(self, t: float) -> None:
        """Begin the events that are due at t [s]."""
        while self._events and self._events[0].time <= t + TIME_TOLERANCE:
            event = self._events.pop(0)
            signal = self.system.find(f"{event.model}.{event.variable}", "events")
            stepper = self._stepper(signal.instance)
            if signal.variable.causality == "input":
                stepper.input_changes.begin(self.table.slots[signal.name], event)
            elif signal.variable.causality == "output":
                slot = self.table.slots[signal.name]
                stepper.output_changes.begin(slot, event)
            else:
                self._change_parameter(stepper.instance, signal.variable, event)

    def _change_parameter(self, instance: Instance, variable: FmuVariable, event: Event) -> None:
        name = f"{instance.name}.{variable.name}"
        original = self._originals.setdefault(name, instance.get_value(variable))
        if event.action == "reset":
            value = original
        elif event.action == "bias":
            value = original + float(event.value or 0.0)
        else:
            value = float(event.value or 0.0)
        is_integer = variable.type in ("Integer", "Enumeration")
        instance.set_value(variable, round(value) if is_integer else value)

    @property
    def next_event(self) -> Event | None:
        """The next event that has not begun."""
        return self._events[0] if self._events else None

    @property
    def is_jacobi(self) -> bool:
        """Whether all FMUs step at once, with the values of before."""
        return self.system.scenario.algorithm == "jacobi"

    def time(self, k: int) -> float:
        """Time of base step k [s]: counted, never accumulated."""
        return round(k * self.system.scenario.step, PLACES)

    def run(self) -> Iterator[float]:
        """Step to the end; yields the time [s] after each base step.

        Raises:
            SimulationError: an FMU returned an error, or an output is not finite.
        """
        steppers, advance_all = self.steppers, self._one_after_the_other
        if self.is_jacobi:
            # Instances that step beside the others start first and are awaited last.
            steppers = sorted(steppers, key=lambda s: s.begin is not None)
            advance_all = self._all_at_once
        due = steppers
        multirate = any(s.every > 1 for s in steppers)
        events = self._events
        t = 0.0
        for k in range(1, self.system.steps + 1):
            if events and events[0].time <= t + TIME_TOLERANCE:
                self.begin_events(t)
            t_next = self.time(k)
            if multirate:
                # An FMU with a longer step steps at the end of it, with the inputs of that instant.
                due = [s for s in steppers if k % s.every == 0]
            STATE.numbers[CALLS] = k
            advance_all(due, k, t, t_next)
            t = t_next
            yield t

    def finish_step(self, k: int, stepper: Stepper, status: int, saved: bool) -> None:
        """Do what remains of base step k where the compiled loop has stopped at a call of fmi2DoStep.

        Args:
            k: the base step.
            stepper: the FMU that was called.
            status: what fmi2DoStep returned.
            saved: whether its state of before has been saved.
        """
        t, t_next = self.time(k - 1), self.time(k)
        stepper.settle(self.time(k - stepper.every), status, saved)
        rest = [s for s in self.steppers[stepper.number + 1 :] if k % s.every == 0]
        if not self.is_jacobi:
            self._one_after_the_other(rest, k, t, t_next)
        for other in rest if self.is_jacobi else ():
            STATE.numbers[INSTANCE] = other.number
            other.advance(self.time(k - other.every))

    def _one_after_the_other(self, due: Sequence[Stepper], k: int, t: float, t_next: float) -> None:
        called = STATE.numbers
        for stepper in due:
            called[INSTANCE] = stepper.number
            stepper.exchange(t_next)
            stepper.advance(t if stepper.every == 1 else self.time(k - stepper.every))

    def _all_at_once(self, due: Sequence[Stepper], k: int, t: float, t_next: float) -> None:
        called = STATE.numbers
        for stepper in due:
            called[INSTANCE] = stepper.number
            stepper.exchange(t)
        for stepper in due:
            if stepper.begin is not None:
                stepper.begin(t if stepper.every == 1 else self.time(k - stepper.every))
        for stepper in due:
            called[INSTANCE] = stepper.number
            stepper.advance(t if stepper.every == 1 else self.time(k - stepper.every))

    @property
    def outputs(self) -> list[str]:
        """Names of the Real signals that FMUs write: values that must stay finite."""
        return [s.name for stepper in self.steppers for s in stepper.got if s.variable.type == "Real"]

    def close(self) -> None:
        """Terminate all instances, and free those that are not kept for another run."""
        self._owner.leave_copies()
        for instance in self._instances.values():
            if self._initialised:
                try:
                    instance.terminate()
                except SimulationError as error:
                    self.messages.add(instance.name, WARNING, str(error))
            self._pool.give_back(instance)
        STATE.calls_nothing()
        self._instances.clear()
