"""The thesis' analysis of runs: SysID by concurrent learning, models in the plant, the three commands."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from support.command import command
from support.cse1 import VESSEL as COMPONENT
from support.measured import csv_of, sail, smoothed

from cosim import InputError
from diagnosis.assessment import least_dissipation
from diagnosis.predictors import Model, omega, read_model, weak_windows
from diagnosis.report.formatting import number
from fmus.base_units import base_exponents
from fmus.declare import variables
from fmus.effects import STANDARD
from fmus.effects.linear_map import AXES, REGRESSORS, parameter, regressors
from fmus.hull import RotationalDamping
from fmus.signals import Force
from fmus.vessel.vessel import State
from thesis.analysis import concurrent_passes as cp
from thesis.analysis import into_the_plant as plant
from thesis.analysis.samples import Samples, by_run, gather_samples, joined, model_error
from thesis.analysis.sysid_report import warnings
from thesis.analysis.table_7_1 import NAMES, TABLE_7_1, row
from thesis.analysis.table_7_1 import plant as plant_of
from thesis.basin_trials import sysid4
from thesis.pca import main as pca
from thesis.pls import main as pls
from thesis.sysid import main as sysid

MAP = STANDARD["linear_map"]


def with_values(values):
    return Model(vessel=values).hull


class TestLinearMap:
    def test_units_of_coefficient_times_regressor_are_a_force_or_a_moment(self):
        units = {p.name: p.unit for p in MAP.parameters}
        for axis in AXES:
            force = base_exponents("N.m" if axis == "N" else "N")
            for name, unit in REGRESSORS.items():
                total = dict(base_exponents(unit))
                for base, power in base_exponents(units[parameter(axis, name)]).items():
                    total[base] = total.get(base, 0) + power
                # A radian is a number, so that a yaw rate times a lever is a velocity.
                found = {k: v for k, v in total.items() if v and k != "rad"}
                assert found == force, (axis, name)

    def test_model_error_of_the_vessel_is_the_map_of_velocity_and_force(self):
        rng = np.random.default_rng(1)
        values = {p.name: rng.normal() for p in MAP.parameters}
        s, tau = State(0.0, 0.0, 0.3, 0.2, -0.1, 0.15, 0.0), Force(0.5, -0.3, 0.2)
        _, out = COMPONENT.prepared_step(s, tau, with_values(values), 0.0)
        x = np.array(regressors(s.u, s.v, s.r, tau))
        expected = [
            sum(values[parameter(a, n)] * v for n, v in zip(REGRESSORS, x, strict=True)) for a in AXES
        ]
        assert [out.omega_X, out.omega_Y, out.omega_N] == pytest.approx(expected)

    def test_loss_of_thrust_is_a_map_of_the_force(self):
        """(I + B_tau) tau: half of the force lost by the map moves the ship as half of the force."""
        values = {parameter(a, f"tau_{a}"): -0.5 for a in AXES}
        s, tau = State(u=0.1, r=0.05), Force(0.6, -0.4, 0.3)
        lost, _ = COMPONENT.prepared_step(s, tau, with_values(values), 0.02)
        half, _ = COMPONENT.prepared_step(s, Force(*(0.5 * x for x in tau)), with_values({}), 0.02)
        assert tuple(lost) == pytest.approx(tuple(half), rel=1e-12)

    def test_diagnosis_sees_the_part_of_the_force(self):
        """The model error of a measured run is the same by a loss of the thrusters and by the map."""
        run, _ = sail(32.0, h=0.05)
        w = weak_windows(smoothed(run))
        by_map = Model(vessel={parameter("X", "tau_X"): -0.3, parameter("N", "tau_N"): -0.2})
        by_loss = Model(thrusters={"loss_surge": 0.3, "loss_yaw": 0.2})
        assert omega(w, by_map) == pytest.approx(omega(w, by_loss), abs=1e-9)
        assert np.abs(omega(w, by_map) - omega(w, Model())).max() > 0.05

    def test_it_is_no_candidate(self):
        assert MAP.search.by == "given"


class TestIntoThePlant:
    def test_plant_has_the_model_error_of_the_regression(self):
        """omega relative to (2.27): the rotational damping of Table 2.1 must not count twice."""
        rng = np.random.default_rng(2)
        columns = ["u", "v", "r", "tau_X", "tau_Y", "tau_N", "|u|u", "|r|v"]
        c, B = rng.normal(size=3), rng.normal(size=(3, 8))
        model = plant.as_model(c, B, columns)
        s, tau = State(u=0.1, v=0.04, r=-0.2), Force(0.3, 0.2, -0.1)
        _, out = COMPONENT.prepared_step(s, tau, model.hull, 0.0)
        nu_dot = np.array([[out.u_dot, out.v_dot, out.r_dot]])
        found = model_error(np.array([[s.u, s.v, s.r]]), nu_dot, np.array([tau]))
        x = [s.u, s.v, s.r, *tau, abs(s.u) * s.u, abs(s.r) * s.v]
        assert found[0] == pytest.approx(c + B @ x)
        assert [out.omega_star_X, out.omega_star_Y, out.omega_star_N] == pytest.approx(found[0])

    def test_columns_that_the_plant_lacks_are_known(self):
        assert plant.goes_into_the_plant(["u", "tau_X", "|v|r"])
        assert not plant.goes_into_the_plant(["u", "|tau_X|tau_Y"])

    def test_criterion(self):
        assert plant.effective_thrust(np.zeros((3, 3))).least == pytest.approx(1.0)
        reversed_ = plant.effective_thrust(np.diag([-1.2, 0.0, 0.0]))
        assert not reversed_.holds
        assert "reverses" in reversed_.sentence
        # All eigenvalues are one, and yet a force acts backwards: only the symmetric part shows it.
        skewed = plant.effective_thrust(np.array([[0.0, 5.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
        assert skewed.eigenvalues.real == pytest.approx(1.0)
        assert not skewed.holds
        assert "against" in skewed.sentence


def made(phi, n=4000, seed=0, pairs=1.0):
    """Samples of a ship with these coefficients, in rich motion; ``pairs`` = -1: |r|v = -|v|r."""
    rng = np.random.default_rng(seed)
    t = 0.05 * np.arange(n)

    def wave(size, k):
        return size * sum(np.sin((0.2 + 0.13 * j * k) * t + rng.uniform(0, 6)) for j in range(1, 5)) / 2

    nu = np.column_stack([0.08 + wave(0.06, 1.0), wave(0.04, 1.3), wave(0.15, 0.7)])
    if pairs < 0.0:
        nu[:, 1] = -np.sign(nu[:, 2]) * np.abs(nu[:, 1])
    tau = np.column_stack([wave(0.6, 1.7), wave(0.8, 0.9), wave(0.4, 1.1)])
    s = Samples(np.full(n, "made", dtype=object), t, nu, 0.0 * nu, tau, 0.0 * nu)
    return Samples(s.run, t, nu, s.nu_dot, tau, cp.regressors(s) @ phi)


class TestPasses:
    def test_coefficients_are_found_in_rich_motion(self):
        phi = row("SYSID4")
        found = cp.identify([made(phi)])
        assert found.settled
        assert found.least_squares == pytest.approx(phi, abs=1e-6)
        assert found.ridge == pytest.approx(phi, abs=1e-2)
        assert cp.explained([made(phi, seed=1)], found.phi) == pytest.approx(1.0, abs=0.02)
        assert found.phi[-3:] == pytest.approx(phi[-3:], abs=0.05)

    def test_a_pass_never_moves_away_from_the_truth_of_data_without_noise(self):
        phi = row("SYSID3")
        m = cp.material(made(phi, n=600))
        now = np.zeros(14)
        weights = 1.0 / cp.GAMMA
        for _ in range(3):
            after = cp.one_pass(now, m)
            assert np.sum(weights * (after - phi) ** 2) < np.sum(weights * (now - phi) ** 2)
            now = after

    def test_products_that_cannot_be_told_apart_are_told(self):
        s = made(row("SYSID4"), n=800, pairs=-1.0)
        found = cp.identify([s])
        said = " ".join(warnings(found, [s]))
        assert "|r|v = −|v|r" in said
        condition = number(found.condition[1], 2)
        assert re.search(
            rf"Y: condition number {re.escape(condition)}; .* discriminate .*Y_absr_v", said
        )
        assert found.condition[1] > 1e6
        rich = made(row("SYSID4"), n=800)
        assert "|r|v =" not in " ".join(warnings(cp.identify([rich]), [rich]))

    def test_pass_is_that_of_7_10_with_the_last_twenty_stored_samples(self):
        """Written out from the equations, so that window, order and gain must be these."""
        m = cp.material(made(row("SYSID2"), n=3000))
        stored, phi = [], np.zeros(14)
        for k in range(m.dt.size):
            if m.stored[k]:
                stored = [*stored, k][-20:]
            if m.dt[k] > 0.0:
                slope = m.F[k].T @ (m.y[k] - m.F[k] @ phi)
                Q = m.F[k].T @ m.F[k]
                for j in stored:
                    slope = slope + m.F[j].T @ (m.y[j] - m.F[j] @ phi)
                    Q = Q + m.F[j].T @ m.F[j]
                pace = m.dt[k] / max(1.0, m.dt[k] * np.trace(np.diag(cp.GAMMA) @ Q))
                phi = phi + pace * cp.GAMMA * slope
        assert len(stored) == 20 < m.stored.sum()
        assert cp.one_pass(np.zeros(14), m) == pytest.approx(phi, rel=1e-9, abs=1e-12)

    def test_large_regressors_do_not_make_a_pass_diverge(self):
        phi = row("SYSID3")
        m = cp.material(made(phi, n=600))
        large = replace(m, F=30.0 * m.F, y=30.0 * m.y)
        now = cp.one_pass(np.zeros(14), large)
        assert np.sum((now - phi) ** 2 / cp.GAMMA) < np.sum(phi**2 / cp.GAMMA)

    def test_share_of_a_column_that_is_its_own_is_the_sine_of_its_angle(self):
        a, b = 0.3, np.array([np.cos(0.3), np.sin(0.3), 0.0])
        A = np.column_stack([5.0 * np.eye(3)[0], 0.1 * b, 2.0 * np.eye(3)[2]])
        condition, own = cp.separability(A)
        assert own == pytest.approx([np.sin(a), np.sin(a), 1.0])
        assert condition == pytest.approx(np.sqrt((1.0 + np.cos(a)) / (1.0 - np.cos(a))))
        assert cp.separability(A)[0] == pytest.approx(cp.separability(A * [7.0, 1.0, 0.2])[0])
        condition, own = cp.separability(np.column_stack([A, np.zeros(3)]))
        assert condition == np.inf
        assert own.tolist() == [0.0] * 4

    def test_a_penalty_shrinks_alike_in_any_unit(self):
        rng = np.random.default_rng(2)
        A, y = rng.normal(size=(200, 3)), rng.normal(size=200)
        assert cp.penalised(A, y, 0.0) == pytest.approx(np.linalg.lstsq(A, y, rcond=None)[0])
        units = np.array([1e3, 1.0, 1e-3])
        assert cp.penalised(A * units, y, 0.3) * units == pytest.approx(cp.penalised(A, y, 0.3))
        assert cp.penalised(np.tile(A, (5, 1)), np.tile(y, 5), 0.3) == pytest.approx(
            cp.penalised(A, y, 0.3)
        )
        B, _ = np.linalg.qr(rng.normal(size=(200, 3)))
        assert cp.penalised(B, y, 1.0) == pytest.approx(0.5 * B.T @ y), "of columns that are orthogonal"

    def test_ridge_takes_the_penalty_that_predicts_blocks_left_out(self):
        rng = np.random.default_rng(4)
        A = rng.normal(size=(400, 1)) + 0.03 * rng.normal(size=(400, 4))
        clean = A @ [1.0, -2.0, 3.0, 1.0]
        assert cp.by_ridge(A, clean) == pytest.approx([1.0, -2.0, 3.0, 1.0], rel=1e-3)
        noisy = clean + 5.0 * rng.normal(size=400)
        chosen = cp.by_ridge(A, noisy)
        assert np.linalg.norm(chosen) < 0.5 * np.linalg.norm(np.linalg.lstsq(A, noisy, rcond=None)[0])
        assert any(np.allclose(chosen, cp.penalised(A, noisy, x)) for x in cp.RIDGE)

    def test_explained_share_is_about_the_mean_of_each_run(self):
        s = made(row("SYSID2"), n=600)
        assert cp.explained([s, s], row("SYSID2")) == pytest.approx([1.0] * 3)
        none = cp.explained([s], np.zeros(14))
        omega = cp.thinned(s).omega
        assert none == pytest.approx(-(omega.mean(axis=0) ** 2) / omega.var(axis=0))

    def test_nothing_is_learned_over_a_long_gap(self):
        s = made(row("SYSID2"), n=600)
        late = replace(s, time=s.time + np.where(np.arange(s.time.size) >= 300, 5.0, 0.0))
        dt = cp.material(late).dt
        whole = cp.material(s).dt
        assert dt.sum() == pytest.approx(whole.sum() - cp.EVERY, abs=2.0 * cp.EVERY)
        assert dt.max() < cp.GAP

    def test_limits_from_the_data_keep_the_bulk_and_block_what_stands_out(self):
        s = made(row("SYSID4"), n=1000)
        s.nu_dot[:] = 0.008 * np.random.default_rng(3).normal(size=(1000, 3))
        s.nu_dot[500] = 0.1
        s.tau[:] *= 0.2
        given, found = cp.allowed(s), cp.allowed(s, cp.fences([s]))
        assert given.all(), "0.2 m/s2 is far more than this ship's acceleration"
        assert not found[500:521].any()
        assert found[:500].all()
        assert found[522:].all()
        scaled = replace(s, nu_dot=10.0 * s.nu_dot)
        assert (cp.allowed(scaled, cp.fences([scaled])) == found).all()

    def test_joined_runs_are_refused_and_taken_by_themselves(self):
        a, b = made(row("SYSID4"), n=700), replace(made(row("SYSID4"), n=700, seed=1))
        b.run[:] = "other"
        both = joined([a, b])
        for use in (cp.thinned, cp.material, lambda s: cp.identify([s]), lambda s: cp.explained([s], a)):
            with pytest.raises(ValueError, match="time decreases"):
                use(both)
        one, two = by_run(both)
        assert [s.names for s in (one, two)] == [["made"], ["other"]]
        assert (one.time == a.time).all()
        b.run[:] = "made"
        assert [s.time.size for s in by_run(joined([a, b]))] == [700, 700], "of one name, as logs/0 are"
        found = cp.identify([one, two])
        assert found.passed == pytest.approx([1.0, 1.0], abs=0.01)

    def test_nothing_is_learned_for_a_second_after_a_spike(self):
        s = made(row("SYSID4"), n=400)
        s.tau[100] = 10.0
        beta = cp.allowed(s)
        assert not beta[100:121].any()
        assert beta[99]
        assert beta[122]


# Table 7.1 as it is printed.
PRINTED = """
[-0.3, -6.5,-0.025, 0 0 0 0 -1.44, -2.7, 1.4, 8.2] [0, 0, 0]
[-0.30,-4.0,0.225,0,0.38,0,0.067,0.02,-1.7,-0.02,-0.23] [0.36, 0, 0.23]
[-0.33,-4.6,0.27,-0.015,1.7,0.02,0.2,0.02,-2.3,-0.026,-0.26] [0.11, 0, 0.18]
[-0.26,-3.5,0.2,-0.014,1.55,0.017,0.2,0.017,-1.8,-0.02,-0.2] [0.3, 0, 0.31]
"""


def test_rows_of_table_7_1_are_the_printed_ones_in_the_order_of_7_2():
    printed = [[float(x) for x in re.findall(r"-?[\d.]+", line)] for line in PRINTED.split("\n")[1:-1]]
    assert [list(x) for x in TABLE_7_1.values()] == printed
    assert NAMES[:3] == ("X_absu_u", "X_u", "X_absu_r")
    assert NAMES[3:11] == tuple(RotationalDamping._fields)
    assert NAMES[11:] == ("delta_X", "delta_Y", "delta_N")


def test_rows_of_table_7_1_are_ships():
    assert list(TABLE_7_1) == ["SYSID1", "SYSID2", "SYSID3", "SYSID4"]
    for name in TABLE_7_1:
        phi = row(name)
        s = made(phi, n=50)
        model = plant_of(phi)
        for k in range(0, 50, 10):
            _, out = COMPONENT.prepared_step(
                State(u=s.nu[k, 0], v=s.nu[k, 1], r=s.nu[k, 2]), Force(*s.tau[k]), model.hull, 0.0
            )
            star = [out.omega_star_X, out.omega_star_Y, out.omega_star_N]
            assert star == pytest.approx(s.omega[k], abs=1e-9)
    assert row("SYSID4") == pytest.approx(sysid4.PHI)
    with pytest.raises(InputError, match=r"no recipe 'SYSID5'.*SYSID1"):
        row("SYSID5")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two measured runs of a ship with more drag and lost thrust, and one that is too short."""
    folder = tmp_path_factory.mktemp("runs")
    for name, seconds in (("a", 48.0), ("b", 32.0), ("short", 12.0)):
        run, _ = sail(
            seconds,
            h=0.05,
            noise=0.2,
            seed=ord(name[0]),
            ship={"delta_X_u": -3.0},
            thrusters={"loss_yaw": 0.2},
        )
        csv_of(run, folder / f"{name}.csv")
    return folder


