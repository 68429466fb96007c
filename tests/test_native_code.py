"""The C that components become: the same bits as Python, branches that are not taken, and its failures."""

import math
import random
import subprocess

import pytest
from support import ccode
from support.cases import slow
from support.ccode import same_bits
from support.command import command
from support.project import COMPONENTS, ROOT
from support.ships import PARTS
from support.ships import component as part_of_ship

from fmus.build.__main__ import main
from fmus.declare import Component, Variable, flatten, group_of, packer, variables
from fmus.fmi.trace import TraceError
from fmus.native.c_text import number
from fmus.native.program import program
from fmus.native.python_text import function
from fmus.native.tape import Branch, Call, Kernels, Tape
from fmus.ops import (
    atan2,
    clip,
    cos,
    exp,
    floor,
    fmax,
    fmin,
    kernel,
    not_,
    sin,
    sqrt,
    when,
    where,
)
from fmus.signals import Force, Nothing

compiled = pytest.mark.skipif(ccode.COMPILER is None, reason="no C compiler on this machine")
# Their stores make source of up to 40,000 lines, at which a C compiler takes seconds.
LARGE = [name for name in COMPONENTS if name.startswith("controller_cl_")]


def shaken(v, rng):
    """A value of a parameter within its range: as it starts, near that, at a limit, zero, or anywhere."""
    low = v.start - abs(v.start) - 0.3 if v.range.min is None else v.range.min
    high = v.start + abs(v.start) + 0.3 if v.range.max is None else v.range.max
    values = [v.start, v.start * rng.uniform(0.5, 1.5), low, 0.0, -0.0, rng.uniform(low, high)]
    return min(max(rng.choice(values), low), high)


def by_python(function):
    """What a function gives, flat; None where Python divides by zero."""
    try:
        return flatten(function())
    except ZeroDivisionError:
        return None


def agree(expected, got):
    return got is None if expected is None else got is not None and same_bits(expected, got)


@compiled
@pytest.mark.parametrize("name", [*[slow(n) if n in LARGE else n for n in COMPONENTS], *PARTS])
def test_c_gives_the_same_bits(name):
    """Over runs of 15 steps from random parameters: extreme ones, and inputs that are NaN or infinite."""
    component = COMPONENTS[name] if name in COMPONENTS else part_of_ship(name)
    run = ccode.Compiled(component)
    rng = random.Random(name)
    pack = packer(component.inputs)
    count = len(variables(component.inputs))
    odd = [0.0, -0.0, 1e3, *([] if component.hold_nonfinite else [math.nan, math.inf])]
    for trial in range(16 if name in COMPONENTS and name not in LARGE else 6):
        share = rng.random() if trial else 0.0
        params = [
            shaken(v, rng) if rng.random() < share else v.start for v in variables(component.params)
        ]
        p = packer(component.params)(params)
        inputs = [rng.uniform(-0.5, 0.5) for _ in range(count)]
        state = component.init(pack(inputs), p)
        assert agree(flatten(state), run.init(params, inputs))
        for step in range(15):
            inputs = [x + rng.gauss(0, 0.1) for x in inputs]
            given = [rng.choice(odd) if step == 9 and rng.random() < 0.3 else x for x in inputs]
            h = rng.choice([0.01, 0.01, 0.005, 0.02, 0.0])
            found = []

            def advance(given=given, p=p, h=h, found=found, state=state):
                found[:] = component.advance(state, pack(given), component.prepared(p), h)
                return found

            expected = by_python(advance)
            assert agree(expected, run.step(params, given, flatten(state), h)), (trial, step)
            if expected is None:
                break
            state = found[0]


Given = group_of("Given", [Variable(name, "1", "an input", 0.0) for name in "abc"])


def of_inputs(function):
    """A component whose outputs are a function of its inputs; its state counts steps."""

    def step(s, i, p, h):
        return (s[0] + 1.0,), Force(*function(*i))

    return Component("tried", "", Nothing, tuple, Given, Force, lambda i, p: (0.0,), step)


@compiled
def test_traps_of_arithmetic():
    """Zeros keep their signs, infinities have no whole part, NaN is not folded away."""
    component = of_inputs(
        lambda a, b, c: (a + 0.0 - b * 0.0, floor(a), where(a - a == 0.0, -a, c / 3.0))
    )
    run = ccode.Compiled(component, "-O2")
    values = [0.0, -0.0, 0.5, -0.5, 1e300, -1e-320, math.inf, -math.inf, math.nan]
    for a in values:
        for b in values:
            expected = [1.0, *component.step((0.0,), Given(a, b, 0.1), None, 0.0)[1]]
            assert same_bits(run.step([], [a, b, 0.1], [0.0], 0.0), expected)


