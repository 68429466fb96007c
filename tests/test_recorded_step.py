"""A recorded step of a prediction gives the bits of the functions that it is recorded from.

In machine code it gives those of libm, of which a sine or an exponential of numpy may differ in the last.
"""

from dataclasses import replace

import numpy as np
import pytest
from support.measured import sail

from diagnosis import Model
from diagnosis.predictors import ship_with
from diagnosis.predictors.prediction import stacked
from diagnosis.predictors.thrust import drive_of
from diagnosis.predictors.traced import compiled_law, recorded_law, recorded_step
from diagnosis.predictors.traced.recorded_step import Inputs, Ready, step
from diagnosis.predictors.traced.recorded_step import recorded_step as recorded
from fmus.fmi.trace import TraceError
from fmus.vessel import vessel

H = 0.1  # s
SHIPS = {"cse1": Model(), "otter": Model(ship=ship_with((), "otter"))}


def changed(model: Model) -> Model:
    """Three models at once: a current and a loss in one of them, another drag in the last."""
    return stacked([model, model.plus({"V_n": 0.1, "loss_surge": 0.2}), model.plus({"delta_X_u": -1.0})])


def at(model: Model, rng: np.random.Generator) -> tuple[vessel.State, Inputs, Ready]:
    s = vessel.State._make(rng.uniform(-1.0, 1.0, (7, 1, 5)))
    count = len(model.drive.effects.layout.commands)
    given, acting = rng.uniform(-0.5, 0.5, (2, count, 1, 5))
    return s, Inputs(given, acting), Ready(model.hull, model.drive)


@pytest.mark.parametrize("name", SHIPS)
@pytest.mark.parametrize("of", [lambda m: m, changed])
def test_arrays(name, of):
    s, i, b = at(of(SHIPS[name]), np.random.default_rng(1))
    found = recorded(b, i, single=False)(*s, *i.given, *i.acting, H)
    for x, y in zip(found, step(s, i, b, H), strict=True):
        np.testing.assert_array_equal(*np.broadcast_arrays(x, y))


@pytest.mark.parametrize("name", SHIPS)
def test_numbers(name):
    s, i, b = at(SHIPS[name], np.random.default_rng(2))
    s, i = vessel.State._make(x.item(0) for x in s), Inputs(*(x[:, 0, 0].tolist() for x in i[:2]))
    assert recorded(b, i, single=True)(*s, *i.given, *i.acting, H) == step(s, i, b, H)


