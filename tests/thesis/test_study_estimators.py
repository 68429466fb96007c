"""The study of the estimators: its measures on made-up signals, measured runs, and the whole of it."""

import os
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.io import savemat
from support.project import ROOT

import cosim
import diagnosis
from cosim import InputError, SimulationError
from cosim.dispatch import FinishedRun
from diagnosis.runs import Run
from fmus.frames import rotate_to_body
from studies.measured.data_folder import measured_files
from studies.study_report import Report
from thesis import estimators, observer_gains
from thesis.observers import basin, claims
from thesis.observers.claims import ahead
from thesis.observers.estimates_replayed import (
    LONGEST_LAG,
    OBSERVERS,
    SIGNALS,
    freezes,
    held,
    lag,
    measures,
    observer,
    replay,
    rms,
    roughness,
    wraps,
)

H = 0.01
DATA = Path(os.environ.get("CYBERSHIP_DATA", ROOT.parent / "shared" / "data"))
needs_data = pytest.mark.skipif(
    not DATA.is_dir(), reason="no measured runs: CYBERSHIP_DATA names no folder that exists"
)


def circle(seconds=60.0, h=H, u=0.1, r=0.2):
    """A log of a ship on a circle at constant speed, without noise."""
    t = np.arange(round(seconds / h)) * h
    psi = r * t
    zero = np.zeros_like(t)
    return {
        "time": t,
        "observer.x_m": 5.0 + u / r * np.sin(psi),
        "observer.y_m": 2.0 - u / r * np.cos(psi),
        "observer.psi_m": np.angle(np.exp(1j * psi)),
        **{f"observer.tau_{axis}": zero for axis in "XYN"},
        **{f"vessel.{name}": zero for name in SIGNALS},
    } | {"vessel.u": zero + u, "vessel.r": zero + r}


def true_estimate(log):
    psi = np.unwrap(log["observer.psi_m"])
    pose = {"x_hat": log["observer.x_m"], "y_hat": log["observer.y_m"], "psi_hat": psi}
    return pose | {name: log[f"vessel.{name}"] for name in SIGNALS}


def test_replay_is_the_component_itself():
    log = circle(20.0)
    found = replay(observer("mdf"), log)
    assert found["u"][-1] == pytest.approx(0.1, rel=1e-2)
    assert found["frozen"].max() == 0.0
    slow = replay(observer("mdf"), log, measurement_period=0.05)
    assert slow["u"][-1] == pytest.approx(found["u"][-1])


def test_lag_is_found():
    t = np.arange(6000) * H
    log = {"time": t, "vessel.u": np.sin(t)}
    assert lag(log, {"u": np.sin(t - 0.23)}, "u") == pytest.approx(0.23)
    assert lag(log, {"u": np.sin(t)}, "u") == 0.0
    assert np.isnan(lag(log, {"u": np.sin(t - LONGEST_LAG - 0.5)}, "u")), "beyond what is looked for"


@pytest.mark.parametrize("gains", [(9.0, 1.0), (50.0, 0.7)])
def test_nonlinear_observer_lags_by_its_gains(gains):
    t = np.arange(1000) * H
    log = circle(10.0) | {
        "observer.x_m": 0.005 * t**2,
        "observer.y_m": 0.0 * t,
        "observer.psi_m": 0.0 * t,
    }
    named = observer_gains.gains(*gains)
    found = replay(observer("nonlinear"), log, **named)
    late = (0.01 * t - found["u"])[-1] / 0.01
    assert late == pytest.approx(named["k1_x"] / named["k2_u"], abs=2 * H)


def test_freezes_and_wraps_are_found_where_they_are():
    log = circle()
    for name in ("x_m", "y_m", "psi_m"):
        log[f"observer.{name}"][3000:3080] = log[f"observer.{name}"][2999]
        log[f"observer.{name}"][4000:4002] = log[f"observer.{name}"][3999]
    assert freezes(log) == [(3000, 3080)]
    expected = [row for row in np.flatnonzero(np.diff(log["observer.psi_m"]) < -3.0) + 1 if row > 1000]
    assert wraps(log) == expected
    assert len(expected) == 2


def test_share_that_is_held_through_a_freeze():
    log = circle()
    for name in ("x_m", "y_m", "psi_m"):
        log[f"observer.{name}"][3000:3080] = log[f"observer.{name}"][2999]
    u = np.full(6000, 0.1)
    assert held(log, {"u": u}) == 1.0
    u[3000:3080] = np.linspace(0.1, 0.025, 80)
    assert held(log, {"u": u}) == pytest.approx(0.25)