def test_acceleration_in_a_steady_turn_is_none_and_the_force_that_of_both_steps(tmp_path):
    """Body-fixed velocities do not change in a steady turn, though the earth-fixed ones do all the time."""
    t = 0.05 * np.arange(1200)
    u, v, r = 0.3, 0.1, 0.4
    psi = r * t
    x = (u * np.sin(psi) + v * np.cos(psi)) / r
    y = (-u * np.cos(psi) + v * np.sin(psi)) / r
    tau = np.column_stack([np.where(np.arange(t.size) % 2, k, -0.01) for k in (0.0, 0.005, 0.02)])
    tau *= 1.0 + t[:, None] / 60.0  # so that its mean over the run is none of its values
    pose = np.column_stack([x, y, np.angle(np.exp(1j * psi))])
    pose += 2e-4 * np.random.default_rng(0).normal(size=pose.shape)
    columns = ["time", "x", "y", "psi", "tau_X", "tau_Y", "tau_N"]
    pd.DataFrame(np.column_stack([t, pose, tau]), columns=columns).to_csv(
        tmp_path / "t.csv", index=False
    )
    (s,) = gather_samples([tmp_path / "t.csv"], "smoothed")
    middle = (s.time > 5.0) & (s.time < 55.0)
    assert s.nu[middle].mean(axis=0) == pytest.approx([u, v, r], abs=5e-3)
    assert np.abs(s.nu_dot[middle].mean(axis=0)).max() < 0.2 * min(r * v, r * u)
    rows = np.round(s.time / 0.05).astype(int)[1:]
    assert s.tau[1:] == pytest.approx(0.5 * (tau[rows] + tau[rows - 1]))
    assert np.abs(tau[rows] - tau[rows - 1]).min() > 0.009, "either step alone would be another force"


