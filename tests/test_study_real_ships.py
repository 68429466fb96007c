"""The studies of KVLCC2 and R/V Gunnerus: their files, the nominal models on them, folds and tables."""

import json
import re
import sys
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from support.measured import DATA, sail, smoothed

import diagnosis
from cosim import InputError
from diagnosis import Model
from diagnosis.predictors import ship_with, weak_windows
from diagnosis.predictors.windows import free_runs, usable_windows
from diagnosis.runs import UNITS, Run, examine
from diagnosis.runs.columns.columns import QUANTITY
from diagnosis.search import DEFAULT
from fmus.ship import ship
from studies import low_speed_tanker, research_vessel, ship_folds, tanker
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
    runs = [
        ship_folds.read(TANKER / f"{name}.csv", tanker.COLUMNS, model)
        for name in ("z_10_10_p", "z_20_10_s", "z_35_05")
    ]
    data = diagnosis.gather(runs, model=model, anyway=True)
    for e in diagnosis.evaluate(data, model).evaluations:
        assert 0.2 < e.before.position < 0.4
        X, Y, N = e.before.omega_rms
        assert X < 20.0
        assert Y < 20.0
        assert N < 50.0
    assert runs[0].measured["propeller.thrust"].mean() == pytest.approx(41.0, abs=5.0)
    with pytest.raises(InputError, match="no zig-zags"):
        tanker.study(VESSEL, TANKER, None, "selection", True)


@needs_vessel
def test_the_sea_trial_is_repaired_and_cut_into_its_manoeuvres():
    model = Model(ship=ship_with((), "gunnerus"))
    run = ship_folds.read(VESSEL / "trial_2.csv", research_vessel.COLUMNS, model)
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


@pytest.mark.parametrize("study", [tanker, low_speed_tanker])
def test_columns_have_the_factor_of_the_unit_in_their_name(study):
    named = {c: re.search(r"\[(.+)\]|_(deg)$", c) for c in study.COLUMNS}
    assert sum(map(bool, named.values())) > 1
    for column, (signal, factor) in study.COLUMNS.items():
        if unit := named[column]:
            quantity = {"propeller.n": "shaft speed", "rudder.delta": "angle"} | QUANTITY
            assert abs(factor) == pytest.approx(UNITS[quantity[signal]][unit[1] or unit[2]]), column


def test_a_file_with_other_columns_is_refused(tmp_path):
    pd.DataFrame({"t": [0.0], "x": [0.0]}).to_csv(tmp_path / "z_10_10.csv", index=False)
    with pytest.raises(InputError, match="has no column 'y'"):
        tanker.study(tmp_path, tmp_path / "out", None, "selection", False)
    with pytest.raises(InputError, match="no trial"):
        research_vessel.study(tmp_path, tmp_path / "out", None, "selection", False)
    pd.DataFrame({name: [0.0] for name in research_vessel.COLUMNS if name != "psi"}).to_csv(
        tmp_path / "trial_1.csv", index=False
    )
    with pytest.raises(InputError, match="has no column 'psi'"):
        research_vessel.study(tmp_path, tmp_path / "out", None, "selection", False)


def test_every_run_is_left_out_once_and_never_learned_from(monkeypatch):
    seen = []
    runs = [SimpleNamespace(run=SimpleNamespace(name=f"run {k}")) for k in range(5)]

    def diagnose(rest, out, **given):
        assert given["by"] == "selection"
        seen.append(([w.run.name for w in rest], [w.run.name for w in out]))
        return f"without {len(out)}"

    monkeypatch.setattr(diagnosis, "diagnose", diagnose)
    monkeypatch.setattr(ship_folds, "diagnosis_content", lambda found, *_: f"content {found}")
    for folds in (2, 3, None):
        seen.clear()
        found = list(ship_folds.learn_folds(runs, folds, Model(), "selection", lambda _: None))
        left_out = [name for fold in found for name in fold.left_out]
        assert sorted(left_out) == [w.run.name for w in runs]
        for fold in found:
            assert fold.found == f"without {len(fold.left_out)}"
            assert fold.content == f"content {fold.found}"
        for rest, out in seen:
            assert not set(rest) & set(out)
            assert len(rest) + len(out) == 5
    with pytest.raises(InputError, match="no training data is left"):
        list(ship_folds.learn_folds(runs[:1], None, Model(), "selection", lambda _: None))


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
    assert "differ from the position by 0 m (median) as logged, by 0 m as repaired" in text
    assert "1.10 to 1.10 s pass in one second of the log, in 2 stretches" in text
    assert "- u and v read too little\n- a note" in text