def test_smoother_is_exact_for_a_cubic_with_gaps():
    t = np.arange(400) * 0.05
    values = 1.0 + 0.5 * t - 0.2 * t**2 + 0.01 * t**3
    good = np.ones(400, bool)
    good[100:106] = False
    values[100:106] = 1e9
    position, rate, change = basin.local_cubic(values, good, 0.05)
    inner = slice(20, 380)
    assert rate[inner] == pytest.approx(0.5 - 0.4 * t[inner] + 0.03 * t[inner] ** 2, abs=1e-6)
    assert change[inner] == pytest.approx(-0.4 + 0.06 * t[inner], abs=1e-5)
    good[200:230] = False
    position, _, _ = basin.local_cubic(values, good, 0.05)
    assert np.isnan(position[215])
    assert np.isfinite(position[250])


def test_reference_and_prediction_on_a_circle():
    log = circle(h=0.05)
    found = basin.reference(log)
    inner = slice(40, -40)
    assert found["u"][inner] == pytest.approx(0.1, abs=1e-5)
    assert found["v"][inner] == pytest.approx(0.0, abs=1e-5)
    assert found["r"][inner] == pytest.approx(0.2, abs=1e-5)
    assert found["v_dot"][inner] == pytest.approx(0.0, abs=1e-4)
    right = true_estimate(log)
    assert basin.prediction_error(log, right, 0.5) < 1e-5
    wrong = right | {"u": right["u"] + 0.02}
    assert basin.prediction_error(log, wrong, 0.5) == pytest.approx(0.01, rel=0.01)


def test_ahead_divides_by_the_best_of_the_others():
    run = {o: {f"rms_{s}": 1.0 + k for s in SIGNALS} for k, o in enumerate(OBSERVERS)}
    run["kalman"] = {f"rms_{s}": 0.5 for s in SIGNALS}
    assert ahead([run, run])["u_dot"].mean == pytest.approx(0.5)


def test_data_that_is_none_is_bad_input(tmp_path):
    with pytest.raises(InputError, match="no measured runs"):
        estimators.study(tmp_path / "out", 1, None, True, tmp_path)
    assert not (tmp_path / "out").exists()
    savemat(tmp_path / "other.mat", {"something": np.zeros(3)})
    with pytest.raises(InputError, match=r"other\.mat"):
        basin.read(tmp_path / "other.mat")


def test_measured_runs_are_found_in_the_folder_or_in_its_cse1(tmp_path):
    (tmp_path / "cse1").mkdir()
    deep = [tmp_path / "cse1" / name for name in ("a.mat", "b.mat")]
    for path in reversed(deep):
        path.touch()
    assert measured_files(tmp_path) == deep
    (tmp_path / "c.mat").touch()
    assert measured_files(tmp_path) == [tmp_path / "c.mat"]


@needs_data
def test_measured_runs_can_be_read():
    full_ahead = []
    for path in measured_files(DATA):
        log = basin.read(path)
        assert 0.8 < basin.valid(log).mean() < 1.0
        assert np.median(np.diff(log["time"])) == pytest.approx(0.05, abs=1e-3)
        full_ahead.append(np.abs(log["observer.tau_X"]).max())
        moving = basin.reference(log)["u"]
        assert 0.005 < np.nanstd(moving) < 0.5
    assert max(full_ahead) == pytest.approx(2.33, rel=0.01), "once, by one run at full power"


@needs_data
@pytest.mark.slow
def test_kalman_predicts_the_real_ship_best():
    """Needs no reference: where the ship is half a second later, by estimate alone."""
    for path in measured_files(DATA)[2:]:
        log = basin.read(path)
        estimates = {
            o: replay(observer(o), log, measurement_period=0.05) for o in ("mdf", "luenberger", "kalman")
        }
        found = {o: basin.prediction_error(log, e, 0.5) for o, e in estimates.items()}
        assert found["kalman"] < 0.8 * min(found["mdf"], found["luenberger"]), path.name


# The whole