def test_both_estimates_of_velocity_are_those_of_the_run(runs):
    (smooth,) = gather_samples([runs / "a.csv"], "smoothed")
    (filtered,) = gather_samples([runs / "a.csv"], "mdf")
    assert filtered.time[0] >= 5.0
    both = np.isin(smooth.time, filtered.time)
    rest = np.isin(filtered.time, smooth.time)
    assert np.corrcoef(smooth.nu[both, 2], filtered.nu[rest, 2])[0, 1] > 0.95


@pytest.mark.slow
def test_pca_writes_its_results(runs, tmp_path):
    done = command(pca, runs / "a.csv", runs / "b.csv", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "pca.json").read_text())
    assert {"explained", "q2", "t2_limit", "q_limit", "removed"} <= set(found)
    assert found["explained"][-1] == pytest.approx(1.0)
    assert found["removed_share"] == pytest.approx(
        sum(r["samples"] for r in found["removed"]) / found["samples"]
    )
    page = (tmp_path / "report.html").read_text()
    assert page.count("<svg") >= 5
    assert "http:" not in page.replace("http://www.w3.org", "")
    assert "https:" not in page


@pytest.mark.slow
def test_pls_writes_its_results_and_a_model_of_the_plant(runs, tmp_path):
    done = command(pls, runs / "a.csv", runs / "b.csv", "--recipe", "PLS4", "--ssv", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "pls.json").read_text())
    assert set(found["factors"]) == set(found["r2"]) == set(found["q2"]) == set(AXES)
    u = found["coefficients"]["X"]["u"]
    assert set(u) == {"value", "std", "sign_changes"}
    model = read_model(tmp_path / "model.ssv")
    assert model.vessel["map_X_u"] == pytest.approx(u["value"])
    assert model.vessel["delta_Y_r"] == 7.25
    assert "<svg" in (tmp_path / "report.html").read_text()


