"""Rules that every component keeps, checked for each that declares itself."""

import inspect
import math
import random
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cases import slow
from support.project import COMPONENTS
from support.ships import PARTS
from support.ships import component as part_of_ship
from support.traced import evaluated

from fmus import ops
from fmus.base_units import base_exponents
from fmus.declare import Component, DeclarationError, flatten, packer, rebuild, variables
from fmus.fmi.trace import (
    TraceError,
    initial_dependencies,
    output_dependencies,
    trace_init,
    trace_step,
    used_variables,
    variable,
)

every_component = pytest.mark.parametrize("name", [*COMPONENTS, *PARTS])
# The two of them that take longest; controller_cl_svd_z2 and controller_cl_win_eps are like them.
LONGEST = ("controller_cl_svd_eps", "controller_cl_win_eps_all")
every_component_longest_slow = pytest.mark.parametrize(
    "name", [slow(n) if n in LONGEST else n for n in (*COMPONENTS, *PARTS)]
)


def component_of(name):
    """A component of the project, or a part of a described ship."""
    return COMPONENTS[name] if name in COMPONENTS else part_of_ship(name)


def arguments(component, rng, spread=0.5):
    """Random inputs around zero, parameters within their ranges, and a state after a few such steps."""
    inputs = [rng.uniform(-spread, spread) for _ in variables(component.inputs)]
    params = flatten(component.params())
    packed = packer(component.params)(params)
    state = component.init(packer(component.inputs)(inputs), packed)
    for _ in range(5):
        shaken = packer(component.inputs)([x + rng.gauss(0, 0.1) for x in inputs])
        state, _ = component.step(state, shaken, packed, 0.01)
    return params, inputs, state


def values_of(params, inputs, state, h):
    named = {f"params[{k}]": x for k, x in enumerate(params)}
    named |= {f"inputs[{k}]": x for k, x in enumerate(inputs)}
    named |= {f"state[{k}]": x for k, x in enumerate(flatten(state))}
    return named | {"h": h}


def directly(component, params, inputs, state, h):
    new, outputs = component.step(
        state, packer(component.inputs)(inputs), packer(component.params)(params), h
    )
    return flatten(new) + flatten(outputs)


def moved_but(group, values, kept, by):
    """Values of inputs or parameters, all but those of some names moved."""
    return [x if f"{group}[{k}]" in kept else x + by for k, x in enumerate(values)]


@every_component_longest_slow
def test_traced_component_computes_what_the_plain_one_does(name):
    """Also proves the style rules: what cannot be traced raises TraceError."""
    component = component_of(name)
    trace = trace_step(component)
    rng = random.Random(name)
    points = [(*arguments(component, rng), 0.01) for _ in range(5)]
    traced = evaluated(trace.state + trace.outputs, [values_of(*point) for point in points])
    assert list(traced) == [directly(component, *point) for point in points]


@every_component
def test_traced_initial_state_is_the_plain_one(name):
    component = component_of(name)
    trace = trace_init(component)
    params, inputs, _ = arguments(component, random.Random(1))
    state = component.init(packer(component.inputs)(inputs), packer(component.params)(params))
    assert [*evaluated(trace.state, [values_of(params, inputs, (), 0.0)])] == [flatten(state)]


@every_component
def test_batch_of_arrays_gives_what_single_runs_give(name):
    component = component_of(name)
    rng = random.Random(name)
    single = [arguments(component, rng) for _ in range(7)]
    template = single[0][2]
    states = rebuild(template, list(np.array([flatten(s) for _, _, s in single]).T))
    inputs = packer(component.inputs)(list(np.array([i for _, i, _ in single]).T))
    state, outputs = component.step(states, inputs, component.params(), 0.01)
    together = [np.broadcast_to(x, 7) for x in flatten(state) + flatten(outputs)]
    for k, (params, one_inputs, one_state) in enumerate(single):
        alone = directly(component, params, one_inputs, one_state, 0.01)
        assert [x[k] for x in together] == pytest.approx(alone, rel=1e-12, abs=1e-14)


@every_component
def test_no_step_changes_nothing(name):
    """A step of h = 0 gives the outputs of the present state and keeps it."""
    component = component_of(name)
    params, inputs, _ = arguments(component, random.Random(2))
    p, i = packer(component.params)(params), packer(component.inputs)(inputs)
    state = component.init(i, p)
    again, first = component.step(state, i, p, 0.0)
    assert again == state
    assert component.step(again, i, p, 0.0)[1] == first


@every_component
def test_everything_is_declared(name):
    component = component_of(name)
    for v in component.variables:
        assert v.description, v.name
        base_exponents(v.unit)
        assert math.isfinite(v.start)
        assert v.range.min is None or v.range.min <= v.start
        assert v.range.max is None or v.start <= v.range.max
    assert component.description
    assert inspect.getmodule(component.step).__doc__