def test_measures_are_by_observer_and_of_every_signal():
    """True estimates are right, those of an observer that is 0.05 m/s too swift are wrong by that."""
    log = circle() | {"vessel.v": np.zeros(6000)}
    for name in ("x_m", "y_m", "psi_m"):
        log[f"observer.{name}"][3000:3080] = log[f"observer.{name}"][2999]
    right = measures(log, true_estimate(log))
    zero = [f"{m}_{n}" for m in ("rms", "lag", "after_freeze", "after_wrap") for n in ("u", "v", "r")]
    assert [right[name] for name in zero] == pytest.approx([0.0] * 12)
    assert set(right) == {
        *zero,
        *(f"rms_{n}_dot" for n in "uvr"),
        *(f"noise_{n}" for n in "uvr"),
        "held",
        "stuck",
    }
    assert (right["held"], right["stuck"]) == (1.0, 0.0)
    wrong = true_estimate(log)
    wrong |= {"u": wrong["u"] + 0.05, "r_dot": wrong["r_dot"].copy()}
    wrong["r_dot"][-1] = np.nan
    found = measures(log, wrong)
    assert [found[f"{m}_u"] for m in ("rms", "after_freeze", "after_wrap")] == pytest.approx([0.05] * 3)
    assert found["stuck"] == 1.0, "no number at the end"
    wrong["r_dot"][-1] = 10.0
    assert measures(log, wrong)["stuck"] == 1.0, "absurd at the end"
    wrong["r_dot"][-1] = -9.9
    assert measures(log, wrong)["stuck"] == 0.0


def test_root_mean_square_also_of_what_has_run_away():
    assert rms(np.array([3.0, -4.0, 0.0])) == pytest.approx(np.sqrt(25.0 / 3.0))
    assert np.isnan(rms(np.array([])))
    assert rms(np.array([1e300, 0.0])) == rms(np.array([np.nan])) == np.inf


@pytest.mark.parametrize("hertz", [0.1, 4.0])
def test_noise_is_what_is_quicker_than_a_quarter_of_a_second(hertz):
    t = np.arange(6000) * H
    values = np.sin(2.0 * np.pi * hertz * t)
    values[:1000] = 99.0 * np.random.default_rng(0).normal(size=1000)
    found = roughness({"time": t}, {"u": values}, "u")
    assert found < 1e-4 if hertz < 1.0 else found > 0.1
    values[5000] = np.nan
    assert np.isnan(roughness({"time": t}, {"u": values}, "u"))


def test_measured_runs_are_judged_by_the_smoother_and_by_prediction():
    log = circle(h=0.05)
    right = basin.measures(log, true_estimate(log))
    assert max(right.values()) < 1e-3
    wrong = true_estimate(log)
    wrong["u"] = wrong["u"] + np.where(log["time"] < 12.0, 1.0, 0.02)
    found = basin.measures(log, wrong)
    assert found["median_u"] == pytest.approx(0.02, rel=1e-3)
    known = (log["time"] >= 10.0) & np.isfinite(basin.reference(log)["u"])
    early = (log["time"][known] < 12.0).mean()
    assert found["rms_u"] == pytest.approx(np.sqrt(early + (1.0 - early) * 4e-4), rel=1e-2)
    assert found["one_sample"] == pytest.approx(0.02 * 0.05, rel=1e-2)
    assert found["half_second"] == pytest.approx(0.02 * 0.5, rel=1e-2)
    assert found["median_v"] == right["median_v"]


def test_a_prediction_turns_and_accelerates():
    t = np.arange(1200) * 0.05
    log = {
        "time": t,
        "observer.x_m": 0.005 * t**2,
        "observer.y_m": 0.3 * t,
        "observer.psi_m": 0.0 * t + 0.4,
    }
    along, across = rotate_to_body(log["observer.psi_m"], 0.01 * t, 0.0 * t + 0.3)
    estimate = {
        "x_hat": log["observer.x_m"],
        "y_hat": log["observer.y_m"],
        "psi_hat": log["observer.psi_m"],
    }
    a, b = rotate_to_body(log["observer.psi_m"], 0.01 + 0.0 * t, 0.0 * t)
    estimate |= {"u": along, "v": across, "r": 0.0 * t, "u_dot": a, "v_dot": b}
    assert basin.prediction_error(log, estimate, 0.5) == pytest.approx(0.0, abs=1e-12)
    slow = estimate | {"u_dot": 0.0 * t, "v_dot": 0.0 * t}
    assert basin.prediction_error(log, slow, 0.5) == pytest.approx(0.5 * 0.01 * 0.25)
    log["observer.x_m"][::7] = np.nan
    assert basin.prediction_error(log, estimate, 0.5) == pytest.approx(0.0, abs=1e-12), "lost samples"


def test_a_command_has_acted_since_the_sample_before(monkeypatch, tmp_path):
    tau = np.arange(12.0).reshape(4, 3)
    run = Run("a", np.array([5.0, 5.1, 5.2, 5.3]), -tau, tau)
    monkeypatch.setattr(diagnosis, "read", lambda path: run)
    log = basin.read(tmp_path)
    assert log["time"] == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert log["observer.psi_m"].tolist() == [-2.0, -5.0, -8.0, -11.0]
    assert log["observer.tau_Y"].tolist() == [10.0, 1.0, 4.0, 7.0]


