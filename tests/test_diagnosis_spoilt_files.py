"""Files that do not hold what they seem to: told in one line, the same from Python and the commands."""

import json
from functools import cache

import numpy as np
import pandas as pd
import pytest
from support.cases import in_part
from support.closed_form import Allocation, thrust
from support.measured import DATA, commands, jumps, needs_data, sail, smoothed, table_of
from support.planted import voyages

import diagnosis
from benchmarks.spoilt_files.outcomes import Outcome, outcome
from benchmarks.spoilt_files.ways import POSE, WAYS, struck
from diagnosis import InputError, Model, compare, learn, weak_windows
from diagnosis.assessment.gains import gains
from diagnosis.assessment.plausibility import refuse_implausible
from diagnosis.assessment.readings import Reading, of_commands, of_pose, reread
from diagnosis.predictors.thrust import full_thrust
from diagnosis.runs import channels_of, read
from diagnosis.runs.columns.columns import Named
from diagnosis.search import shortlist

RATE = 20  # Hz


@cache
def windows():
    return weak_windows(smoothed(sail(60.0, 1.0 / RATE)[0]))


def good(given=commands):
    return table_of(sail(60.0, 1.0 / RATE, given=given)[0])


def written(folder, table):
    table.to_csv(folder / "a.csv", index=False)
    return folder / "a.csv"


def spoilt(folder, way):
    return written(folder, WAYS[way].spoil(good(), np.random.default_rng(0)))


def column(**changes):
    """A line for the file beside, of columns that keep their names."""
    return json.dumps({"columns": {name: {"name": name} | change for name, change in changes.items()}})


MILLI = {"tau_X": {"unit": "mN"}, "tau_Y": {"unit": "mN"}, "tau_N": {"unit": "N.mm"}}
TOLD = [
    ("swap_xy", '{"x": {"name": "y"}, "y": {"name": "x"}}'),
    ("swap_tau", '{"tau_X": {"name": "tau_Y"}, "tau_Y": {"name": "tau_X"}}'),
    ("feet", column(x={"unit": "ft"}, y={"unit": "ft"})),
    ("tau_mN", column(**MILLI)),
    ("tau_percent", "times the 1.165 N that the thrusters give"),
    ("time_double", '{"time": {"name": "time", "factor": 0.'),
    ("psi_180", column(psi={"offset": 3.142})),
    ("psi_90", column(psi={"offset": 4.712})),
    ("const_tau", "all its commands are constant"),
    ("outliers_tau", "leave false cells empty"),
]


@pytest.mark.parametrize(("way", "line"), in_part(TOLD, keep=[TOLD[k] for k in (1, 2, 5)]))
def test_spoilt_file_is_refused_with_the_line_that_mends_it(way, line, tmp_path):
    with pytest.raises(InputError) as error:
        diagnosis.load(spoilt(tmp_path, way))
    assert line in str(error.value)
    assert "\n" not in str(error.value)


def test_python_and_both_commands_tell_the_same_and_go_on_alike(tmp_path, capsys):
    path = spoilt(tmp_path, "const_tau")
    with pytest.raises(InputError) as error:
        diagnosis.load(path)
    for command in (learn, compare):
        assert command.main([str(path), "--out", str(tmp_path / "out")]) == 2
        assert str(error.value) in " ".join(capsys.readouterr().err.split())
    assert len(diagnosis.load(path, anyway=True)) == 1


def test_line_that_is_told_mends_the_file(tmp_path):
    path = spoilt(tmp_path, "feet")
    beside = column(x={"unit": "ft"}, y={"unit": "ft"})
    path.with_name("a.csv.json").write_text(beside)
    assert len(diagnosis.load(path)) == 1


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            lambda t: t.iloc[np.arange(len(t)) // 70 * 70].assign(time=t["time"].to_numpy()),
            "every 3.5 s is",
        ),
        (lambda t: t.assign(psi=0.3), "psi is constant while the ship moves"),
    ],
)
def test_pose_that_gives_no_velocity_is_refused(table, message, tmp_path):
    path = written(tmp_path, table(good()))
    with pytest.raises(InputError, match=message):
        diagnosis.load(path)


