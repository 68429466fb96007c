"""The study of chapter 5: the numbers of a run that was made up, and what its conditions change."""

import numpy as np
import pytest

from cosim.dispatch import FinishedRun
from thesis import chapter5
from thesis.tracking.outcome import BROKEN, PHI, outcome
from thesis.tracking.verdict import CONTROLLERS, FOUR

METRICS = {"from": 20.0, "cross_track_rms": 0.3, "heading_rms": 0.4, "IAEW": 5.0, "IAEWWT": 6.0}


def log(**changes):
    """A run of 100 s that is wrong by 1 m and in all else without error, after a wild start."""
    t = np.arange(0.0, 100.01, 0.1)
    zero = np.zeros_like(t)
    names = ("vessel.x", "vessel.y", "vessel.v", "vessel.r", "guidance.x_t", "guidance.y_t")
    names += ("guidance.psi_t",)
    names += ("controller.z1_x", "controller.tau_N", *chapter5.LEARNED_FROM)
    found = {"time": t, **{name: zero.copy() for name in names}}
    found["vessel.x"] = np.where(t < METRICS["from"], 50.0, 1.0)
    return found | {name: zero + value for name, value in changes.items()}


def numbers(**changes):
    made = log(**{name.replace("__", "."): value for name, value in changes.items()})
    return outcome(FinishedRun({}, metrics=METRICS, log=made)), made["time"]


def test_a_run_that_broke_off_has_no_numbers():
    found = outcome(FinishedRun({}, status="failed"))
    assert found is BROKEN
    assert not found.done
    assert np.isnan(found[1:-1]).all()


def test_the_start_is_left_out_and_the_metrics_are_those_of_the_run():
    found, _ = numbers()
    assert found.done
    assert (found.start, found.cross_track, found.heading) == (20.0, 0.3, 0.4)
    assert (found.iaew, found.iaewwt) == (5.0, 6.0)
    assert found.position == pytest.approx(1.0)
    assert found.second == pytest.approx(1.0)


def test_distance_to_the_target_has_both_directions_and_its_second_half():
    _, t = numbers()
    found, _ = numbers(guidance__x_t=4.0, guidance__y_t=np.where(t < 50.0, 4.0, 0.0))
    assert found.second == pytest.approx(3.0)
    early, late = (t >= 20.0) & (t < 50.0), t >= 50.0
    mean = (25.0 * early.sum() + 9.0 * late.sum()) / (early.sum() + late.sum())
    assert found.position == pytest.approx(np.sqrt(mean))


@pytest.mark.parametrize("axis", "XYN")
def test_thrust_that_is_lost_belongs_to_the_model_error(axis):
    """(7.7): hidden -1 and 0.5 of the command lost make -1.5, so that an estimate of -1.2 is wrong by 0.3."""
    found, _ = numbers(
        **{
            f"vessel__omega_star_{axis}": -1.0,
            f"thrusters__tau_cmd_{axis}": 2.0,
            f"thrusters__tau_act_{axis}": 1.5,
            f"controller__omega_hat_{axis}": -1.2,
        }
    )
    wrong = {"X": found.omega_X, "Y": found.omega_Y, "N": found.omega_N}
    assert wrong.pop(axis) == pytest.approx(0.3)
    assert list(wrong.values()) == [0.0, 0.0]
    assert found.omega == found.omega_Y
    assert found.omega_hat_X == pytest.approx(-1.2 if axis == "X" else 0.0)


def test_estimates_are_those_of_the_second_half_and_none_without_adaptation():
    _, t = numbers()
    late = np.where(t < 50.0, 7.0, 2.0)
    found, _ = numbers(controller__z1_x=-late, **{name.replace(".", "__"): late for name in PHI})
    assert found.surge == pytest.approx(-2.0)
    assert found.phi == pytest.approx((2.0,) * len(PHI))
    assert numbers()[0].phi == ()


def test_store_is_judged_where_there_is_one():
    _, t = numbers()
    assert np.isnan([numbers()[0].sigma, numbers()[0].rank]).all()
    found, _ = numbers(
        controller__sigma_min=np.where(t < 99.95, 9.0, 0.5),
        controller__rank_met=np.where(t < 60.0, 1.0, 0.0),
    )
    assert found.sigma == 0.5, "at the end"
    assert found.rank == pytest.approx(0.5, abs=0.01), "40 of the 80 s that count"