def test_every_observer_is_held_against_the_same_log(monkeypatch):
    log = circle(12.0)
    found = estimators.analyse(FinishedRun({}, log=log))
    assert set(found) == set(OBSERVERS)
    assert found["mdf"] == pytest.approx(measures(log, replay(observer("mdf"), log)), nan_ok=True)
    with pytest.raises(SimulationError, match="why"):
        estimators.analyse(FinishedRun({}, status="failed", message="why"))
    other = {o: {k: x + 2.0 for k, x in row.items()} for o, row in found.items()}
    mean = estimators.over_seeds([found, other])["kalman"]["rms_u"]
    assert mean.mean == pytest.approx(found["kalman"]["rms_u"] + 1.0)
    assert mean.low < found["kalman"]["rms_u"] < mean.high


@pytest.fixture
def report(tmp_path, monkeypatch):
    """A report that keeps its figures, and as ``drawn`` their names."""
    made = Report(tmp_path, "t")
    made.drawn = []
    monkeypatch.setattr(Report, "figure", lambda self, name, figure, caption: self.drawn.append(name))
    return made


@pytest.mark.parametrize(
    ("freeze", "rate", "drawn"),
    [(True, 0.2, ["compared", "freeze", "wrap"]), (False, 0.01, ["compared"])],
)
def test_pictures_show_the_longest_freeze_and_a_wrap_where_there_are(
    freeze, rate, drawn, report, monkeypatch
):
    log, asked = circle(30.0, h=0.05, r=rate), []
    for first, end in ((300, 304), (350, 380), (420, 425)):
        for name in ("x_m", "y_m", "psi_m"):
            if freeze:
                log[f"observer.{name}"][first:end] = log[f"observer.{name}"][first - 1]
    monkeypatch.setattr(
        cosim, "load_scenario", lambda content: asked.append((content["seed"], content["stop"]))
    )
    monkeypatch.setattr(cosim, "simulate", lambda scenario, folder: SimpleNamespace(folder=folder))
    monkeypatch.setattr(cosim, "read_log", lambda folder: log)
    monkeypatch.setattr(estimators.pictures, "compared", lambda *_: None)
    monkeypatch.setattr(
        estimators.pictures, "freeze", lambda log, e, first, end: asked.append((first, end))
    )
    estimators.examples(report, 42.0)
    assert report.drawn == drawn
    assert asked == [(0, 42.0)] * 2 + [(350, 380)] * freeze


def test_measured_runs_have_a_table_and_a_picture_each(report, monkeypatch, tmp_path):
    log = circle(40.0, h=0.05)
    for name in ("x_m", "y_m", "psi_m"):
        log[f"observer.{name}"][400:440] = log[f"observer.{name}"][399]
    monkeypatch.setattr(basin, "read", lambda path: log)
    found = estimators.measured(report, [tmp_path / "run1.mat", tmp_path / "run2.mat"])
    assert report.drawn == ["measured_run1", "measured_run2"]
    text = report.write().read_text("utf-8")
    assert "**run1**: 40 s, 5.0 % of the samples frozen or lost" in text
    estimate = replay(observer("df"), log, measurement_period=0.05)
    assert found["run2"]["df"] == basin.measures(log, estimate)
    row = found["run2"]["df"]
    assert f"| df | {row['median_u']:.2g} / {row['rms_u']:.2g} |" in text
    assert f"| {1e3 * row['one_sample']:.4g} | {1e3 * row['half_second']:.4g} |" in text


