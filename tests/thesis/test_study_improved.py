"""The study of the improved controller: its measures, and the whole of it."""

import json

import numpy as np
import pytest

from fmus.controller.models import SURGE
from thesis import improved, stored_samples
from thesis.basin_trials import sysid4
from thesis.improved import IMPROVED, SURGE_ONLY, Lap, claims, surge_parts
from thesis.monte_carlo import vary


def test_truth_is_in_the_order_of_the_estimates():
    truth = {c.name: x for c, x in zip(SURGE.coefficients, sysid4.PHI, strict=True)}
    assert truth["X_u, added"] == -3.5
    assert truth["Y_r"] == 1.55
    assert truth["N_r"] == -1.8
    assert [truth[f"delta_{a}"] for a in "XYN"] == [0.3, 0.0, 0.31]


def test_parts_that_cancel_leave_nothing():
    ones = np.ones(5)
    log = {"vessel.u": 0.1 * ones, "vessel.r": 0.0 * ones, "thrusters.tau_cmd_X": 0.5 * ones}
    phi = [x * ones for x in sysid4.PHI]
    assert surge_parts(log, phi) == pytest.approx((0.0, 0.0, 0.0))
    # 1 N.s/m too little drag at 0.1 m/s is as much as a loss of thrust of 0.2 at 0.5 N.
    phi[1], phi[11] = phi[1] + 1.0, phi[11] + 0.2
    assert surge_parts(log, phi) == pytest.approx((0.1, -0.1, 0.0))


def found(own, other, alone=-0.002):
    laps = {name: [Lap(other, abs(other), 0.02, (0.4, 0.1, 0.1))] * 3 for name in improved.ORIGINALS}
    laps[improved.SURGE_ONLY] = [Lap(alone, abs(alone), 0.02, (0.4, 0.1, 0.1))] * 3
    return {"mdf": {IMPROVED: [Lap(own, abs(own), 0.01, (0.1, 0.0, 0.0))] * 3, **laps}}


@pytest.mark.parametrize(
    ("own", "other", "verdicts"),
    [
        (-0.002, -0.3, [True, True]),
        (-0.05, -0.3, [False, True]),
        (-0.002, -0.004, [False, False]),
    ],
)
def test_verdicts_follow_the_numbers(own, other, verdicts):
    assert [claim.holds for claim in claims(found(own, other))[:2]] == verdicts


@pytest.mark.parametrize(("alone", "here"), [(-0.002, True), (-0.2, False)])
def test_damping_in_surge_alone_takes_the_lag_or_not(alone, here):
    (claim,) = [c for c in claims(found(-0.002, -0.3, alone)) if c.thesis.startswith("(7.1) alone")]
    assert claim.holds is here


def test_smoothing_of_stored_samples_is_judged_by_the_axis_of_its_controller(tmp_path, monkeypatch):
    def laps(better):
        errors = {"none": 0.04, "smoothing 2": 0.02, "fixed_point 1": 0.02 if better else 0.06}
        return {
            key: [
                Lap(
                    0.0, 0.0, 0.0, tuple(errors[key.partition("|")[2]] * (1.0 + 0.01 * k) for _ in "XYN")
                )
                for k in range(3)
            ]
            for key in stored_samples.variants(60.0)
        }

    assert stored_samples.claims(laps(better=True))[0].holds is True
    worse = stored_samples.claims(laps(better=False))[0].here
    assert worse == {
        "cl_win_eps, fixed_point 1": False,
        "cl_improved, smoothing 2": True,
        "cl_improved, fixed_point 1": False,
    }
    one = {key: [Lap(0.0, 0.0, 0.0, (1.0, 2.0, 3.0))] for key in laps(better=True)}
    assert stored_samples.errors(one, stored_samples.WIN, "none") == [2.0], "sway"
    assert stored_samples.errors(one, stored_samples.IMPROVED, "none") == [1.0], "surge"
    made = stored_samples.variants(60.0)
    smoothed = made["controller_cl_improved|fixed_point 1"]["fmus"]["controller"]["parameters"]
    assert smoothed == {"smoothing": 0.0, "fixed_point": 1.0}
    assert "delta_X_u" in made["controller_cl_improved|none"]["fmus"]["vessel"]["parameters"]
    assert "delta_X_u" not in made["controller_cl_win_eps|none"]["fmus"]["vessel"]["parameters"]
    monkeypatch.setattr(stored_samples, "run_all", lambda *_: laps(better=True))
    text = stored_samples.study(tmp_path, range(3), 60.0, None).read_text("utf-8")
    assert "| controller_cl_improved | smoothing 2 | X | 0.0202 [" in text
    assert stored_samples.study(tmp_path, (), 60.0, None, again=True).read_text("utf-8") == text


@pytest.mark.slow
@pytest.mark.usefixtures("serial")
def test_improved_controller_loses_its_lag_and_the_originals_do_not(tmp_path, monkeypatch):
    variants = improved.variants

    def shorter(seconds):
        """All runs but those by the Kalman observer, whose numbers are wanted below."""
        return {
            sense: {
                c: vary(content, stop=seconds if sense == "kalman" else 2.0)
                for c, content in runs.items()
            }
            for sense, runs in variants(seconds).items()
        }

    monkeypatch.setattr(improved, "variants", shorter)
    report = improved.study(tmp_path, range(1), 70.0, None)
    laps = json.loads((tmp_path / "results.json").read_text())["laps"]["kalman"]
    size = {name: runs[0]["size"] for name, runs in laps.items()}
    assert all(size.pop(name) < 0.05 for name in (IMPROVED, SURGE_ONLY))
    assert min(size.values()) > 0.2
    pictures = [line for line in report.read_text().splitlines() if line.startswith("![")]
    assert len(pictures) == 2 * (4 + 2)
