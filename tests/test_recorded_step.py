"""A recorded step of a prediction gives the bits of the functions that it is recorded from."""

import numpy as np
import pytest

from diagnosis import Model
from diagnosis.predictors import ship_with
from diagnosis.predictors.prediction import stacked
from diagnosis.predictors.traced import recorded_step
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


def test_models_of_one_structure_share_the_recording():
    model, rng = SHIPS["otter"], np.random.default_rng(3)
    recorded_step._recorded.cache_clear()
    for drag in (-1.0, -2.0):
        s, i, b = at(model.plus({"delta_X_u": drag}), rng)
        found = recorded(b, i, single=False)(*s, *i.given, *i.acting, H)
        np.testing.assert_array_equal(found[3], step(s, i, b, H).u)
    assert recorded_step._recorded.cache_info().misses == 1
    s, i, b = at(model.plus({"V_n": 0.1}), rng)  # flows: another structure
    recorded(b, i, single=False)
    assert recorded_step._recorded.cache_info().misses == 2


def test_what_cannot_be_recorded_is_called(monkeypatch):
    def refuse(*_):
        raise TraceError

    s, i, b = at(SHIPS["otter"], np.random.default_rng(4))
    recorded_step._recorded.cache_clear()
    monkeypatch.setattr(recorded_step.Tape, "recording", refuse)
    found = recorded(b, i, single=False)(*s, *i.given, *i.acting, H)
    recorded_step._recorded.cache_clear()
    np.testing.assert_array_equal(np.array(found), np.array(step(s, i, b, H)))