@pytest.mark.parametrize(
    ("arguments", "given"),
    [
        ([], [10, None, False, None]),
        (["--seeds", "3", "--jobs", "2", "--quick"], [3, 2, True, None]),
        (["--data", "cse1"], [10, None, False, Path("cse1")]),
    ],
)
def test_command_asks_for_its_study(arguments, given, monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(estimators, "run_study", asked.append)
    estimators.main(["--out", str(tmp_path), *arguments])
    assert asked[0].func is estimators.study
    assert [*asked[0].args] == [tmp_path, *given]


def test_quick_study_has_two_seeds_and_half_the_time(monkeypatch, tmp_path):
    asked = []

    def run_all(runs, seeds, *_, **__):
        asked.append((seeds, {content["stop"] for content in runs.values()}))
        raise SimulationError("enough")

    monkeypatch.setattr(estimators, "run_all", run_all)
    for quick, seeds in ((True, 5), (True, 1), (False, 5)):
        with pytest.raises(SimulationError, match="enough"):
            estimators.study(tmp_path, seeds, None, quick, None)
    assert asked == [([0, 1], {60.0}), ([0], {60.0}), ([0, 1, 2, 3, 4], {120.0})]
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot write to"):
        estimators.study(tmp_path / "file", 1, None, True, None)


def replayed(variant, **measures):
    """Three runs; ``measures`` are values by observer, a little another one in each run."""
    return {
        variant: [
            {o: {m: of(o) * (1.0 + 0.01 * seed) for m, of in measures.items()} for o in OBSERVERS}
            for seed in range(3)
        ]
    }


@pytest.mark.parametrize(
    ("slow", "noisy", "here"),
    [
        (True, True, True),
        (True, False, None),
        (False, True, None),
        (False, False, False),
    ],
)
def test_claim_of_lag_and_of_noise(slow, noisy, here):
    def runs(late, loud):
        return replayed(
            "rich, no freezes",
            lag_u=lambda o: 0.3 if (o == "mdf") == late else 0.1,
            noise_u=lambda o: 0.002 if (o == "mdf") == loud else 0.009,
        )

    verdict = claims.lag_and_noise(runs(slow, noisy))
    assert "lags" in verdict.thesis
    assert verdict.holds is here
    assert verdict.here == {
        f"{what}, {o}": yes
        for what, yes in (("lag", slow), ("noise", noisy))
        for o in ("nonlinear", "luenberger")
    }
    assert "luenberger: lag" in verdict.numbers


def test_claim_needs_to_be_sure_in_every_seed():
    found = replayed("rich", after_freeze_u=lambda o: {"mdf": 0.1, "df": 0.2}.get(o, 0.3))
    assert claims.spikes(found).holds is claims.robust(found).holds is True
    found["rich"][0]["mdf"]["after_freeze_u"] = 0.3
    assert claims.spikes(found).holds is False, "the difference is no longer sure"
    found["rich"][1]["df"]["after_freeze_u"] = 0.4
    assert claims.robust(found).holds is False
    found["rich"][0]["df"]["after_freeze_u"] = float("nan")
    assert claims.spikes(found).holds is False, "one run has no such time"


@pytest.mark.parametrize(
    ("mdf", "df", "here"),
    [
        (1.0, 0.1, True),
        (0.9, 0.1, False),
        (1.1, 0.1, False),
        (1.0, 0.6, False),
        (1.0, -0.6, False),
    ],
)
def test_claim_of_the_velocity_that_is_held(mdf, df, here):
    assert claims.held(replayed("rich", held=lambda o: mdf if o == "mdf" else df)).holds is here


@pytest.mark.parametrize(
    ("df", "mdf", "here"),
    [
        (5.0, 0.01, True),
        (0.5, 0.01, False),
        (5.0, 0.2, False),
    ],
)
def test_claim_of_the_wrap_of_the_heading(df, mdf, here):
    runs = replayed("ellipse", after_wrap_r=lambda o: df if o == "df" else mdf)
    assert claims.wrap(runs).holds is here


def test_the_least_error_of_each_signal_is_bold(tmp_path):
    def of(best, o):
        return 1.0 if o == best else 2.0

    errors = {f"rms_{s}": partial(of, OBSERVERS[k % len(OBSERVERS)]) for k, s in enumerate(SIGNALS)}
    report = Report(tmp_path, "t")
    estimators.error_tables(report, {"rich": estimators.over_seeds(replayed("rich", **errors)["rich"])})
    rows = [r.split("|")[1:-1] for r in report.write().read_text("utf-8").splitlines() if "|" in r][2:]
    for k in range(len(SIGNALS)):
        bold = [name.strip() for name, *cells in rows if cells[k].strip().startswith("**")]
        assert bold == [OBSERVERS[k % len(OBSERVERS)]]


def test_claim_of_the_observers_that_get_stuck():
    def runs(*names):
        return replayed("ellipse, upsets", stuck=lambda o: float(o in names))

    assert claims.stuck(runs()).holds is False
    assert claims.stuck(runs("luenberger")).here == {"nonlinear": False, "luenberger": True}
    assert claims.stuck(runs("nonlinear", "luenberger")).holds is True
    assert "of 3 runs" in claims.stuck(runs())[2]
    assert "nonlinear 3" in claims.stuck(runs("nonlinear"))[2]
    assert claims.stuck(runs("df")).holds is False, "the thesis says it of two"