@pytest.mark.parametrize(
    ("table", "rate"),
    [
        (lambda t: t.iloc[::15], 1.0 / 0.75),
        (lambda t: struck("x", 0.15, 1.0)(t, np.random.default_rng(0)), 20.0),
    ],
)
def test_rare_samples_and_many_outliers_still_give_a_motion(table, rate, tmp_path):
    (clean,), (found,) = (diagnosis.load(written(tmp_path, t)) for t in (good(), table(good())))
    (channel, *_) = channels_of(found.smoothed)
    assert channel.rate == pytest.approx(rate, rel=0.01)
    time = found.smoothed.time
    true = np.column_stack([np.interp(time, clean.smoothed.time, x) for x in clean.smoothed.nu.T])
    there = np.isfinite(found.smoothed.nu + true).all(axis=1)
    off = (found.smoothed.nu - true)[there]
    assert np.sqrt((off**2).mean(axis=0)) == pytest.approx(0.0, abs=0.02)
    reach = 3.0 * np.hypot(found.smoothed.nu_std[there], 1e-3)
    assert (np.abs(off) < reach).mean() > 0.95


@pytest.mark.parametrize("way", ["outliers_1", "rounded_1_cm", "tau_double", "half"])
def test_file_that_can_be_used_is_not_refused(way, tmp_path):
    assert len(diagnosis.load(spoilt(tmp_path, way))) == 1


def test_zero_commands_of_a_ship_that_goes_on_count_as_not_logged(tmp_path):
    """Half of the run; no model is judged there, and the true one has no error elsewhere."""
    (w,) = diagnosis.load(spoilt(tmp_path, "commands_zero_half"))
    (whole,) = diagnosis.load(written(tmp_path, good()))
    assert any("all commands are zero for 2" in note for note in w.smoothed.track.notes)
    middle = 0.5 * (w.run.time[0] + w.run.time[-1])
    assert (w.middle < middle).all()
    assert w.middle.size > 0.45 * whole.middle.size
    rms = [np.sqrt(np.mean(diagnosis.omega(x, Model()) ** 2, axis=0)) for x in (whole, w)]
    assert (rms[1] <= 1.5 * rms[0]).all()
    assert not diagnosis.load(spoilt(tmp_path, "commands_zero_half"), anyway=True)[0].run.held


# What a ship may have: single effects of unusual size.
SHIPS = [
    ({}, {}),
    ({"heading_offset": 1.2}, {}),
    ({}, {"loss_surge": 1.0}),
    ({}, {"loss_sway": 1.0}),
    ({}, {"loss_yaw": 1.0}),
    ({}, {"loss_vsp": 0.9}),
    ({}, {"bow_failure_time": 5.0}),
    ({}, {"bow_outage_start_1": 10.0, "bow_outage_end_1": 40.0}),
    ({}, {"vsp_outage_start_1": 10.0, "vsp_outage_end_1": 40.0}),
    ({}, {"deadband": 0.1}),
    ({}, {"saturation_vsp": 0.3}),
    ({}, {"attack_point_dx": 0.2, "attack_point_dy": 0.1}),
    ({"V_n": 0.3, "V_e": 0.2}, {}),
    ({"F_n": 1.0, "F_e": 0.5}, {}),
    ({"mass": 8.0}, {}),
    ({"added_mass_N": 2.0}, {}),
    ({"delta_X_u": -8.0}, {}),
    ({"delta_Y_v": -20.0}, {}),
    ({"marker_offset_dx": 0.4}, {}),
    ({"body_bias_X": 0.5, "body_bias_Y": 0.4, "body_bias_N": 0.1}, {}),
]


# Late forces are seen in jumps of the commands; the others have smooth ones and jumps in turn.
LATE = [({}, {"delay": 1.0}), ({}, {"lag": 2.0})]
CASES = [(*each, (commands, jumps)[k % 2]) for k, each in enumerate(SHIPS)]
CASES += [(*each, given) for each in LATE for given in (commands, jumps)]
CASES = CASES[2::3]  # one of three


@pytest.mark.parametrize(("ship", "thrusters", "given"), in_part(CASES, keep=[CASES[1], CASES[-1]]))
def test_no_hidden_effect_is_refused(ship, thrusters, given):
    run = sail(60.0, 1.0 / RATE, ship=ship, thrusters=thrusters, given=given)[0]
    refuse_implausible([weak_windows(smoothed(run))], Model())


@pytest.mark.slow
@needs_data
def test_real_runs_are_not_refused():
    assert len(diagnosis.load(DATA / "cse1" / "run1.mat")) == 1
    refuse_implausible([weak_windows(smoothed(read(DATA / "cse1" / "dptest1.mat")))], Model())


def test_gains_are_one_and_follow_units_and_clock():
    """k of a length in another unit is that unit, of a force its inverse, of a clock its square."""
    assert gains(windows(), Model()).value == pytest.approx([1.0, 1.0, 1.0], abs=0.05)
    for reading, expected in (
        (of_pose("", (3.0, 3.0, 1.0)), [3.0, 3.0, 1.0]),
        (of_commands("", (10.0, 10.0, 0.1)), [0.1, 0.1, 10.0]),
        (Reading("", {"time": Named(name="time", factor=0.5)}), [4.0, 4.0, 4.0]),
    ):
        found = gains(reread(windows(), reading, Model()), Model())
        assert found.value == pytest.approx(expected, rel=0.1)
        assert found.wrong.any()