# Files


def test_a_rudder_of_the_tanker_has_the_other_sign(tmp_path):
    t = np.arange(0.0, 20.0, 0.1)
    columns = {
        "t": t,
        "x": t,
        "y": 2.0 * t,
        "psi_deg": 90.0,
        "rudder_deg": 10.0,
        "rps": 11.0,
        "thrust": 40.0,
    }
    pd.DataFrame(columns).to_csv(tmp_path / "z_10_10.csv", index=False)
    run = ship_folds.read(tmp_path / "z_10_10.csv", tanker.COLUMNS, Model(ship=ship_with((), "kvlcc2")))
    assert (run.name, run.signals) == ("z_10_10", ("propeller.n", "rudder.delta"))
    assert run.commands[0] == pytest.approx([11.0, -np.radians(10.0)])
    assert run.pose[10] == pytest.approx([1.0, 2.0, np.pi / 2.0])
    assert run.measured["propeller.thrust"][0] == 40.0


def test_a_sea_trial_comes_in_degrees_and_revolutions_a_minute(tmp_path):
    t = np.arange(0.0, 20.0)
    columns = {
        "tvec": t,
        "N": 4.0 * t,
        "E": t,
        "psi": 30.0,
        "u": 4.0,
        "v": 0.5,
        "r": 2.0,
        "Azi": 5.0,
        "RPM": 90.0,
    }
    pd.DataFrame(columns).to_csv(tmp_path / "trial_1.csv", index=False)
    run = ship_folds.read(
        tmp_path / "trial_1.csv", research_vessel.COLUMNS, Model(ship=ship_with((), "gunnerus"))
    )
    assert run.pose[5] == pytest.approx([20.0, 5.0, np.radians(30.0)])
    assert dict(zip(run.signals, run.commands[0], strict=True)) == pytest.approx(
        {"azimuth.alpha": np.radians(5.0), "azimuth.n": 1.5}
    )
    assert [run.measured[n][0] for n in "uvr"] == pytest.approx([4.0, 0.5, np.radians(2.0)])


def logged(t, u=4.0, v=0.0, r=0.0, speed=4.0):
    """A run of a log on a circle, or straight ahead, and what its log says its velocity is."""
    psi = 1.0 + r * t
    turned = (
        np.column_stack([np.sin(psi), -np.cos(psi)]) / r
        if r
        else t[:, None] * [np.cos(1.0), np.sin(1.0)]
    )
    pose = np.column_stack([speed * turned, np.angle(np.exp(1j * psi))])
    return Run("trial", t, pose, np.zeros((t.size, 3)), measured={"u": u + 0.0 * t, "v": v + 0.0 * t})


def test_a_log_closes_where_speed_and_heading_make_the_way():
    t = np.arange(0.0, 400.0)
    assert closure(logged(t)) == pytest.approx(0.0, abs=1e-9)
    assert closure(logged(t, u=4.1)) == pytest.approx(0.1 * research_vessel.HORIZON)
    assert closure(logged(t, v=0.2)) == pytest.approx(0.2 * research_vessel.HORIZON)
    assert closure(logged(np.arange(0.0, 400.0, 0.1), r=0.05)) == pytest.approx(0.0, abs=1e-3)
    run = logged(t, u=4.1)
    run.pose[101] = np.nan
    run.measured["u"][210] = np.nan
    assert closure(run) == pytest.approx(0.1 * research_vessel.HORIZON), "gaps are bridged"


def test_manoeuvres_of_a_trial_follow_each_other_and_are_told_apart():
    every = [m for trial in research_vessel.MANOEUVRES.values() for m in trial]
    assert len({m.name.lower() for m in every}) == len(every)
    for trial in research_vessel.MANOEUVRES.values():
        times = [t for m in trial for t in (m.start, m.end)]
        assert times == sorted(times)
        assert all(m.end - m.start > research_vessel.HORIZON for m in trial)


