"""A, B, C, D of an FMU about a state, by its own derivatives, else by differences from there."""

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.io import savemat

from cosim import InputError, SimulationError
from cosim.fmu import ConfinedFmu, FmuModel
from cybership.message_text import quoted

from ..predictors import DEFAULT_EXECUTION, Execution
from ..predictors.black_box import MOTION, TAU
from ..predictors.fmu.fmu_playback import ShortSteps, confined
from ..predictors.fmu.variable_map import VariableMap, propose
from ..predictors.weak_form import SMALL
from ..report.formatting import write_json
from ..runs import QUANTITY
from .system_map import SystemMap, column_of_start

SHORT_STEP = 1e-3  # s, of the short steps where the FMU suggests none; chosen


class LinearState(NamedTuple):
    """A state of an FMU.

    Attributes:
        name: of the variable that sets it.
        seen: variable by which it is seen.
        order: of the derivative of that which is the state's own rate: 1, or 2 of a velocity that is
            seen by its position; 0: that is the rate itself.
    """

    name: str
    seen: str
    order: int


@dataclass(frozen=True, eq=False)
class LinearModel:
    """d/dt x = x_dot + A (x - x0) + B (u - u0), y = y0 + C (x - x0) + D (u - u0).

    Attributes:
        states, inputs, outputs: names of the variables.
        at: variable -> value about which: states and inputs, and what outputs are there.
        x_dot: (n,), rate of the states there.
        A, B, C, D: the matrices.
        doubt: change of A by longer steps, as a share of its largest value; 0: no rate is by steps.
    """

    states: Sequence[str]
    inputs: Sequence[str]
    outputs: Sequence[str]
    at: Mapping[str, float]
    x_dot: np.ndarray
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    doubt: float

    def write(self, folder: Path, units: Mapping[str, str]) -> list[str]:
        """Write ``linear.json`` and ``linear.mat``; returns their names."""

        def stated(names: Sequence[str]) -> list[dict[str, object]]:
            return [{"name": n, "unit": units[n], "value": self.at[n]} for n in names]

        groups = {"states": self.states, "inputs": self.inputs, "outputs": self.outputs}
        matrices = {"A": self.A, "B": self.B, "C": self.C, "D": self.D}
        roots = np.linalg.eigvals(self.A) if self.A.size else np.zeros(0)
        content = {
            **{group: stated(names) for group, names in groups.items()},
            "x_dot": self.x_dot.tolist(),
            **{name: m.tolist() for name, m in matrices.items()},
            "eigenvalues": [[float(x.real), float(x.imag)] for x in roots],
        }
        write_json(folder / "linear.json", content)
        cells = {
            f"{group}{more}": np.array([of(n) for n in names], dtype=object)
            for group, names in groups.items()
            for more, of in (("", str), ("_units", units.__getitem__))
        }
        savemat(folder / "linear.mat", {**matrices, "x_dot": self.x_dot, **cells})
        return ["linear.json", "linear.mat"]


def states_of(model: FmuModel, given: SystemMap | None) -> list[LinearState]:
    """The states of an FMU that can be set: by a map, else those that it lists, else those of a ship.

    Raises:
        InputError: none is known.
    """
    if given is not None and given.start:
        return _of_map(given, model)
    listed = _listed(model)
    if listed:
        return listed
    commands = {s: QUANTITY[s] for s in TAU}
    found = _of_ship(propose(model, commands))
    if not found:
        raise InputError(
            f"no state of '{model.path.name}' can be set: it declares no state with an exact start "
            "value, and a --map with 'start' is missing"
        )
    return found


def _of_map(given: SystemMap, model: FmuModel) -> list[LinearState]:
    """Those of a map, by the rates that the FMU declares, else by differences of the outputs."""
    listed = model.description.modelVariables
    declared = {v.derivative.name: v.name for v in listed if v.derivative is not None}
    rates = {column_of_start(key)[0] for key in given.start if column_of_start(key)[1]}
    found = []
    for key, c in given.start.items():
        column, rate = column_of_start(key)
        if c.name in declared:
            found.append(LinearState(c.name, declared[c.name], 0))
        else:
            order = 2 if rate and column in rates else 1
            found.append(LinearState(c.name, given.outputs[column].name, order))
    return found


def _listed(model: FmuModel) -> list[LinearState]:
    """Those of the model structure."""
    found = []
    for unknown in model.description.derivatives:
        rate = unknown.variable
        state = getattr(rate, "derivative", None)
        if rate is None or state is None:
            continue
        if not model.can_be_set(model.variables[state.name]):
            raise InputError(
                f"state {quoted(state.name)} of '{model.path.name}' cannot be set; a --map with "
                "'start' names the start values of the states"
            )
        found.append(LinearState(state.name, rate.name, 0))
    return found


