"""The force of the thrusters along a measured run, by the very functions of the thrusters' FMU.

What lies between a command and the share of full force that acts (delay, limited rate, lag, and a user's
effects with a memory) is computed in short steps of a regular grid. Effects that are linear filters, or
that declare how each signal moves, are computed signal by signal. Others are stepped as in
:mod:`fmus.actuators.response`: a memory lasts only so long, so that the grid is cut into parts, side by
side, each from the time before it that still matters. Weak form and predictions use the same result,
:class:`Response`.
"""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from fmus.actuators.response import (
    PreparedThrusters,
    at_rest,
    command_response,
    force_response,
    thruster_effects,
)
from fmus.effects import Memory
from fmus.effects.steering_gear import rate_limited
from fmus.vessel.vessel import PreparedVessel, State, water_velocity

from ..runs.files.reading import Run
from ..runs.held_signal import Integral, like
from ..runs.linear_filter import filtered
from .ship_model import Model

# s, times the scale of the ship; longest step of thrusters and vessel, where the error of the
# integration is far below the noise of any measurement. Lags and limited rates give exact means of it.
LONGEST_STEP = 0.02
# s, times the scale of the ship; after that thrusters have forgotten a command, and a surge speed most
# of its start. Chosen: slower ones are beyond what windows of some seconds show.
FORGOTTEN = 60.0


def drive_of(run: Run, model: Model) -> PreparedThrusters:
    """The thrusters of a model, in the layout of a run's commands."""
    layout = model.ship.layout_of(run.commands)
    return model.drive._replace(effects=thruster_effects(model.ship.effects, layout))


def commanded_shares(run: Run, model: Model) -> np.ndarray:
    """(n, k), what the thrusters are commanded, as shares of full force or as it is."""
    given = before_low_pass(run, model)
    if run.commands is not None:
        return given
    X, Y, N = given.T
    shares = model.drive.effects.layout.allocate((X, Y, N), model.drive.params)
    return np.column_stack(np.broadcast_arrays(*shares))


def before_low_pass(run: Run, model: Model) -> np.ndarray:
    """Commands (n, k) as they were before the filter behind which a model has them logged."""
    logged, lag = run.given, model.logging.lag
    if lag == 0.0:
        return logged
    logged = unwrapped(logged, run, model)
    reached = -np.expm1(-np.diff(run.time) / lag)
    return np.vstack([logged[:1], logged[:-1] + np.diff(logged, axis=0) / reached[:, None]])


def unwrapped(commands: np.ndarray, run: Run, model: Model) -> np.ndarray:
    """Commands (n, k) of a run with angles that go round as continuous ones."""
    turns = np.flatnonzero(model.ship.layout_of(run.commands).round if run.commands is not None else ())
    if turns.size:
        commands = commands.copy()
        commands[:, turns] = np.unwrap(commands[:, turns], axis=0)
    return commands


def full_thrust(model: Model) -> np.ndarray:
    """(3,), force and moment [N, N, N m] that the model's thrusters give at the most on each axis."""
    return np.array(model.drive.effects.layout.full(model.drive.params))


def inflow(s: State, b: PreparedVessel) -> tuple[Any, Any, Any]:
    """u, v, r of a ship as the FMU of its thrusters meets the water [m/s, m/s, rad/s]."""
    u_c, v_c = water_velocity(s, b)
    return s.u - u_c, s.v - v_c, s.r


def thrust(run: Run, model: Model, between: np.ndarray, nu: np.ndarray) -> np.ndarray:
    """tau (n, 3) [N, N, N m] that acts from each sample to the next.

    Where a failure begins or ends between two samples that is the mean of the forces before and after.

    Args:
        run: its time and power.
        model: whose thrusters act.
        between: (1 to 3, k, n), what becomes of the commands, :attr:`Response.between_samples`.
        nu: (n, 3), body-fixed velocity, of :func:`inflow`.
    """
    drive = drive_of(run, model)
    layout = drive.effects.layout
    points = between[1:] if len(between) > 1 else between

    def force(rows: Any, time: np.ndarray) -> np.ndarray:
        """(3, ...), in some rows, at times at which a failure may have begun since."""
        powered = drive if run.power is None else layout.powered(drive, run.power[rows].T)
        u, v, r = nu[rows].T
        now = layout.running(time, u, v, r, tuple(between[0][:, rows]), powered)
        total = np.zeros((3, time.size))
        for acting in points:
            given = layout.act(tuple(acting[:, rows]), now, powered)
            for axis in range(3):
                total[axis] += given[axis] / len(points)
        return total

    total = force(slice(None), run.time)
    before = run.time[0]
    for change in model.change_points:
        if run.time[0] < change < run.time[-1]:
            row = int(np.searchsorted(run.time, change, side="right")) - 1
            begin, end = run.time[row : row + 2]
            sides = force([row, row], np.array([max(begin, before), change]))
            total[:, row] += (end - change) / (end - begin) * (sides[:, 1] - sides[:, 0])
            before = change
    return total.T


