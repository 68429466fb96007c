"""Effects beside rivals that are no candidates: evidence by a dense normal density, and both ways."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

import diagnosis
from benchmarks.ship_effects import Cause, sail
from diagnosis.predictors import Model, ship_with
from diagnosis.runs import read_frame
from diagnosis.search.candidates import model_error
from diagnosis.search.rivals import (
    LinearProblem,
    held_forces,
    may_be_modulated,
    modulated_forces,
    probability_beside,
)

CANDIDATES = 60


def problem(rng, sizes, effect=0.0, rows=200):
    """A yaw-like axis: coefficients of some sizes, and an effect that is nearly their sum."""
    C = 30.0 * rng.standard_normal((rows, len(sizes)))
    E = C.sum(axis=1, keepdims=True) + 3.0 * rng.standard_normal((rows, 1))
    y = C @ sizes + E[:, 0] * effect + rng.standard_normal(rows)
    return LinearProblem(y, E, C, np.zeros(len(sizes)), float(np.log(rows)))


def probability(p, wider):
    without = p._replace(effects=p.effects[:, :0])
    present = [p.log_evidence(w, 1) for w in (np.ones_like(wider), wider)]
    return probability_beside(present, {1: [without.log_evidence(wider, 0)]}, 1 / CANDIDATES)


def test_evidence_of_coefficients_is_their_normal_density():
    rng = np.random.default_rng(1)
    C, y, offset = rng.standard_normal((30, 4)), rng.standard_normal(30), rng.standard_normal(4)
    p = LinearProblem(y, np.zeros((30, 0)), C, offset, 3.0)

    def density(wider):
        return multivariate_normal.logpdf(y, -C @ offset, np.eye(30) + (C * wider**2) @ C.T)

    wider, ones = np.array([1.0, 3.0, 0.5, 10.0]), np.ones(4)
    differs = p.log_evidence(wider, 0) - p.log_evidence(ones, 0)
    assert differs == pytest.approx(density(wider) - density(ones), rel=1e-6)


def test_the_evidence_of_a_further_column_is_that_of_all_rows():
    rng = np.random.default_rng(3)
    p, others = problem(rng, np.array([1.0, -2.0, 0.5])), rng.standard_normal((200, 4))
    for wider in (np.ones(3), np.array([2.0, 5.0, 0.3])):
        found = [each.log_evidence(wider, 2) for each in p.beside(others)]
        whole = [p._replace(effects=np.column_stack([p.effects, c])) for c in others.T]
        assert found == pytest.approx([each.log_evidence(wider, 2) for each in whole], abs=1e-6)
    assert max(each.y.size for each in p.beside(others)) <= 9


def test_an_effect_has_the_prior_of_one_sample():
    """A prior far wider than the data, brought to the information of one of n samples."""
    rng = np.random.default_rng(2)
    E, C, y = rng.standard_normal((50, 1)), rng.standard_normal((50, 3)), rng.standard_normal(50)
    p, far, ones = LinearProblem(y, E, C, np.zeros(3), float(np.log(50))), 1e3, np.ones(3)
    wide = multivariate_normal.logpdf(y, np.zeros(50), np.eye(50) + C @ C.T + far**2 * E @ E.T)
    alone = multivariate_normal.logpdf(y, np.zeros(50), np.eye(50) + C @ C.T)
    unit_information = np.log(far) + 0.5 * np.log(float((E.T @ E).item()) / 50)
    without = p._replace(effects=E[:, :0])
    gained = p.log_evidence(ones, 1) - without.log_evidence(ones, 0)
    assert gained == pytest.approx(wide - alone + unit_information, abs=1e-4)


def test_coefficients_off_by_what_is_stated_are_no_effect():
    """All of them off by several tenths, alike: an effect imitates that, and is not sure."""
    found = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        found.append(probability(problem(rng, 5.0 * rng.standard_normal(4)), np.full(4, 5.0)))
    assert max(found) < 0.8
    assert np.mean(found) < 0.2


def test_an_effect_beside_coefficients_that_are_right_within_a_tenth_stays():
    found = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        found.append(probability(problem(rng, rng.standard_normal(4), effect=6.0), np.full(4, 5.0)))
    assert min(found) > 0.5
    assert np.mean(found) > 0.9


def test_more_candidates_make_each_less_likely():
    present, absent = [-10.0], {1: [-15.0]}
    few, many = (probability_beside(present, absent, 1 / n) for n in (1, 100))
    assert few == pytest.approx(1 / (1 + np.exp(-5.0)))
    assert many == pytest.approx(1 / (1 + 100 * np.exp(-5.0)))


@pytest.fixture(scope="module")
def otter():
    """The ship, and windows of a run under the commands of two propellers."""
    model = Model(ship=ship_with((), "otter"))
    frame = sail(model.ship, Cause("", {}, {}), np.random.default_rng(5), None, seconds=60.0)
    return model, frame, diagnosis.gather([read_frame(frame, "run", model.ship)], model=model)


def test_a_modulated_force_is_that_of_one_actuator_times_another_channel(otter):
    model, _, data = otter
    found = dict(modulated_forces(data, model))
    lost = model_error(data, model) - model_error(data, model.plus({"loss_port": 1.0}))
    (w,) = data
    command = w.held @ np.abs(w.run.commands[:, 1])
    name = "the force of the port propeller in proportion to"
    assert found[f"{name} starboard.n"] == pytest.approx(lost * command[:, None])
    assert found[f"{name} |r|"] == pytest.approx(
        lost * (w.smooth @ np.abs(w.smoothed.nu[:, 2]))[:, None]
    )
    assert f"{name} port.n" not in found, "that is a curve over its own command"
    assert len(found) == 6


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_the_command_of_a_twin_is_an_actuator_s_own(otter, noise):
    """But for noise, with which a log may have both."""
    model, _, (w,) = otter
    rng = np.random.default_rng(1)
    port, starboard = (w.run.commands[:, [0]] * (1.0 + noise * rng.standard_normal((len(w.run.time), 1))) for _ in "ab")  # fmt: skip
    twins = w.commanded_as(w.run.with_given(np.hstack([port, starboard])))
    found = [name for name, _ in modulated_forces([twins], model)]
    assert len(found) == 4
    assert all(name.endswith(("|v|", "|r|")) for name in found)


def test_a_held_force_is_that_of_a_constant_command_in_the_intervals_of_an_outage(otter):
    model, _, (w,) = otter
    times = {"port_outage_start_1": 20.0, "port_outage_end_1": 40.0}
    (force,) = held_forces([w], model.plus(times), model.ship.effects["port_outage"])
    before, inside = w.middle < 18.0, (w.middle > 28.0) & (w.middle < 38.0)  # lags of 1 s are over
    assert np.abs(force[before]).max() == 0.0
    n = float(np.sqrt(np.mean(w.run.commands[:, 0] ** 2)))
    (port,) = [a for a in model.ship.description.actuators if a.name == "port"]
    thrust = port.number("k_ahead") * n * n
    expected = thrust * np.array([1.0, 0.0, -port.number("y")])
    assert force[inside] == pytest.approx(np.tile(expected, (inside.sum(), 1)), rel=1e-3, abs=1e-9)
    for run in (replace(w.run, commands=None), replace(w.run, signals=("a", "b"))):
        assert (
            held_forces([w, w.commanded_as(run)], model.plus(times), model.ship.effects["port_outage"])
            == []
        )


@pytest.mark.parametrize("held", [0.0, 0.3])
def test_an_outage_is_likelier_than_a_held_command_only_where_that_is_near_zero(held):
    rng = np.random.default_rng(4)
    force = np.zeros((200, 1))
    force[50:100] = 10.0  # of the usual command, in units of the noise
    y = held * force[:, 0] + rng.standard_normal(200)
    p = LinearProblem(y, np.zeros((200, 0)), rng.standard_normal((200, 2)), np.zeros(2), np.log(200.0))
    wider = np.ones(2)
    other = p.also_uncertain(force).log_evidence(np.ones(3), 0)
    density = [
        multivariate_normal.logpdf(y, None, np.eye(200) + p.coefficients @ p.coefficients.T + V)
        for V in (0.0, force @ force.T)
    ]
    assert other - p.log_evidence(wider, 0) == pytest.approx(density[1] - density[0], rel=1e-6)
    outage = probability_beside([p.log_evidence(wider, 0)], {0: [other]})
    assert outage < 0.01 if held else outage > 0.95


def test_without_commands_of_actuators_there_is_no_modulated_force(otter):
    model, _, (w,) = otter
    for run in (replace(w.run, commands=None), replace(w.run, signals=("a", "b"))):
        assert [*modulated_forces([w, w.commanded_as(run)], model)] == []


def test_a_constant_loss_is_no_modulation(otter):
    effects = otter[0].ship.effects
    changed = {i for i, e in effects.items() if may_be_modulated(e)}
    assert {"port_speed_loss", "curve_port(n)", "saturation_port", "N_|r|r"} <= changed
    assert changed.isdisjoint({"loss_port", "loss_surge", "current", "mass"})


@pytest.mark.parametrize("truth", ["curve", "modulation"])
def test_a_curve_over_a_command_is_sure_only_if_no_other_channel_does_as_well(truth):
    """Nodes of a curve over one command, of which another one follows; the force is lost with either."""
    found = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        own = rng.choice([0.8, 0.9, 1.0], 300)  # three sizes are ordered, the other with some scatter
        other = np.interp(own, [0.8, 0.9, 1.0], [0.9, 1.2, 2.0]) * (1.0 + 0.1 * rng.standard_normal(300))
        nodes = np.stack([np.isclose(own, x) * own for x in (0.8, 0.9, 1.0)], axis=1)
        force = own * (
            other if truth == "modulation" else np.interp(own, [0.8, 0.9, 1.0], [1.0, 0.2, 2.0])
        )
        y = 5.0 * force + rng.standard_normal(300)
        coefficients = rng.standard_normal((300, 2))
        p = LinearProblem(y, 10.0 * nodes, coefficients, np.zeros(2), float(np.log(300)))
        rivals = [
            p._replace(effects=10.0 * (own * z)[:, None])
            for z in (other, np.abs(rng.standard_normal(300)))
        ]
        ones = np.ones(2)
        present = [p.log_evidence(ones, 3)]
        found.append(probability_beside(present, {0: [r.log_evidence(ones, 1) for r in rivals]}))
    assert max(found) < 0.01 if truth == "modulation" else min(found) > 0.99