@pytest.mark.slow
def test_pls_writes_the_nearest_stable_model(runs, tmp_path):
    done = command(
        pls, runs / "a.csv", runs / "b.csv", "--recipe", "PLS2", "--stable", "--out", tmp_path
    )
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "pls.json").read_text())["stable"]
    model = read_model(tmp_path / "model.ssv")
    assert model.vessel["map_X_tau_X"] == pytest.approx(found["coefficients"]["X"]["tau_X"])
    assert least_dissipation(model) >= least_dissipation(Model()) - 1e-9
    B_tau = np.array([[model.vessel[parameter(a, f"tau_{b}")] for b in AXES] for a in AXES])
    assert plant.effective_thrust(B_tau).holds


def test_sysid_writes_its_results_and_a_model_of_the_plant(runs, tmp_path):
    done = command(sysid, runs / "a.csv", "--test", runs / "b.csv", "--ssv", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "sysid.json").read_text())
    assert set(found["parameters"]) == set(NAMES)
    assert {"own", "other"} == set(found["r2"])
    assert found["r2"]["other"]["N"] > 0.5
    assert {"least_squares", "ridge", "condition", "passes", "warnings"} <= set(found)
    model = read_model(tmp_path / "model.ssv")
    assert model.vessel["map_N_tau_N"] == pytest.approx(-found["parameters"]["delta_N"])