def _of_ship(found: VariableMap) -> list[LinearState]:
    start, outputs = found.stated("start"), found.stated("outputs")
    both = [s for s in MOTION if s in start and s in outputs]
    return [LinearState(start[s].name, outputs[s].name, 1) for s in both]


def linearised(
    model: FmuModel,
    states: Sequence[LinearState],
    at: Mapping[str, float],
    outputs: Sequence[str],
    execution: Execution = DEFAULT_EXECUTION,
) -> LinearModel:
    """The linear model about a state.

    Args:
        model: the FMU.
        states: that are set.
        at: variable -> value; what it does not name has its start value.
        outputs: of the linear model.
        execution: how the FMU is run.

    Raises:
        InputError: the FMU refuses the state, or fails; a name that cannot be set.
    """
    inputs = [v.name for v in model.reals("input")]
    start = {s.name: float(model.variables[s.name].start or 0.0) for s in states}
    start |= {n: x for n, x in at.items() if n not in inputs}
    driven = {n: at.get(n, float(model.variables[n].start or 0.0)) for n in inputs}
    h = model.suggested_step or SHORT_STEP
    with closing(confined(model, execution)) as fmu:
        n, doubt, every = len(states), 0.0, (*(s.name for s in states), *driven)
        J = _exact(fmu, states, start, driven, outputs, h)
        base, slopes = _by_steps(fmu, states, start, driven, outputs, h, every if J is None else ())
        if J is None:
            J = slopes
            if any(s.order for s in states):
                _, longer = _by_steps(fmu, states, start, driven, outputs, 2.0 * h, every)
                doubt = float(np.abs(longer - J)[:n, :n].max() / max(np.abs(J[:n, :n]).max(), 1e-300))
    if not (np.isfinite(J).all() and np.isfinite(base).all()):
        raise InputError(f"'{model.path.name}' has no finite derivatives in this state")
    values = {**start, **driven, **dict(zip(outputs, base[n:].tolist(), strict=True))}
    names = [s.name for s in states]
    return LinearModel(
        names, inputs, list(outputs), values, base[:n], J[:n, :n], J[:n, n:], J[n:, :n], J[n:, n:], doubt
    )


def _by_steps(
    fmu: ConfinedFmu,
    states: Sequence[LinearState],
    start: Mapping[str, float],
    driven: Mapping[str, float],
    outputs: Sequence[str],
    h: float,
    known: Sequence[str],
) -> tuple[np.ndarray, np.ndarray]:
    """Rates and outputs at a state, and their slopes by some variables, by central differences."""
    seen = [*outputs, *(s.seen for s in states)]
    with closing(ShortSteps(fmu, [*driven], seen, h, False)) as steps:

        def answer(moved: Mapping[str, float]) -> np.ndarray:
            parts = ({n: np.array([moved.get(n, x)]) for n, x in p.items()} for p in (start, driven))
            found = {name: x[:, 0] for name, x in steps.run(*parts).items()}
            rates = []
            for s in states:
                x = found[s.seen]
                rates.append(x[0] if s.order == 0 else steps.derivatives(x)[s.order - 1])
            return np.array([*rates, *(found[n][0] for n in outputs)])

        base, columns = answer({}), []
        for name in known:
            value = {**start, **driven}[name]
            d = SMALL * max(abs(value), 1.0)  # of one unit where the value is less
            low, high = (answer({name: x}) for x in (value - d, value + d))
            columns.append((high - low) / (2.0 * d))
    return base, np.column_stack([*columns, np.zeros((base.size, 0))])


def _exact(
    fmu: ConfinedFmu,
    states: Sequence[LinearState],
    start: Mapping[str, float],
    driven: Mapping[str, float],
    outputs: Sequence[str],
    h: float,
) -> np.ndarray | None:
    """The slopes of rates and outputs by states and inputs, from the FMU itself; None: it has none.

    FMI 2.0.4, 2.1.9. Rates that are seen by differences of other variables have no such slopes.
    """
    stated = fmu.model.description.coSimulation
    if stated is None or not stated.providesDirectionalDerivative or any(s.order for s in states):
        return None
    variables, instance = fmu.model.variables, fmu.instance()
    try:
        instance.set_up(h)
        for name, value in {**start, **driven}.items():
            instance.set_value(variables[name], value)
        instance.enter_initialization()
        instance.exit_initialization()
        unknown = [variables[n] for n in (*(s.seen for s in states), *outputs)]
        known = [variables[n] for n in (*(s.name for s in states), *driven)]
        columns = [instance.directional_derivative(unknown, v) for v in known]
        J = np.array(columns).reshape(len(known), len(unknown)).T
    except SimulationError:
        return None
    finally:
        instance.free()
    # Of an output that is a state some tools return 0.
    for row, name in enumerate(outputs, len(states)):
        same = [variables[name].reference == v.reference for v in known]
        if any(same):
            J[row] = same
    return J