def test_manoeuvres_begin_with_their_approach_and_leave_out_gaps_of_the_clock():
    run = logged(np.arange(0.0, 400.0))
    run.pose[120] = np.nan
    gap = SimpleNamespace(kind="clock_gap", start=130.0, end=133.0)
    slow = SimpleNamespace(kind="clock_rate", start=0.0, end=400.0)
    kept = (run.time <= gap.start) | (run.time >= gap.end)
    examined = SimpleNamespace(run=run.rows(kept), findings=(slow, gap))
    made = [
        research_vessel.Manoeuvre("circle", 100.0, 150.0),
        research_vessel.Manoeuvre("zig", 300.0, 310.0),
    ]
    circle, zig = cut(run, examined, made)
    assert (circle.name, zig.name) == ("circle", "zig")
    left_out = {120.0, 131.0, 132.0}
    assert circle.time.tolist() == [t for t in np.arange(80.0, 151.0) if t not in left_out]
    assert zig.time.tolist() == np.arange(280.0, 311.0).tolist()


# Tables


def change(before, after):
    return SimpleNamespace(before=before, after=after)


def errors(name, scale, held_out=True, heading=0.1):
    """As of the content of a diagnosis: half of everything is left."""
    pull = SimpleNamespace(rms_before=10.0 * scale, rms_after=5.0 * scale)
    return SimpleNamespace(
        run=name,
        held_out=held_out,
        window_position_rmse=change(scale, 0.5 * scale),
        window_heading_rmse=change(heading, 0.5 * heading),
        omega_rms=change([scale, 2.0 * scale, 3.0 * scale], [0.5 * scale, scale, None]),
        measured={"pull": pull},
    )


def fold(name, scale, accepted=(), **content):
    rest = {
        "verdict": "found",
        "withdrawn": [],
        "inseparable": [],
        "correlation": SimpleNamespace(together=[]),
    }
    of = [
        SimpleNamespace(
            name=name,
            held_out=held_out,
            before=SimpleNamespace(errors=windows and SimpleNamespace(position=windows, heading=[0.1] * len(windows))),
            after=SimpleNamespace(errors=SimpleNamespace(position=[0.5, 0.5], heading=[0.05, 0.05])),
        )
        for held_out, windows in ((True, [1.0, 3.0]), (True, None), (False, [99.0]))
    ]  # fmt: skip
    made = SimpleNamespace(
        errors=[errors(name, scale), errors("learned from", 99.0, held_out=False)], accepted=list(accepted), **(rest | content)
    )  # fmt: skip
    return ship_folds.ShipFold([name], SimpleNamespace(comparison=SimpleNamespace(evaluations=of)), made)


def test_errors_of_runs_left_out_are_told_with_their_root_mean_square_and_median(tmp_path):
    lag = SimpleNamespace(id="lag", confidence=0.9, indistinguishable=["delay"], advice="turn quickly")
    sure = SimpleNamespace(id="Y_r", confidence=None, indistinguishable=[], advice="none")
    first = fold(
        "a",
        1.0,
        [lag, sure],
        inseparable=["m and X_u"],
        correlation=SimpleNamespace(together=[["p", "q"]]),
    )
    second = fold("b", 7.0, withdrawn=[SimpleNamespace(id="bow")], inseparable=["m and X_u"])
    report = Report(tmp_path, "A ship")
    ship_folds.write_folds(report, [first, second])
    text = report.write().read_text("utf-8")
    assert "| a | 1 → 0.5 | 5.73 → 2.86 | 1 → 0.5 | 2 → 1 | 3 → nan | 10 → 5 |" in text
    assert "| root mean square | 5 → 2.5 | 5.73 → 2.86 | 5 → 2.5 | 10 → 5 | 15 → nan | 50 → 25 |" in text
    assert "| median | 4 → 2 | 5.73 → 2.86 | 4 → 2 | 8 → 4 | 12 → nan | 40 → 20 |" in text
    assert "learned from" not in text
    assert "Median of all windows: position 2 → 0.5 m, heading 5.73 → 2.86°." in text
    assert "| a | found | lag (90 %), Y_r (–) | – | p, q |" in text
    assert "| b | found | – | bow | – |" in text
    assert text.count("- m and X_u") == 1
    assert text.rstrip().endswith("- lag and delay: turn quickly")
    results = json.loads((tmp_path / "results.json").read_text("utf-8"))
    assert results["a"][0] == [1.0, 0.5]
    assert results["overall"]["median"][0] == [4.0, 2.0]
    assert results["medians of windows"][0] == pytest.approx([2.0, np.degrees(0.1)])