def test_rows_of_the_thesis_need_no_run(tmp_path):
    done = command(sysid, "--recipe", "SYSID4", "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    vessel = read_model(tmp_path / "model.ssv").vessel
    assert vessel["delta_X_u"] == -3.5
    assert vessel["delta_Y_r"] == pytest.approx(8.8)
    assert vessel["map_X_tau_X"] == -0.3


@pytest.mark.parametrize(
    ("main", "arguments", "said"),
    [
        (pca, ["{}/short.csv"], "too few"),
        (pca, ["{}/a.csv", "--components", "9"], "1 to 8"),
        (pca, ["{}/nothing.csv"], "nothing.csv"),
        (pca, ["{}/a.csv", "{}/a.csv"], "is given twice"),
        (pls, ["{}/a.csv", "--recipe", "PLS7"], "no recipe 'PLS7'"),
        (pls, ["{}/short.csv"], "too few"),
        (sysid, [], "needs a run"),
        (sysid, ["--recipe", "SYSID9"], "no recipe 'SYSID9'"),
    ],
)
def test_bad_input_is_one_message(main, arguments, said, runs, tmp_path):
    out = tmp_path / "out"
    done = command(main, *[a.format(runs) for a in arguments], "--out", out)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr
    assert not out.exists()


def test_damping_parameters_are_all_cancelled():
    names = {v.name for v in variables(COMPONENT.params)}
    model = plant.as_model(np.zeros(3), np.zeros((3, 1)), ["u"])
    assert set(model.vessel) <= names