@every_component_longest_slow
def test_dependencies_hold_against_perturbation(name):
    """All inputs at once that an output is not declared to follow do not move it within one step."""
    component = component_of(name)
    declared = output_dependencies(component)
    rng = random.Random(name)
    # A plant's state answers through the integral, which a vanishing step takes away.
    h = 0.01 if component.sampled else 1e-13
    held = {
        f"inputs[{k}]" for k, v in enumerate(variables(component.inputs)) if v.name in component.held
    }
    for _ in range(10):
        params, inputs, state = arguments(component, rng)
        outputs = directly(component, params, inputs, state, h)[-len(declared) :]
        for stated in set(declared):
            moved = moved_but("inputs", inputs, stated | held, 0.3)
            changed = directly(component, params, moved, state, h)[-len(declared) :]
            for a, b, followed in zip(outputs, changed, declared, strict=True):
                assert followed != stated or abs(a - b) <= 1e-11


@every_component
def test_initial_dependencies_hold_against_perturbation(name):
    component = component_of(name)
    declared = initial_dependencies(component)
    rng = random.Random(name)

    def outputs(params, inputs):
        p, i = packer(component.params)(params), packer(component.inputs)(inputs)
        return flatten(component.step(component.init(i, p), i, p, 0.0)[1])

    params = flatten(component.params())
    inputs = [rng.uniform(-0.5, 0.5) for _ in variables(component.inputs)]
    before = outputs(params, inputs)
    for stated in set(declared):
        after = outputs(
            moved_but("params", params, stated, 0.07), moved_but("inputs", inputs, stated, 0.07)
        )
        for a, b, followed in zip(before, after, declared, strict=True):
            assert followed != stated or a == b


def test_steps_need_only_the_standard_library():
    code = (
        "import sys; from fmus.declare import discover; from fmus.ship import ship\n"
        "for _, c in discover(ship()):\n"
        "    i, p = c.inputs(), c.params()\n"
        "    c.step(c.init(i, p), i, p, 0.01)\n"
        "print(sorted({'numpy', 'scipy', 'pythonfmu'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "misuse",
    [
        lambda x: 1.0 if x > 0.0 else 2.0,
        lambda x: math.sin(x),
        lambda x: float(x),
        lambda x: x**2,
        lambda x: x % 1.0,
        lambda x: min(x, 1.0),
        lambda x: np.sin(x),
        lambda x: range(x),
    ],
)
def test_what_would_not_run_elsewhere_raises(misuse):
    with pytest.raises((TraceError, TypeError)):
        misuse(variable("x"))


def test_zero_factor_cuts_a_dependency():
    x, y = variable("x"), variable("y")
    assert used_variables([x * 0.0 + y, x * y, 3.0]) == [{"y"}, {"x", "y"}, frozenset()]


def test_declaring_a_name_twice_is_refused():
    c = COMPONENTS["vessel"]
    twice = Component("twice", "", c.params, c.state, c.outputs, c.outputs, c.init, c.step)
    with pytest.raises(DeclarationError, match="more than once"):
        _ = twice.variables


@pytest.mark.parametrize(
    ("unit", "exponents"),
    [
        ("1", {}),
        ("N", {"kg": 1, "m": 1, "s": -2}),
        ("N.m.s2/rad2", {"kg": 1, "m": 2, "rad": -2}),
        ("N.s2/(m.rad)", {"kg": 1, "rad": -1}),
        ("rad/s2", {"s": -2, "rad": 1}),
        ("kg.m2", {"kg": 1, "m": 2}),
        ("W", base_exponents("N.m/s")),
        ("kg.m/N", base_exponents("s2")),
    ],
)
def test_units_are_taken_apart(unit, exponents):
    assert base_exponents(unit) == exponents


def test_unknown_unit_is_refused():
    with pytest.raises(ValueError, match="furlong"):
        base_exponents("furlong/s")


@pytest.mark.parametrize("name", ["sin", "cos", "exp", "log", "sqrt"])
@pytest.mark.parametrize("x", [0.0, 1.5, -2.0, 1e4, math.inf, -math.inf, math.nan])
def test_functions_give_outside_their_domain_what_arrays_give(name, x):
    with np.errstate(all="ignore"):
        expected = getattr(ops, name)(np.array([x]))[0]
    assert getattr(ops, name)(x) == pytest.approx(expected, nan_ok=True)


@given(st.floats(allow_nan=False))
def test_the_hyperbolic_tangent_is_that_of_the_library(x):
    assert ops.tanh(x) == pytest.approx(math.tanh(x), rel=1e-15, abs=3e-16)
    assert ops.tanh(np.array([x])).item() == ops.tanh(x)