def test_gain_of_drag_and_surroundings_is_one():
    ship = {"delta_X_u": -8.0, "delta_Y_v": -20.0, "F_n": 0.5, "body_bias_X": 0.3}
    w = weak_windows(smoothed(sail(60.0, 1.0 / RATE, ship=ship)[0]))
    assert gains(w, Model()).value == pytest.approx([1.0, 1.0, 1.0], abs=0.1)


def test_full_thrust_is_the_largest_of_all_commands():
    corners = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3)).reshape(3, -1)
    most = [np.abs(np.broadcast_to(f, corners.shape[1])).max() for f in thrust(*corners, Allocation())]
    assert full_thrust(Model()) == pytest.approx(most)


def steady(t):
    """Constant surge force and no sway, yaw varies: as of a ship with a propeller and a rudder."""
    return np.column_stack([0.4 + 0.0 * t, 0.0 * t, 0.15 * np.sin(0.39 * t) + 0.08 * np.sin(0.97 * t)])


def test_constant_thrust_beside_a_varying_rudder_is_right(tmp_path):
    assert len(diagnosis.load(written(tmp_path, good(steady)))) == 1


def test_constant_force_against_the_motion_is_refused(tmp_path):
    path = written(tmp_path, good(steady).assign(tau_X=-0.4))
    with pytest.raises(InputError, match=r"tau_X is -0.4 N in all rows, and the motion needs 0\.\d+ N"):
        diagnosis.load(path)


def test_column_of_an_axis_without_commands_may_be_absent(tmp_path):
    (w,) = diagnosis.load(written(tmp_path, good(steady).drop(columns="tau_Y")))
    assert (w.run.tau_cmd[:, 1] == 0.0).all()
    assert "no column tau_Y: zero is used" in w.run.notes


def test_column_of_an_axis_with_commands_may_not_be_absent(tmp_path):
    with pytest.raises(InputError, match="no column tau_Y, and the motion needs"):
        diagnosis.load(written(tmp_path, good().drop(columns="tau_Y")))
    with pytest.raises(InputError, match="no column 'tau_Y'; did you mean 'Tau_y'"):
        diagnosis.load(written(tmp_path, good().rename(columns={"tau_Y": "Tau_y"})))


@pytest.mark.slow
def test_where_nothing_is_a_signal_nothing_is_found(monkeypatch):
    """Once errors are weighed by what every candidate leaves, none of them may have any signal."""
    ranked = []
    weighted = shortlist.weighted

    def none_the_second_time(*arguments):
        ranked.append(weighted(*arguments))
        if len(ranked) > 1:
            ranked[-1].order.clear()
        return ranked[-1]

    monkeypatch.setattr(shortlist, "weighted", none_the_second_time)
    monkeypatch.setattr(shortlist, "CHANGED", 1.0 + 1e-9)
    found = diagnosis.diagnose(voyages(1, 120.0, {"delta_X_u": -2.0}))
    assert len(ranked) > 1
    assert not found.learned.effects


def test_every_way_makes_a_table_and_spares_the_good_one():
    table = good()
    for way in WAYS.values():
        before = table.copy()
        made = way.spoil(table, np.random.default_rng(0))
        assert list(made.columns)[:4] == ["time", *POSE]
        pd.testing.assert_frame_equal(table, before)


def test_only_an_absent_cause_told_with_confidence_is_wrong():
    assert Outcome("a", "claim", "found", {"mass": 0.91}, {"mass": 0.91}).wrong
    assert Outcome("a", "traceback", "IndexError").wrong
    assert not Outcome("a", "claim", "found", {"mass": 0.5}, {"mass": 0.5}).wrong
    assert not Outcome("a", "kept", "found", {"X_u": 0.99}).wrong


def test_refusal_is_told_without_the_folder():
    stated = outcome("const_tau", good(), ["X_u"], 0)
    assert (stated.kind, stated.wrong) == ("refused", False)
    assert "tmp" not in stated.text


def test_models_that_differ_in_the_measurement_alone_are_predicted_together():
    """As of a heading that is off: only that channel of the pose differs between the models."""
    w = diagnosis.Windows([windows().smoothed])
    alone = [w.residuals(Model(vessel={"heading_offset": offset})) for offset in (0.0, 0.1)]
    together = w.residuals(Model(vessel={"heading_offset": np.array([[0.0], [0.1]])}))
    np.testing.assert_allclose(together, np.stack(alone), atol=1e-9)