@compiled
def test_division_by_zero_fails_where_python_fails():
    """Also where nothing uses the quotient; not in a branch that is not taken."""

    def function(a, b, c):
        _ = 1.0 / b
        return when(a > 0.0, lambda: 1.0 / c, lambda: c), a, b

    component = of_inputs(function)
    run = ccode.Compiled(component)
    for given in ([1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [1.0, 1.0, 2.0]):
        expected = by_python(lambda given=given: [*component.step((0.0,), Given(*given), None, 0.0)])
        assert agree(expected, run.step([], given, [0.0], 0.0))


@kernel
def heavy(x, y):
    return floor(x) + 1.0 / y, x > y


def mixed(a, b):
    """With a kernel, a branch, and every operation."""
    whole, more = heavy(a, b)
    either = where((a <= b) | not_(whole == 3.0), -abs(a), math.inf)
    chosen = when(more & (a != 3.0), lambda: (whole, exp(a)), lambda: (fmin(a, b), sqrt(a)))
    return *chosen, either, fmax(a, -0.0), cos(b), atan2(b, a), clip(a, -1.0, b), math.nan


@compiled
def test_a_kernel_and_a_branch_in_c_give_the_same_bits():
    component = of_inputs(lambda a, b, c: mixed(a, b)[:3])
    run = ccode.Compiled(component)
    for a in (-2.5, -0.0, 0.5, 3.0, 3.5):
        for b in (0.5, -3.0, 3.25, 0.0):
            expected = by_python(lambda a=a, b=b: [*component.step((0.0,), Given(a, b, 0.0), None, 0.0)])
            assert agree(expected, run.step([], [a, b, 0.0], [0.0], 0.0))


@compiled
def test_truth_values_may_be_prepared():
    """They pass through an array of doubles, beside what is no number at all."""
    vessel = COMPONENTS["vessel"]
    recorded = program(vessel)
    assert any(x.condition for x in recorded.prepare.results)
    run = ccode.Compiled(vessel)
    params = [v.start for v in variables(vessel.params)]
    assert len(run.step(params, [0.1, 0.0, 0.0], [0.0] * 7, 0.01)) == 7 + len(variables(vessel.outputs))


@compiled
@pytest.mark.parametrize("h", [0.01, 0.05])
def test_a_component_moves_on_in_c_as_in_python(h):
    """Also where a step is taken in parts, and the state between."""
    vessel = COMPONENTS["vessel"]
    assert 0.01 < vessel.max_step < 0.05
    one, other = (
        make(vessel, vessel.params(), Force(0.1)) for make in (ccode.Stepped, ccode.SteppedInC)
    )
    for k in range(20):
        force = [0.5, 0.1 * k, -0.05]
        assert same_bits(one.advance(force, h), other.advance(force, h))
        assert same_bits(flatten(one.state), flatten(other.state))


def test_branch_and_kernel_are_recorded_as_such():
    @kernel
    def heavy(x, y):
        return x * y + 1.0, x > y

    tape = Tape(Kernels())
    a, b = tape.variable("a"), tape.variable("b")
    one, other = heavy(a, b), heavy(b, 2.0)
    chosen = when(one[1], lambda: (a * a, b), lambda: (other[0], b))
    kinds = [type(statement) for statement in tape.recording([*chosen]).body]
    assert kinds == [Call, Call, Branch]
    assert chosen[1] is b
    assert len(tape.kernels.recordings) == 1
    assert heavy(3.0, 2.0) == (7.0, True)


@pytest.mark.parametrize("x", [-2.0, -0.0, 0.5, 3.0, math.inf, math.nan])
def test_flat_python_gives_the_same_bits(x):
    """Branches, kernels, all operations, and numbers that are no numbers."""
    tape = Tape(Kernels())
    recording = tape.recording([*mixed(tape.variable("a"), tape.variable("b"))])
    flat = function(recording, tape.kernels, "a", "b")
    for y in (0.5, -3.0):
        assert same_bits(flat(x, y), [*map(float, mixed(x, y))])


def test_same_operation_on_the_same_numbers_is_recorded_once_where_it_is_in_force():
    tape = Tape(Kernels())
    x = tape.variable("state[0]")
    first = sin(x)
    assert sin(x) is first
    assert cos(x) is not first
    assert tape.variable("state[0]") is x
    assert x * 0.0 is not x * -0.0
    inside = []

    def branch():
        inside.append(sin(x) + exp(x))
        return inside[0]

    when(x > 0.0, branch, lambda: x)
    assert inside[0].args[0] is first, "what came before holds in a branch"
    assert exp(x) is not inside[0].args[1], (
        "a branch that may not be taken gives nothing to what follows"
    )


def test_value_of_another_branch_or_function_is_refused():
    tape, other = Tape(Kernels()), Tape(Kernels())
    a, kept = tape.variable("a"), []
    when(a > 0.0, lambda: kept.append(a * a) or a, lambda: a)
    for wrong in (lambda: kept[0] + 1.0, lambda: a + other.variable("b")):
        with pytest.raises(TraceError, match="outside"):
            wrong()


@pytest.mark.parametrize("x", [0.0, -0.0, 0.1, 1e300, 5e-324, math.inf, -math.inf, math.nan, True, 3])
def test_numbers_are_written_to_the_bit(x):
    text = number(x).strip("()").replace("INFINITY", "inf").replace("NAN", "nan")
    assert same_bits([float(text)], [x])


@compiled
def test_source_for_programs_of_ones_own_runs_as_its_readme_says(tmp_path):
    done = command(main, "--native", "thrusters", "vessel", "--source", tmp_path / "c")
    assert done.returncode == 0, done.stderr
    assert {p.name for p in (tmp_path / "c").iterdir()} == {
        "README.md", "thrusters.c", "thrusters.h", "vessel.c", "vessel.h"
    }  # fmt: skip
    readme = (tmp_path / "c" / "README.md").read_text()
    (tmp_path / "c" / "main.c").write_text(readme.split("```c\n")[1].split("```")[0])
    strict = ["-std=c99", "-pedantic-errors", "-Wall", "-Werror", "-Wno-unused", "-ffp-contract=off"]
    subprocess.run(
        [ccode.COMPILER, *strict, "-fno-builtin", "-o", "run", "main.c", "thrusters.c", "-lm"],
        check=True, cwd=tmp_path / "c",
    )  # fmt: skip
    printed = subprocess.run([tmp_path / "c" / "run"], capture_output=True, text=True, check=True).stdout
    component = COMPONENTS["thrusters"]
    i, p = component.inputs(), component.params()
    state = component.init(i, p)
    for _ in range(100):
        state, outputs = component.step(state, i, p, 0.01)
    assert same_bits(map(float, printed.split()), flatten(outputs))
    source = (tmp_path / "c" / "vessel.c").read_text()
    assert "alloc" not in source
    assert "\nstatic double" not in source.replace("static inline", "")


def test_generated_code_names_the_place_of_no_file():
    text = "".join(ccode.model_source(program(COMPONENTS["vessel"])).values())
    assert str(ROOT) not in text


WRONG = '''"""A component that is none: its step counts its calls."""

from itertools import count
from typing import Annotated, NamedTuple

from fmus.declare import component

CALLS = count()


class Inputs(NamedTuple):
    a: Annotated[float, "1", "input"] = 0.0


class Params(NamedTuple):
    k: Annotated[float, "1", "gain"] = 1.0


class Outputs(NamedTuple):
    y: Annotated[float, "1", "output"] = 0.0


class State(NamedTuple):
    x: Annotated[float, "1", "state"] = 0.0


def init(i: Inputs, p: Params) -> State:
    return State()


def step(s: State, i: Inputs, p: Params, h: float) -> tuple[State, Outputs]:
    return State(s.x + h), Outputs(s.x * float(next(CALLS)))


COMPONENT = component(name="wrong", description="Wrong", init=init, step=step)
'''


@pytest.mark.parametrize("option", ["--out", "--source"])
def test_a_step_that_is_no_function_of_its_arguments_is_refused_where_it_is_compiled(tmp_path, option):
    file = tmp_path / "wrong.py"
    file.write_text(WRONG)
    done = command(main, "--native", file, option, tmp_path / "made")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "wrong cannot be compiled: its functions give another result" in done.stderr
    assert not (tmp_path / "made").exists()
