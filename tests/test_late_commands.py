"""Commands that are logged late: the column, the time and the line that mends it; else nothing."""

import json
import re
from functools import cache

import numpy as np
import pandas as pd
import pytest
from support.measured import jumps, sail, slow_swings, table_of
from support.project import ROOT

import diagnosis
from benchmarks.ship_effects import Cause, causes
from benchmarks.ship_effects import sail as sail_of
from diagnosis import InputError, Model
from diagnosis.assessment.gathering import gather
from diagnosis.assessment.late_commands import Timing
from diagnosis.predictors import ship_with

H, LATE = 0.1, 4  # s, rows


@cache
def made(given=jumps, **ship):
    """A run of three minutes, with a drag that its model has not."""
    return table_of(sail(180.0, H, ship={"delta_X_u": -2.0, **ship}, given=given)[0])


@cache
def otter(cause, seconds=120.0):
    ship = ship_with((), "otter")
    return sail_of(ship, causes(ship)[cause], np.random.default_rng(1), None, seconds=seconds)


def late(table, *names, rows=LATE):
    """The table, some columns of which are logged so many rows late."""
    return table.assign(**{n: table[n].shift(rows).bfill().ffill() for n in names})


def lines(folder, table, ship=None):
    path = folder / "a.csv"
    table.to_csv(path, index=False)
    (w,) = gather([path], model=Model(ship=ship_with((), ship)) if ship else None)
    return path, [line for line in w.smoothed.notes if " late (odds" in line]


@pytest.mark.parametrize("late", [0.0, 0.2, 0.5, 1.0, 1.7, 3.0])
def test_a_command_that_is_late_by_a_part_of_a_row_is_its_mean_over_the_row(late, tmp_path):
    """Such as an angle that is sampled: between two rows it acts half a row earlier."""
    table = made().iloc[:200]
    fine = np.repeat(table["tau_X"].to_numpy(), 10)  # held, at a tenth of a row
    rows = np.arange(len(table) - 5) * 10 + round(10 * late)
    expected = np.array([fine[k : k + 10].mean() for k in rows])
    path = tmp_path / "a.csv"
    table.to_csv(path, index=False)
    path.with_name("a.csv.json").write_text(
        json.dumps({"columns": {"tau_X": {"name": "tau_X", "late": late * H}}})
    )
    run = diagnosis.read(path)
    np.testing.assert_allclose(run.tau_cmd[: rows.size, 0], expected, rtol=1e-9)
    np.testing.assert_array_equal(run.tau_cmd[:, 1:], table[["tau_Y", "tau_N"]])


@pytest.mark.quick
def test_a_late_command_is_reported_with_its_odds(tmp_path):
    _, (line,) = lines(tmp_path, late(made(), "tau_X"))
    assert line.startswith("tau_X: probably logged 0.4 s late (odds more than 10^6 : 1)")


def test_late_commands_are_reported_together_with_the_line_that_mends_them(tmp_path):
    names = ["tau_X", "tau_Y", "tau_N"]
    path, (line,) = lines(tmp_path, late(made(), *names))
    assert line.startswith(
        f"{' and '.join(names)}: probably logged 0.4 s late (odds more than 10^6 : 1)"
    )
    stated = json.loads(line[line.index("put ") + 4 : line.rindex(" into ")])
    assert stated["columns"].keys() == {*names}
    path.with_name("a.csv.json").write_text(json.dumps(stated))
    (mended,) = gather([path])
    assert not any(" late (odds" in note for note in mended.smoothed.notes)
    given = made()[["tau_X", "tau_Y", "tau_N"]].to_numpy()
    np.testing.assert_allclose(mended.run.tau_cmd[:-LATE], given[:-LATE])


def test_a_late_actuator_of_a_described_ship_is_named(tmp_path):
    table = otter("drag", 200.0)
    names = [*table.columns[4:]]
    h = float(np.median(np.diff(table["time"])))
    _, (line,) = lines(tmp_path, late(table, names[1], rows=LATE), "otter")
    assert line.startswith(f"{names[1]}: probably logged {LATE * h:.2g} s late")


@pytest.mark.parametrize("rows", [pytest.param(0, marks=pytest.mark.quick), -LATE])
def test_of_commands_in_time_or_early_nothing_is_reported(rows, tmp_path):
    assert not lines(tmp_path, late(made(), "tau_X", rows=rows))[1]


@pytest.mark.quick
def test_commands_that_change_slowly_do_not_show_it(tmp_path):
    assert not lines(tmp_path, late(made(slow_swings), "tau_X"))[1]


def test_a_controller_that_commands_what_its_ship_has_just_done_is_not_late(tmp_path):
    """The moment follows the yaw acceleration by 0.4 s, with a size that is not the force's."""
    table = made()
    r = np.gradient(np.unwrap(table["psi"]), H)
    acceleration = pd.Series(np.gradient(r, H)).rolling(5, center=True, min_periods=1).mean()
    assert not lines(tmp_path, late(table.assign(tau_N=acceleration.clip(-0.3, 0.3)), "tau_N"))[1]


@pytest.mark.parametrize("cause", ["lag", "current"])
def test_effects_are_not_late_commands(cause, tmp_path):
    assert not lines(tmp_path, otter(cause), "otter")[1]


@pytest.mark.parametrize("faster", [2.0, 4.0, None])
def test_actuators_that_turn_faster_are_a_rival_of_late_commands(faster, tmp_path):
    """Twice as fast as described, four times, or without a limit."""
    text = (ROOT / "ships" / "otter.toml").read_text()
    path = tmp_path / "limited.toml"
    path.write_text(re.sub("^lag = .*$", "n_rate = 10.0", text, flags=re.M))
    ship = ship_with((), path)
    model = Model(ship=ship)
    assert model.rates == {f"plant_{side}_n_rate": 10.0 for side in ("port", "starboard")}
    real = dict.fromkeys(model.rates, 0.0 if faster is None else faster * 10.0)
    table = sail_of(ship, Cause("", {}, real), np.random.default_rng(1), None, seconds=60.0)
    table.to_csv(tmp_path / "a.csv", index=False)
    (w,) = gather([tmp_path / "a.csv"], model=model)
    timing = Timing(w, model)
    nearest = max(timing.rivals([0, 1], np.array([0.2])), key=lambda score: score.total)
    true = timing.force((), 0.0, model.plus({n: v - 10.0 for n, v in real.items()}))
    assert nearest.total == pytest.approx(timing.score(true).total)


def test_a_pose_is_not_late(tmp_path):
    path = tmp_path / "a.csv"
    made().to_csv(path, index=False)
    path.with_name("a.csv.json").write_text(json.dumps({"columns": {"x": {"name": "x", "late": 0.4}}}))
    with pytest.raises(InputError, match=r"x\.late is 0\.4"):
        diagnosis.load(path)