class Response:
    """What the commands of a run become before they are forces.

    Args:
        run: its commands.
        model: whose thrusters follow them.
        moving: whether the ship was under way when the run began, so that its first command held before;
            else nothing was commanded before.

    Attributes:
        drive: the thrusters, in the layout of the run's commands.
        slow: whether they have any memory.
    """

    def __init__(self, run: Run, model: Model, moving: bool = False) -> None:
        self.run, self.model, self.moving = run, model, moving
        self.drive = drive = drive_of(run, model)
        self._memories = [
            (member, memory)
            for of in ("command", "force")
            for k, member, memory in drive.effects.remembering[of]
            if drive.slow[k]
        ]
        self.slow = bool(self._memories) or any(rate > 0.0 for rate in drive.params.rate)

    @staticmethod
    def key(model: Model) -> tuple[Any, ...]:
        """What the response depends on, to be kept while it stays the same."""
        p = model.drive.params
        return model.ship, p.dynamics, p.rate, p.allocation, model.logging

    @property
    def between_samples(self) -> np.ndarray:
        """Means from each sample of the run to the next, see :meth:`between`."""
        return self.between(self.run)

    def between(self, rows: Run) -> np.ndarray:
        """Means (2, k, n) from each sample to the next: commands that arrive, shares that act.

        Where these are the same there is one of them. Where forces are not in proportion to what acts,
        and that changes from sample to sample, it counts at two points of Gauss' rule. In fewer rows
        those of a shaft have the mean squares of both halves.

        Args:
            rows: the run, or the same with fewer rows (n,) and their mean commands, which act where
                nothing depends on what was commanded before.
        """
        if not self.slow and not any(self.model.logging):
            means = np.array([commanded_shares(rows, self.model)])
        else:
            ends = np.append(rows.time, rows.time[-1] + float(np.median(np.diff(rows.time))))
            curved = self.slow and self.drive.effects.layout.curved
            edges = np.sort(np.append(ends, 0.5 * (ends[:-1] + ends[1:]))) if curved else ends
            means = np.array(self.means(edges))
            apart = np.full(means.shape[-1], np.sqrt(3.0))
            if rows is not self.run:
                shafts = self._shafts
                means[..., shafts], apart[shafts] = self._means_of_squares(edges)[..., shafts], 2.0
            if curved:
                given, acting = 0.5 * (means[:, ::2] + means[:, 1::2])
                off = (means[1, ::2] - means[1, 1::2]) / apart
                means = np.array([given, acting + off, acting - off])
        lasting = means[:1] if (means[0] == means[-1]).all() else means
        return np.ascontiguousarray(np.moveaxis(lasting, 1, -1))

    def means(self, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Means from each of some times to the next: commands that arrive, and shares that act.

        Args:
            edges: (m + 1, ...), times of the run [s].

        Returns:
            Two arrays (m, ..., k).
        """
        time = self._elapsed(edges)
        both = np.diff(self._integral(time), axis=0) / like(np.diff(time, axis=0), 2)
        return both[..., 0, :], both[..., -1, :]

    def _means_of_squares(self, edges: np.ndarray) -> np.ndarray:
        """Roots of the means of x |x| (2, m, k): thrust goes with n |n|, also of a shaft in noise."""
        time, of = self._elapsed(edges), self._integral
        x, before = of.values * np.abs(of.values), of.before * np.abs(of.before)
        squares = np.diff(Integral(of.edges, x, before)(time), axis=0) / like(np.diff(time, axis=0), 2)
        return np.moveaxis(np.sign(squares) * np.sqrt(np.abs(squares)), 1, 0)

    @cached_property
    def _shafts(self) -> np.ndarray:
        """(k,), which commands are speeds of shafts."""
        units = self.model.ship.form_of(self.run.commands).values()
        return np.array([self.run.commands is not None and unit == "1/s" for unit in units])

    @cached_property
    def _period(self) -> float:
        return float(np.median(np.diff(self.run.time)))

    @cached_property
    def _shares(self) -> np.ndarray:
        """(n, k), what is commanded, angles without jumps."""
        return unwrapped(commanded_shares(self.run, self.model), self.run, self.model)

    @cached_property
    def _longest_memory(self) -> float:
        """Time [s] after which the thrusters have forgotten a command."""
        memory = np.zeros(self._shares.shape[1])  # of each command
        for member, of in self._memories:
            memory[of.own] += self._lasts(member, of)
        rates = np.broadcast_to(self.drive.params.rate, memory.shape)
        largest = np.abs(self._shares).max(axis=0, initial=0.0)
        memory += np.divide(2.0 * largest, rates, out=np.zeros_like(memory), where=rates > 0.0)
        return float(min(memory.max(), FORGOTTEN * self.model.ship.scale.time))

    @cached_property
    def _clock(self) -> np.ndarray:
        """(n,), time [s] at each sample, in which a long gap counts no more than the memory lasts."""
        gaps, lasts = np.diff(self.run.time), self._longest_memory + abs(self.model.clock) + self._period
        long = gaps > FORGOTTEN * self.model.ship.scale.time
        return np.concatenate([[0.0], np.cumsum(np.where(long, np.minimum(gaps, lasts), gaps))])

    def _elapsed(self, time: np.ndarray) -> np.ndarray:
        """The run's times [s], those before and after it included, in the time of :attr:`_clock`."""
        t = self.run.time
        inside = np.interp(time, t, self._clock)
        return inside + np.minimum(time - t[0], 0.0) + np.maximum(time - t[-1], 0.0)

    @cached_property
    def _commands(self) -> Integral:
        """Integral of the commands as they were given; the clock of the pose is late."""
        shares = self._shares
        before = shares[0] if self.moving else 0.0 * shares[0]
        edges = np.append(self._clock, self._clock[-1] + self._period) + self.model.clock
        return Integral(edges, shares, before)

    @cached_property
    def _integral(self) -> Integral:
        """Of the commands that arrive and the shares that act, (..., 2, k); (..., 1, k): the same."""
        c = self._commands
        if not self.slow:
            return Integral(c.edges, c.values[:, None], c.before[None])
        edges = self.step * np.arange(self._steps + 1)
        commands = np.diff(c(edges), axis=0) / self.step
        apart = all(memory.filter or memory.each for _, memory in self._memories)
        values = self._signal_by_signal(commands) if apart else None
        if values is None:
            values = self._stepped(commands)
        return Integral(edges, values, np.stack([c.before] * 2))

    @property
    def step(self) -> float:
        """Step of the grid [s]: a whole part of the period, but no finer than memories keep."""
        fine = self._period / np.ceil(self._period / (LONGEST_STEP * self.model.ship.scale.time) - 1e-6)
        kept = [
            self._lasts(member, memory) / (memory.keeps - 1)
            for member, memory in self._memories
            if memory.keeps
        ]
        return float(max([fine, *kept]))

    def _lasts(self, member: Any, memory: Memory) -> float:
        return float(memory.lasts(*self.drive.params.dynamics[member.parameters]))

    @property
    def _steps(self) -> int:
        return int(np.ceil(self._clock[-1] / self.step + 1.0)) + 1

    def _signal_by_signal(self, commands: np.ndarray) -> np.ndarray | None:
        """(m, 2, k), what the thrusters make of commands (m, k) in steps of the grid.

        Of None an angle that a filter gives is more than half a turn behind.
        """
        found, x = [], commands.copy()
        before, turns = self._commands.before, np.array(self.drive.effects.layout.round)
        for of in ("command", "force"):
            for member, memory in self._memories:
                values = self.drive.params.dynamics[member.parameters]
                if memory.of == of and memory.filter is not None:
                    own, wanted = memory.own, x.copy()
                    law = memory.filter(self.step, *values)
                    x[:, own] = before[own] + filtered(*law, x[:, own] - before[own])
                    if np.any(np.abs(wanted - x)[:, turns] >= np.pi):
                        return None
                elif memory.of == of and memory.each is not None:
                    for k, angle in zip(memory.each.places, memory.each.turns, strict=True):
                        x[:, k] = self._moved(memory.each.move, x[:, k], before[k], values, angle)
            if of == "command":
                rates = np.broadcast_to(self.drive.params.rate, before.shape)
                for k in np.flatnonzero(rates > 0.0):
                    x[:, k] = self._moved(rate_limited, x[:, k], before[k], [rates[k]], bool(turns[k]))
            found.append(x.copy())
        return np.stack(found, axis=1)

    def _moved(
        self, move: Callable[..., Any], x: np.ndarray, at: float, values: Sequence[float], angle: bool
    ) -> np.ndarray:
        """(m,), means over each step of a signal that moves, from where it is, to wanted ones (m,)."""
        means, at = [], float(at)  # plain floats are ten times faster
        last = *map(float, values), self.step, angle
        for wanted in x.tolist():
            at, mean = move(at, wanted, *last)
            means.append(mean)
        return np.array(means)

    def _stepped(self, commands: np.ndarray) -> np.ndarray:
        """(m, 2, k), what the thrusters make of commands (m, k) in steps of the grid, in parts."""
        drive, h = self.drive, self.step
        before = part = int(np.ceil(self._longest_memory / h)) + 1  # about as long costs least
        rows = np.arange(-before, part)[:, None] + part * np.arange(-(-len(commands) // part))
        wanted = commands[np.clip(rows, 0, len(commands) - 1)]
        wanted = np.where(like(rows < 0, 1), self._commands.before, wanted)  # (m, parts, k)
        past = at_rest(drive.effects)
        found = np.empty((len(wanted), wanted.shape[1], 2, wanted.shape[2]))
        for k, each in enumerate(np.moveaxis(wanted, -1, 1)):
            past, arriving = command_response(past, tuple(each), drive, h)
            past, shares = force_response(past, arriving, drive, h)
            for one in range(len(each)):
                found[k, :, 0, one], found[k, :, 1, one] = arriving[one], shares[one]
        return np.moveaxis(found[-part:], 1, 0).reshape(-1, *found.shape[2:])[: len(commands)]