def test_swing_is_what_is_quicker_than_half_a_hertz():
    _, t = numbers()
    slow, fast = np.sin(2.0 * np.pi * 0.05 * t), np.sin(2.0 * np.pi * 2.0 * t)
    assert numbers(controller__tau_N=3.0 * slow)[0].swing < 0.01
    assert numbers(controller__tau_N=slow + 3.0 * fast)[0].swing == pytest.approx(
        3.0 / np.sqrt(2.0), rel=0.02
    )


def test_signs_of_sway_and_yaw():
    _, t = numbers()
    for r, mean in ((0.2, 1.0), (-0.2, -1.0), (np.where(t < 40.0, 0.2, -0.2), -0.5)):
        found, _ = numbers(vessel__v=0.1, vessel__r=r)
        assert found.signs == pytest.approx(mean, abs=0.01)
        assert found.sway == pytest.approx(0.1)


def test_conditions_differ_in_what_they_say():
    made = chapter5.variants("ellipse", 40.0)
    assert set(made["mdf"]) == set(made["kalman"]) == set(made["true"]) == set(CONTROLLERS)
    for condition, by_controller in made.items():
        if condition not in ("mdf", "kalman", "true"):
            assert set(by_controller) == set(FOUR), condition
        for name, content in by_controller.items():
            fmus = content["fmus"]
            assert content["stop"] == 40.0
            assert fmus["controller"]["path"] == f"{name}.fmu"
            assert ("sigma" in str(content["log"])) == ("_cl_" in name)
            assert ("phi_hat" in str(content["log"])) == (name != "controller_bs")
            true = ["vessel.u", "controller.u_hat"] in content["connections"]
            assert true == condition.startswith("true") == (content["faults"] == [])
            assert (fmus["observer"]["path"] == "observer_kalman.fmu") == (condition == "kalman")
            given = fmus["controller"].get("parameters", {})
            assert ("stale" in given) == ("stale" in condition)
            assert (given.get("store_weight") == 0.1) == condition.endswith("0.1")
            assert ("tau_max" in given) == ("," in condition)
            untold = any(word in condition for word in ("request", "stale"))
            assert (content.get("optional_connections") == []) == untold


@pytest.mark.parametrize(
    ("condition", "count"),
    [("mdf", 5), ("kalman", 5), ("true", 1), ("true, stale", 1), ("mdf, stale", 3), ("mdf, ungated", 3)],
)
def test_seeds_of_a_condition(condition, count):
    assert list(chapter5.seeds_of(condition, range(5))) == list(range(count))


def test_side_of_the_path_bias_forces_and_agreement():
    """A ship 0.1 m inside of a circle that turns to starboard; the estimate in yaw has the wrong sign."""
    t = np.arange(0.0, 100.01, 0.1)
    angle = 0.05 * t
    circle = {"guidance.x_t": 2.0 * np.sin(angle), "guidance.y_t": -2.0 * np.cos(angle)}
    inner = {"vessel.x": 1.9 * np.sin(angle), "vessel.y": -1.9 * np.cos(angle)}
    force = {"controller.tau_lin_X": 3.0, "controller.tau_lin_N": 4.0, "controller.tau_nonlin_Y": -2.0}
    learned = {"vessel.omega_star_N": np.sin(t), "controller.omega_hat_N": -0.5 * np.sin(t)}
    made = log(**circle, **inner, **force, **learned, **{"guidance.psi_t": angle})
    found = outcome(FinishedRun({}, metrics=METRICS, log=made))
    assert found.inside == pytest.approx(0.1, abs=1e-3)
    assert found.bias == pytest.approx(0.1), "to starboard, which is inside"
    assert found.end == pytest.approx(0.1)
    assert (found.linear, found.nonlinear) == pytest.approx((5.0, 2.0))
    assert found.agree_N == pytest.approx(-1.0)
    assert np.isnan(found.agree_Y), "there is none in sway"