def test_circles_are_told_measured_and_by_both_models(tmp_path, monkeypatch):
    t = np.arange(0.0, 200.0)

    def track(speed, rate):
        psi = rate * t
        return np.column_stack([speed / rate * np.sin(psi), -speed / rate * np.cos(psi), psi])

    def evaluation(name, held_out=True):
        eta = track(4.0, 0.1)
        eta[3] = np.nan
        return SimpleNamespace(name=name, held_out=held_out, smoothed=SimpleNamespace(time=t, eta=eta))

    asked = []

    def free_runs(s, models):
        asked.append(models)
        return t, [track(6.0, 0.05), track(4.4, 0.11)]

    monkeypatch.setattr(research_vessel, "free_runs", free_runs)
    of = [
        evaluation("circle to port"),
        evaluation("circle learned from", held_out=False),
        evaluation("zig-zag"),
    ]
    found = SimpleNamespace(
        comparison=SimpleNamespace(evaluations=of), learned=SimpleNamespace(model="learned")
    )
    report = Report(tmp_path, "A ship")
    research_vessel.circles(report, [SimpleNamespace(found=found)], "nominal")
    text = report.write().read_text("utf-8")
    assert asked == [["nominal", "learned"]]
    assert "| circle to port | 4.00, 6.00, 4.40 | 5.73, 2.86, 6.30 |" in text
    assert "| circle learned from" not in text
    assert "speed off by 50 % before, 10 % after; yaw rate by 50 % and 10 %." in text
    empty = Report(tmp_path, "A ship")
    research_vessel.circles(empty, [], "nominal")
    assert "Median" not in empty.write().read_text("utf-8")


# Studies and their commands


def test_the_sea_trial_is_measured_where_its_sensors_say(tmp_path, monkeypatch):
    """A guess of 2 m and a finding of 0.5 m: the position is measured 2.5 m ahead."""
    asked = {}
    place = SimpleNamespace(channel="x", kind="place", value=0.5)
    other = SimpleNamespace(channel="y", kind="place", value=9.0)
    monkeypatch.setattr(research_vessel, "read", lambda path, *_: SimpleNamespace(name=path.stem))
    monkeypatch.setattr(research_vessel, "examine", lambda *_: SimpleNamespace(findings=[place, other]))
    monkeypatch.setattr(research_vessel, "cut", lambda run, e, manoeuvres: manoeuvres)
    monkeypatch.setattr(
        research_vessel, "sensors", lambda report, trials: report.heading(f"{len(trials)} trials")
    )
    monkeypatch.setattr(research_vessel, "write_folds", lambda report, found: asked.update(folds=found))
    monkeypatch.setattr(research_vessel, "circles", lambda report, found, model: None)

    def gather(parts, model, anyway, horizon):
        asked.update(parts=len(parts), model=model, horizon=horizon)
        return [SimpleNamespace(width=10.0)] * len(parts)

    monkeypatch.setattr(diagnosis, "gather", gather)
    monkeypatch.setattr(research_vessel, "learn_folds", lambda runs, folds, *_: [(len(runs), folds)])
    text = research_vessel.study(tmp_path, tmp_path / "a", 3, "selection", False).read_text("utf-8")
    assert asked["model"].vessel == {"marker_offset_dx": 2.5}
    assert (asked["parts"], asked["folds"]) == (17, [(17, 3)])
    assert asked["horizon"] == research_vessel.HORIZON
    assert "17 manoeuvres" in text
    assert "measured 2.5 m ahead" in text
    assert "## 2 trials" in text
    assert "windows of 10 s" in text
    place.kind = "scale"
    research_vessel.study(tmp_path, tmp_path / "b", None, "selection", True)
    assert asked["model"].vessel == {"marker_offset_dx": 2.0}
    assert asked["parts"] == 6, "a third"


def test_zig_zags_are_learned_from_in_their_order(tmp_path, monkeypatch):
    asked = []
    for name in ("z_3", "z_1", "z_2", "z_5", "z_4", "other"):
        (tmp_path / f"{name}.csv").touch()
    monkeypatch.setattr(tanker, "read", lambda path, *_: path.stem)

    def gather(runs, model, anyway):
        asked.append(runs)
        return [SimpleNamespace(horizon=5.0, width=3.0)] * len(runs)

    monkeypatch.setattr(diagnosis, "gather", gather)
    monkeypatch.setattr(tanker, "learn_folds", lambda runs, folds, *_: [folds])
    monkeypatch.setattr(tanker, "write_folds", lambda report, found: asked.append(found))
    text = tanker.study(tmp_path, tmp_path / "out", 3, "selection", False).read_text("utf-8")
    assert "5 zig-zags" in text
    tanker.study(tmp_path, tmp_path / "out", None, "selection", True)
    assert asked == [["z_1", "z_2", "z_3", "z_4", "z_5"], [3], ["z_1", "z_5"], [None]]


