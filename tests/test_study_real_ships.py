"""The studies of KVLCC2 and R/V Gunnerus: their files, the nominal models on them, folds and tables."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from support.measured import DATA

import diagnosis
from cosim import InputError
from diagnosis import Model
from diagnosis.assessment import free_runs
from diagnosis.model import ship_with
from diagnosis.sensors import examine
from studies import research_vessel, ship_folds, tanker
from studies.research_vessel import MANOEUVRES, closure, cut, steady
from studies.study_report import Report

TANKER, VESSEL = DATA / "kvlcc2_hsva", DATA / "gunnerus"
needs_tanker = pytest.mark.skipif(
    not TANKER.is_dir(), reason=f"no measured runs: no zig-zags of KVLCC2 in {TANKER}"
)
needs_vessel = pytest.mark.skipif(
    not VESSEL.is_dir(), reason=f"no measured runs: no sea trial of Gunnerus in {VESSEL}"
)


@needs_tanker
def test_the_nominal_tanker_is_as_wrong_as_published_models_are():
    """Its speed loss in a zig-zag, and its turns, are right to a third of a length in three lengths."""
    model = Model(ship=ship_with((), "kvlcc2"))
    runs = [tanker.read(TANKER / f"{name}.csv", model) for name in ("z_10_10_p", "z_20_10_s", "z_35_05")]
    data = diagnosis.gather(runs, model=model, anyway=True)
    for e in diagnosis.evaluate(data, model).evaluations:
        assert 0.2 < e.before.position < 0.4
        X, Y, N = e.before.omega_rms
        assert X < 20.0
        assert Y < 20.0
        assert N < 50.0
    assert runs[0].measured["propeller.thrust"].mean() == pytest.approx(41.0, abs=5.0)
    with pytest.raises(InputError, match="no zig-zags"):
        tanker.study(VESSEL, TANKER, None, True)


@needs_vessel
def test_the_sea_trial_is_repaired_and_cut_into_its_manoeuvres():
    model = Model(ship=ship_with((), "gunnerus"))
    run = research_vessel.read(VESSEL / "trial_2.csv", model)
    examined = examine(run, model.ship.scale)
    assert closure(examined.run) < 2.0 < closure(run)
    parts = list(cut(run, examined, MANOEUVRES["trial_2"]))
    assert [p.name for p in parts] == [m.name for m in MANOEUVRES["trial_2"]]
    assert all(np.isfinite(p.pose).all() for p in parts)
    circle = next(p for p in parts if p.name == "circle to port, 20°")
    (w,) = diagnosis.gather([circle], model=model, anyway=True, horizon=60.0)
    time, (pose,) = free_runs(w.smoothed, [model])
    speed, rate = steady(time, pose)
    assert speed == pytest.approx(3.74, rel=0.16)
    assert np.degrees(rate) == pytest.approx(3.47, rel=0.16)


def test_a_file_with_other_columns_is_refused(tmp_path):
    pd.DataFrame({"t": [0.0], "x": [0.0]}).to_csv(tmp_path / "z_10_10.csv", index=False)
    with pytest.raises(InputError, match="has no column 'y'"):
        tanker.study(tmp_path, tmp_path / "out", None, False)
    with pytest.raises(InputError, match="no trial"):
        research_vessel.study(tmp_path, tmp_path / "out", None, False)


def test_every_run_is_left_out_once_and_never_learned_from(monkeypatch):
    seen = []
    runs = [SimpleNamespace(run=SimpleNamespace(name=f"run {k}")) for k in range(5)]

    def diagnose(rest, out, **_):
        seen.append(([w.run.name for w in rest], [w.run.name for w in out]))

    monkeypatch.setattr(diagnosis, "diagnose", diagnose)
    monkeypatch.setattr(ship_folds, "diagnosis_content", lambda *_: None)
    for folds in (2, 3, None):
        seen.clear()
        found = list(ship_folds.learn_folds(runs, folds, Model(), lambda _: None))
        left_out = [name for fold in found for name in fold.left_out]
        assert sorted(left_out) == [w.run.name for w in runs]
        for rest, out in seen:
            assert not set(rest) & set(out)
            assert len(rest) + len(out) == 5
    with pytest.raises(InputError, match="nothing is left to learn from"):
        list(ship_folds.learn_folds(runs[:1], None, Model(), lambda _: None))


def test_a_steady_circle_is_measured_by_its_last_half():
    t = np.linspace(0.0, 200.0, 401)
    psi = np.where(t < 100.0, 0.0, 0.05 * (t - 100.0))
    track = np.column_stack([40.0 * np.sin(psi), 40.0 * (1.0 - np.cos(psi)), psi])
    speed, rate = steady(t, track)
    assert (speed, rate) == pytest.approx((2.0, 0.05), rel=1e-3)


def test_sensors_are_told_in_a_few_lines(tmp_path):
    t = np.arange(0.0, 300.0)
    x = 4.0 * t
    run = SimpleNamespace(
        name="trial",
        time=t,
        pose=np.column_stack([x, 0.0 * x, 0.0 * x]),
        measured={"u": 0.0 * t + 4.0, "v": 0.0 * t},
    )
    slow = SimpleNamespace(kind="clock_rate", value=1.1, sentence="slow")
    low = SimpleNamespace(kind="scale", value=0.98, sentence="u and v read too little")
    report = Report(tmp_path, "A ship")
    examined = SimpleNamespace(run=run, findings=(slow, slow, low), notes=("a note",))
    research_vessel.sensors(report, [(run, examined)])
    text = report.write().read_text()
    assert "miss the position by 0 m (median) as logged, by 0 m as repaired" in text
    assert "1.10 to 1.10 s pass in a second of the log, in 2 stretches" in text
    assert "- u and v read too little\n- a note" in text