def test_the_rudder_s_force_follows_the_motion_within_a_step():
    """So the order is that of the integration, four: half the step, a sixteenth of the error."""
    model = Model(ship=ship_with((), "kvlcc2"))
    b, i = Ready(model.hull, model.drive), Inputs((8.0, 0.3), (0.9, 0.5))
    ends = []
    for steps in (8, 16, 64):
        s = vessel.State(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
        for _ in range(steps):
            s = step(s, i, b, 8.0 / steps)
        ends.append(np.array(s[:6]))
    coarse, fine = (np.linalg.norm(x - ends[-1]) for x in ends[:2])
    assert 11.0 < coarse / fine < 25.0
    assert abs(ends[-1][2]) > 0.05, "it turns"


def by_step(start, given, acting, b):
    """The states (steps + 1, 7, 3, 5) by the functions that a step is recorded from."""
    s, found = start, []
    for k in range(len(given) + 1):
        found.append(np.stack([np.broadcast_to(x, (3, 5)) for x in s]))
        if k < len(given):
            s = step(s, Inputs(given[k], acting[k]), b, H)
    return np.stack(found)


@pytest.mark.skipif(not compiled_law.compiler(), reason="no binary for this: no C compiler")
@pytest.mark.parametrize("name", SHIPS)
def test_compiled_steps_follow_each_other(name):
    """States of three models in five windows, with commands that change from step to step."""
    rng = np.random.default_rng(5)
    s, i, b = at(changed(SHIPS[name]), rng)
    given, acting = (x * rng.uniform(0.5, 1.0, (20, *x.shape)) for x in i[:2])
    found = recorded_step.compiled_states(b, s, [given, acting, None, None], H)
    assert found is not None
    np.testing.assert_allclose(found, by_step(s, given, acting, b), rtol=1e-9, atol=1e-12)


@pytest.mark.skipif(not compiled_law.compiler(), reason="no binary for this: no C compiler")
@pytest.mark.parametrize("name", SHIPS)
def test_a_condition_that_holds_differs_from_one_of_each_model(name):
    """A current acts on one model, then on each of three."""
    one, other = (SHIPS[name].plus({"V_n": speed}) for speed in (0.1, 0.2))
    for model in (one, stacked([one, other, one])):
        s, i, b = at(model, np.random.default_rng(8))
        given, acting = (np.array([x]) for x in i[:2])
        found = recorded_step.compiled_states(b, s, [given, acting, None, None], H)
        assert found is not None
        wanted = np.stack([np.broadcast_to(x, found.shape[2:]) for x in step(s, i, b, H)])
        np.testing.assert_allclose(found[1], wanted, rtol=1e-9, atol=1e-12)


@pytest.mark.skipif(not compiled_law.compiler(), reason="no binary for this: no C compiler")
def test_what_diverges_is_not_finite():
    s, i, b = at(SHIPS["otter"], np.random.default_rng(6))
    s = s._replace(u=np.full((1, 5), 1e200))
    given, acting = (np.array([x, x]) for x in i[:2])
    found = recorded_step.compiled_states(b, s, [given, acting, None, None], H)
    assert found is not None
    assert not np.isfinite(found[2, 3]).any()


def test_without_a_compiler_numpy_predicts(monkeypatch):
    monkeypatch.setattr(compiled_law, "compiler", lambda: False)
    compiled_law._library.cache_clear()
    recorded_law.in_machine_code.cache_clear()
    s, i, b = at(SHIPS["otter"], np.random.default_rng(7))
    given, acting = (np.array([x]) for x in i[:2])
    assert recorded_step.compiled_states(b, s, [given, acting, None, None], H) is None
    compiled_law._library.cache_clear()
    recorded_law.in_machine_code.cache_clear()


def test_models_of_one_structure_share_the_recording():
    model, rng = SHIPS["otter"], np.random.default_rng(3)
    recorded_law.in_python.cache_clear()
    for drag in (-1.0, -2.0):
        s, i, b = at(model.plus({"delta_X_u": drag}), rng)
        found = recorded(b, i, single=False)(*s, *i.given, *i.acting, H)
        np.testing.assert_array_equal(found[3], step(s, i, b, H).u)
    assert recorded_law.in_python.cache_info().misses == 1
    s, i, b = at(model.plus({"V_n": 0.1}), rng)  # flows: another structure
    recorded(b, i, single=False)
    assert recorded_law.in_python.cache_info().misses == 2


@pytest.mark.parametrize("apart", [False, True])
def test_thrusters_of_a_run_have_the_same_structure_each_time(apart):
    """By the effects' identity a recording is known again; without it each prediction would record anew."""
    model = SHIPS["cse1"]
    run = sail(10.0, h=0.1)[0]
    if apart:
        layout = next(one for one in model.ship.layouts if one.apart)
        run = replace(run, commands=np.zeros((run.time.size, len(layout.commands))))
    one, other = (drive_of(run, m) for m in (model, model.plus({"delta_X_u": -1.0})))
    assert one.effects is other.effects
    assert one.effects.layout.apart is apart


def test_what_cannot_be_recorded_is_called(monkeypatch):
    def refuse(*_):
        raise TraceError

    s, i, b = at(SHIPS["otter"], np.random.default_rng(4))
    recorded_law.in_python.cache_clear()
    monkeypatch.setattr(recorded_law.Tape, "recording", refuse)
    found = recorded(b, i, single=False)(*s, *i.given, *i.acting, H)
    recorded_law.in_python.cache_clear()
    np.testing.assert_array_equal(np.array(found), np.array(step(s, i, b, H)))