@pytest.mark.parametrize("module", [tanker, research_vessel])
@pytest.mark.parametrize(
    ("arguments", "folds", "quick"),
    [([], None, False), (["--folds", "3"], 3, False), (["--quick"], 2, True)],
)
def test_command_asks_for_its_folds(module, arguments, folds, quick, monkeypatch, tmp_path, capsys):
    asked = []
    monkeypatch.setattr(ship_folds, "run_study", asked.append)
    command = [module.__name__, str(tmp_path), "--out", str(tmp_path / "out")]
    monkeypatch.setattr(sys, "argv", [*command, *arguments])
    module.main()
    (work,) = asked
    assert work.func is module.study
    assert [*work.args] == [tmp_path, tmp_path / "out", folds, DEFAULT, quick]
    monkeypatch.setattr(sys, "argv", [*command, "--calibrate"])
    module.main()
    assert asked.pop().args[3].name == "calibration"
    monkeypatch.setattr(sys, "argv", [*command, "--seeds", "3"])
    with pytest.raises(SystemExit):
        module.main()
    assert "--seeds" in capsys.readouterr().err, "nothing is random, so that there are no seeds"


ESSO = DATA / "esso_osaka"
needs_esso = pytest.mark.skipif(
    not ESSO.is_dir(), reason=f"no measured runs: no tests of the Esso Osaka in {ESSO}"
)


def test_tests_of_one_log_are_left_out_together():
    names = ["random_06-Aug_16_24_25_1", "random_06-Aug_16_24_25_4", "random_31-Jul_12_29_58"]
    names += ["turn_14-Oct_14_08_51", "turn_14-Oct_14_17_39"]
    runs = [SimpleNamespace(run=SimpleNamespace(name=name)) for name in names]
    first, second = ([w.run.name for w in fold] for fold in low_speed_tanker.dealt(runs, 2))
    assert sorted(first) == [*names[:2], names[3]]
    assert sorted(second) == [names[2], names[4]]


@pytest.mark.slow
def test_errors_are_compared_test_by_test(tmp_path, monkeypatch):
    monkeypatch.setattr(low_speed_tanker, "HORIZONS", (4.0, 8.0))
    w = weak_windows(smoothed(sail()[0]))
    before = {w.run.name: [(1.0, 2.0, np.nan), (4.0, 4.0, np.nan)]}
    after = {w.run.name: [(0.5, 3.0, 0.9), (4.4, 2.0, 0.9)]}
    report = Report(tmp_path, "Tests")
    low_speed_tanker.compare_tests(report, [w], before, after)
    text = report.write().read_text()
    windows = " | ".join(str(usable_windows(w.smoothed, h).first_rows.size) for h in (4.0, 8.0))
    assert f"| {w.run.name} | {windows} | 0.50 | 1.50 | 1.10 | 0.50 |" in text
    assert "0 in position, 4 s; 1 in heading, 4 s; 1 in position, 8 s; 0 in heading, 8 s" in text


@needs_esso
@pytest.mark.slow
def test_the_description_of_the_esso_osaka_predicts_a_zig_zag_and_needs_the_wind():
    """Over 20 s it stays within a third of a length; in calm air it is worse."""
    model = Model(ship=ship_with((), "esso_osaka"))
    files = [
        ESSO / f"{name}.csv" for name in ("zigzag_31-Jul-2020_13_57_45", "random_31-Jul-2020_14_52_18")
    ]
    runs = [ship_folds.read(f, low_speed_tanker.COLUMNS, model) for f in files]
    data = diagnosis.gather(runs, model=model, anyway=True)
    errors = low_speed_tanker.errors(data, model)
    for (position, heading, _), _ in errors.values():
        assert position < 1.0
        assert heading < 10.0
    calm = Model(ship=ship(description=model.ship.description._replace(wind_measured=False)))
    blind = low_speed_tanker.errors(data, calm)
    (with_wind, *_), _ = errors[data[1].run.name]
    (without, *_), _ = blind[data[1].run.name]
    assert with_wind < without
    with pytest.raises(InputError, match="no tests KIND_DATE_TIME"):
        low_speed_tanker.study(TANKER, ESSO, 0, True, True)
