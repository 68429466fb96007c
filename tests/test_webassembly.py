"""WebAssembly of the components: what Chromium computes with it is what Python computes."""

import base64
import json
import math
import random

import pytest
from support.chromium import opened
from support.project import COMPONENTS

from fmus.declare import Component, Variable, flatten, group_of, packer, variables
from fmus.native.program import program
from fmus.native.webassembly import component_module
from fmus.ops import exp, floor, fmax, fmin, kernel, log, not_, when, where
from fmus.signals import Nothing

TOLERANCE = 1e-12  # relative to the value, absolute below 1
STEPS, H = 6, 0.01  # [1], [s]
# Runs each module from its initial state; prints a line a step: state and outputs, or "fails".
PAGE = """<!DOCTYPE html><pre></pre><script>
const lines = [], text = (x) => (Object.is(x, -0) ? "-0" : String(x));
for (const { code, params, steps } of %s) {
  const binary = Uint8Array.from(atob(code), (c) => c.charCodeAt(0));
  const { exports } = new WebAssembly.Instance(new WebAssembly.Module(binary), { Math });
  const place = (name, count) => new Float64Array(exports.memory.buffer, exports[name].value, count);
  place("params", params.length).set(params);
  place("h", 1)[0] = %g;
  steps.forEach(({ inputs, states, outputs }, k) => {
    place("inputs", inputs.length).set(inputs);
    const failed = (k ? 0 : exports.prepare() || exports.init()) || exports.step();
    place("state", states).set(place("after", states));
    lines.push(failed ? "fails" : [...place("after", states), ...place("outputs", outputs)].map(text).join(" "));
  });
}
document.querySelector("pre").textContent = lines.join("\\n");
</script>"""


def trial(component, rng):
    """A run of a component from its start values: what the page gets, and what Python computes."""
    pack, p = packer(component.inputs), packer(component.params)
    params = [v.start for v in variables(component.params)]
    inputs = [rng.uniform(-0.5, 0.5) for _ in variables(component.inputs)]
    state, steps, expected = component.init(pack(inputs), p(params)), [], []
    for _ in range(STEPS):
        state, outputs = component.advance(state, pack(inputs), component.prepared(p(params)), H)
        expected.append([*flatten(state), *flatten(outputs)])
        counts = {"states": len(flatten(state)), "outputs": len(flatten(outputs))}
        steps.append({"inputs": inputs, **counts})
        inputs = [x + rng.gauss(0.0, 0.1) for x in inputs]
    return {**as_module(component), "params": params, "steps": steps}, expected


def as_module(component):
    return {"code": base64.b64encode(component_module(program(component))).decode()}


def in_browser(folder, trials):
    """Lines of numbers that Chromium computes; None where a function reports an error."""
    page = folder / "page.html"
    page.write_text(PAGE % (json.dumps(trials), H))
    text = opened(page, folder, "--dump-dom").partition("<pre>")[2].partition("</pre>")[0]
    return [None if row == "fails" else [*map(float, row.split())] for row in text.splitlines()]


@pytest.mark.slow
def test_steps_of_all_components_are_those_of_python(tmp_path):
    rng = random.Random(1)
    trials, expected = zip(*(trial(c, rng) for c in COMPONENTS.values()), strict=True)
    found = in_browser(tmp_path, trials)
    rows = [row for one in expected for row in one]
    names = [name for name in COMPONENTS for _ in range(STEPS)]
    assert len(found) == len(rows)
    for name, row, got in zip(names, rows, found, strict=True):
        assert got is not None, name
        assert got == pytest.approx(row, rel=TOLERANCE, abs=TOLERANCE), name


@kernel
def doubled(a, positive):
    return where(positive, 2.0 * a, -a), not_(positive)


def everything(a, b):
    """Operations of all kinds on two numbers."""
    twice, negative = doubled(a, a > 0.0)
    chosen = when(negative, lambda: (exp(b), a < b), lambda: (1.0 / b, a >= b))
    both = (a <= b) & ((b == 0.5) | not_(a != b))
    return (twice, chosen[0], where(chosen[1], 1.0, 0.0), where(both, log(abs(b) + 1.0), fmin(a, b)),
            fmax(a, b), floor(a), -a * 0.0, where(negative, a < b, both) * 1.0)  # fmt: skip


def test_operations_are_those_of_python(tmp_path):
    """Zeros keep their signs, NaN is not folded away, a division by zero fails where Python fails."""
    outputs = [Variable(f"y{k}", "1", "an output", 0.0) for k in range(8)]
    given = group_of("GivenTwo", [Variable(name, "1", "an input", 0.0) for name in "ab"])
    results = group_of("GotEight", outputs)
    component = Component(
        "tried", "", Nothing, tuple, given, results,
        lambda i, p: (0.0,), lambda s, i, p, h: ((s[0] + 1.0,), results(*everything(*i))),
    )  # fmt: skip
    values = [0.0, -0.0, 0.5, -0.5, 1e300, -1e-320, math.inf, -math.inf, math.nan]
    pairs = [[a, b] for a in values for b in values]
    steps = [{"inputs": pair, "states": 1, "outputs": 8} for pair in pairs]
    found = in_browser(tmp_path, [{**as_module(component), "params": [], "steps": steps}])
    assert len(found) == len(pairs)
    for pair, got in zip(pairs, found, strict=True):
        try:
            expected = [*everything(*pair)]
        except ZeroDivisionError:
            assert got is None, pair
            continue
        assert got is not None, pair
        assert got[1:] == pytest.approx(expected, rel=1e-15, abs=0.0, nan_ok=True), pair
        signs = [[math.copysign(1.0, x) for x in row if x == x] for row in (got[1:], expected)]
        assert signs[0] == signs[1], pair


def test_a_module_is_the_same_for_the_same_source():
    component = COMPONENTS["observer_mdf"]
    assert component_module(program(component)) == component_module(program(component))
