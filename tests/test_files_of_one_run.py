"""Files of one run as one table: topics with rows of their own, parts that follow, one value in a row."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.command import command

from cosim import InputError
from diagnosis import join
from diagnosis.predictors import ship_with
from diagnosis.runs import one_table, prepare, propose, read

TANKER = ship_with((), "kvlcc2")
COMMANDS = ["propeller.n", "rudder.delta"]
POSE = ["x", "y", "psi"]


def sailed(seconds: float = 60.0, step: float = 0.1) -> pd.DataFrame:
    """A tanker on a weaving course, by the names and units of signals."""
    t = np.round(np.arange(0.0, seconds, step), 9)
    psi = 0.4 * np.sin(0.1 * t)
    noise = np.random.default_rng(7).normal(0.0, 1e-3, (3, t.size))
    return pd.DataFrame(
        {
            "time": t,
            "x": np.cumsum(0.8 * step * np.cos(psi)) + noise[0],
            "y": np.cumsum(0.8 * step * np.sin(psi)) + noise[1],
            "psi": psi + noise[2],
            "propeller.n": 9.0 + np.sign(np.sin(0.3 * t)),
            "rudder.delta": 0.3 * np.sign(np.cos(0.1 * t)),
        }
    )


def topic(folder: Path, name: str, table: pd.DataFrame, columns: list[str], late: float = 0.0) -> Path:
    """A file of some columns, its stamps later by a part of a row."""
    path = folder / f"{name}.csv"
    own = table[["time", *columns]].assign(time=table["time"] + late)
    own.to_csv(path, index=False)
    return path


@settings(
    max_examples=10,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
    database=None,
)
@given(order=st.permutations(["pose", "propeller", "rudder"]))
def test_topics_of_the_same_stamps_are_the_table_that_they_are_parts_of(
    tmp_path: Path, order: list[str]
) -> None:
    table = sailed()
    files = {
        "pose": topic(tmp_path, "pose", table, POSE),
        "propeller": topic(tmp_path, "propeller", table, ["propeller.n"]),
        "rudder": topic(tmp_path, "rudder", table, ["rudder.delta"]),
    }
    joined = one_table([files[name] for name in order])
    assert len(joined) == 3 * len(table)
    assert (np.diff(joined["time"]) >= 0.0).all()
    joined.to_csv(tmp_path / "run.csv", index=False)
    table.to_csv(tmp_path / "whole.csv", index=False)
    run, whole = (prepare(tmp_path / name, TANKER).track.run for name in ("run.csv", "whole.csv"))
    np.testing.assert_array_equal(run.time, whole.time)
    np.testing.assert_allclose(run.pose, whole.pose, rtol=1e-12)
    np.testing.assert_array_equal(run.commands, whole.commands)


def test_commands_that_are_written_when_they_change_are_held_between(tmp_path: Path) -> None:
    table = sailed()
    changed = table[COMMANDS].ne(table[COMMANDS].shift()).any(axis=1)
    files = [
        topic(tmp_path, "pose", table, POSE),
        topic(tmp_path, "orders", table[changed], COMMANDS, late=-0.02),
    ]
    one_table(files).to_csv(tmp_path / "run.csv", index=False)
    track = prepare(tmp_path / "run.csv", TANKER).track
    assert (track.silences == 0).all()
    there = np.isin(np.round(track.run.time, 6), table["time"])
    assert there.sum() == len(table)
    assert track.run.commands is not None
    np.testing.assert_array_equal(track.run.commands[there], table[COMMANDS].to_numpy())


def test_a_command_that_stops_is_not_known_from_then_on(tmp_path: Path) -> None:
    table = sailed()
    table.loc[table["time"] > 40.0, "rudder.delta"] = np.nan
    table.to_csv(tmp_path / "a.csv", index=False)
    track = prepare(tmp_path / "a.csv", TANKER).track
    silent = track.silences % 2 == 1
    np.testing.assert_array_equal(silent, track.run.time > 40.0)
    table.loc[table["time"] < 10.0, "propeller.n"] = np.nan
    table.to_csv(tmp_path / "a.csv", index=False)
    track = prepare(tmp_path / "a.csv", TANKER).track
    silent = track.silences % 2 == 1
    np.testing.assert_array_equal(silent, (track.run.time > 40.0) | (track.run.time < 10.0))


def test_files_with_the_same_columns_follow_each_other(tmp_path: Path) -> None:
    table = sailed()
    for name, rows in (("a", slice(0, 200)), ("b", slice(200, 450)), ("c", slice(450, None))):
        table[rows].to_csv(tmp_path / f"{name}.csv", index=False)
    joined = one_table([tmp_path / f"{name}.csv" for name in "cab"])
    pd.testing.assert_frame_equal(joined, table)
    table[190:450].to_csv(tmp_path / "b.csv", index=False)
    joined = one_table([tmp_path / f"{name}.csv" for name in "cab"])
    pd.testing.assert_frame_equal(joined, table)


def test_files_with_the_same_columns_at_the_same_time_are_those_of_two_devices(tmp_path: Path) -> None:
    bow = topic(tmp_path, "bow", table := sailed(), POSE)
    stern = topic(tmp_path, "stern", table + 1.0, POSE, late=-0.98)
    joined = one_table([bow, stern])
    assert set(joined) == {"time", *POSE, *(f"stern.{name}" for name in POSE)}
    assert joined[POSE].notna().any(axis=1).sum() == len(table)
    assert (joined["stern.x"].dropna().to_numpy() == table["x"].to_numpy() + 1.0).all()


@pytest.mark.parametrize(
    ("stamps", "value", "unit"), [(False, "Value", "unit"), (True, "Wert", "Einheit")]
)
def test_each_name_of_a_table_with_one_value_in_a_row_is_a_column(
    tmp_path: Path, stamps: bool, value: str, unit: str
) -> None:
    table = sailed(20.0)
    long = table.melt(id_vars="time", var_name="tag", value_name=value)
    long[unit] = long["tag"].map(dict.fromkeys(("x", "y"), "m"))
    long = long.sort_values("time", kind="stable")
    if stamps:
        at = pd.Timestamp("2026-03-01T10:00:00") + pd.to_timedelta(long["time"], unit="s")
        long["time"] = at.dt.strftime("%Y-%m-%dT%H:%M:%S.%fZ")
    long.to_csv(tmp_path / "historian.csv", index=False)
    joined = one_table([tmp_path / "historian.csv"])
    assert set(joined) == {"time", "x [m]", "y [m]", "psi", *COMMANDS}
    np.testing.assert_allclose(joined["time"], table["time"], atol=1e-6)
    np.testing.assert_allclose(joined["x [m]"], table["x"])
    np.testing.assert_allclose(joined[COMMANDS], table[COMMANDS])


def test_values_of_one_name_and_stamp_have_rows_of_their_own(tmp_path: Path) -> None:
    rows = [(0.0, "a", 1.0), (0.0, "b", 2.0), (0.0, "a", 3.0), (1.0, "b", 4.0), (1.0, "a", 5.0)]
    pd.DataFrame(rows, columns=["time", "name", "value"]).to_csv(tmp_path / "l.csv", index=False)
    joined = one_table([tmp_path / "l.csv"])
    assert joined["time"].tolist() == [0.0, 0.0, 1.0]
    assert joined["a"].tolist() == [1.0, 3.0, 5.0]
    assert joined["b"].dropna().tolist() == [2.0, 4.0]


def test_a_value_that_is_no_number_is_in_the_column_of_its_name(tmp_path: Path) -> None:
    rows = [(0.0, "a", "1"), (0.0, "state", "auto"), (1.0, "a", "2"), (1.0, "state", "off")]
    pd.DataFrame(rows, columns=["time", "name", "value"]).to_csv(tmp_path / "l.csv", index=False)
    joined = one_table([tmp_path / "l.csv"])
    assert joined["a"].tolist() == ["1", "2"]
    assert joined["state"].tolist() == ["auto", "off"]


def test_clocks_of_other_units_are_one(tmp_path: Path) -> None:
    table = sailed()
    pose = topic(tmp_path, "pose", table, POSE)
    table.assign(**{"t [ms]": 1e3 * table["time"]})[["t [ms]", *COMMANDS]].to_csv(
        tmp_path / "orders.csv", index=False
    )
    joined = one_table([pose, tmp_path / "orders.csv"])
    own = joined[joined["propeller.n"].notna()]
    np.testing.assert_allclose(own["time"], table["time"], atol=1e-9)
    # One whose unit is not told has no time in common; the file beside it tells it.
    table.assign(time=1e6 * (10.0 + table["time"]))[["time", *COMMANDS]].to_csv(
        tmp_path / "orders.csv", index=False
    )
    with pytest.raises(InputError, match=r"have no time in common: 0 to 59\.9, 10000000 to"):
        one_table([pose, tmp_path / "orders.csv"])
    stated = {"columns": {"time": {"name": "time", "unit": "us", "offset": -1e7}}}
    (tmp_path / "orders.csv.json").write_text(json.dumps(stated))
    joined = one_table([pose, tmp_path / "orders.csv"])
    own = joined[joined["propeller.n"].notna()]
    np.testing.assert_allclose(own["time"], table["time"], atol=1e-9)


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e-3, "ms"), (1e6, "us"), (2.0, None)])
def test_files_that_last_as_long_but_for_a_unit_are_refused(
    tmp_path: Path, factor: float, unit: str | None
) -> None:
    """They overlap, as both begin with zero; the longer one is in the smaller unit."""
    table = sailed()
    pose = topic(tmp_path, "pose", table, POSE)
    orders = topic(tmp_path, "orders", table.assign(time=factor * table["time"]), COMMANDS)
    if unit is None:
        assert len(one_table([pose, orders])) == 2 * len(table)
        return
    longer = orders if factor > 1.0 else pose
    line = f'"unit": "{unit}".*into \'{re.escape(str(longer))}.json\''
    with pytest.raises(InputError, match=f"different units: .*{line}"):
        one_table([pose, orders])


def test_stamps_of_messages_and_names_that_repeat(tmp_path: Path) -> None:
    table = sailed()
    stamp = {
        "header.stamp.sec": 1.7e9 + np.floor(table["time"]),
        "header.stamp.nanosec": 1e9 * (table["time"] % 1),
    }
    for name, columns in (("odom", POSE), ("orders", COMMANDS)):
        own = table[columns].assign(**stamp, seq=range(len(table)))
        own.to_csv(tmp_path / f"{name}.csv", index=False)
    joined = one_table([tmp_path / "odom.csv", tmp_path / "orders.csv"])
    assert list(joined) == ["time", *POSE, "seq", *COMMANDS, "orders.seq"]
    own = joined[joined["x"].notna()]
    np.testing.assert_allclose(own["time"] - 1.7e9, table["time"], atol=1e-6)


def test_units_that_stand_below_a_name_stand_behind_it(tmp_path: Path) -> None:
    lines = ["time;North;Rudder", "s;mm;deg", "0,0;1,5;2,5", "0,1;2,5;3,5", "0,2;3,5;3,5"]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    joined = one_table([tmp_path / "a.csv"])
    assert list(joined) == ["time", "North [mm]", "Rudder [deg]"]
    assert joined["North [mm]"].tolist() == [1.5, 2.5, 3.5]


def test_files_that_have_no_clock_in_common_are_refused(tmp_path: Path) -> None:
    table = sailed()
    pose = topic(tmp_path, "pose", table, POSE)
    dated = table.assign(
        time=(pd.Timestamp("2026-03-01") + pd.to_timedelta(table["time"], unit="s")).astype(str)
    )
    dated[["time", *COMMANDS]].to_csv(tmp_path / "orders.csv", index=False)
    with pytest.raises(InputError, match=r"has date stamps, '.*pose\.csv' numbers"):
        one_table([pose, tmp_path / "orders.csv"])
    table.rename(columns={"time": "k"})[["k", *COMMANDS]].to_csv(tmp_path / "orders.csv", index=False)
    with pytest.raises(
        InputError, match=r"no column of '.*' is known as its time; its columns: k, propeller"
    ):
        one_table([pose, tmp_path / "orders.csv"])
    with pytest.raises(InputError, match=r"no such file: 'gone\.csv'"):
        one_table([pose, Path("gone.csv")])
    with pytest.raises(InputError, match="is a folder"):
        one_table([pose, tmp_path])
    with pytest.raises(InputError, match="is given more than once"):
        one_table([pose, pose.parent / "." / pose.name])
    (tmp_path / "twice.csv").write_text("time,a,a\n0,1,2\n1,2,3\n")
    with pytest.raises(InputError, match="has more than one column 'a'"):
        one_table([tmp_path / "twice.csv"])


def test_the_command_writes_a_table_that_is_proposed_and_read(tmp_path: Path) -> None:
    table = sailed()
    files = [topic(tmp_path, "pose", table, POSE), topic(tmp_path, "orders", table, COMMANDS)]
    out = tmp_path / "run.csv"
    done = command(join.main, *files, "--out", out)
    assert done.returncode == 0
    assert "columns time, x, y, psi, propeller.n, rudder.delta" in " ".join(done.stdout.split())
    assert propose(out, TANKER).run is not None
    assert read(out, of=TANKER).commands is not None
    before = out.read_bytes()
    for arguments, message in (
        ((*files, "--out", out), "--overwrite replaces it"),
        ((*files, "--out", tmp_path / "run.txt"), "ends neither in .csv nor in .parquet"),
        ((tmp_path / "gone.csv", "--out", out, "--overwrite"), "no such file"),
    ):
        done = command(join.main, *arguments)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert message in done.stderr
    assert out.read_bytes() == before
    assert not (tmp_path / "run.txt").exists()
    assert command(join.main, *files, "--out", tmp_path / "run.parquet").returncode == 0
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "run.parquet"), pd.read_csv(out))


@pytest.mark.parametrize("form", ["%Y-%m-%dT%H:%M:%S.%fZ", "%d.%m.%Y %H:%M:%S.%f"])
def test_date_stamps_and_seconds_since_1970_are_one_clock(tmp_path: Path, form: str) -> None:
    table = sailed(20.0)
    begin = pd.Timestamp("2026-11-29T23:59:50", tz="UTC")
    at = begin + pd.to_timedelta(table["time"], unit="s")
    pose, orders = table[POSE], table[COMMANDS].iloc[::5]
    pose.assign(time=at.dt.strftime(form)).to_csv(tmp_path / "pose.csv", index=False)
    unix = (1e3 * (begin.timestamp() + table["time"])).iloc[::5]
    orders.assign(**{"time [ms]": unix.map("{:.0f}".format)}).to_csv(
        tmp_path / "orders.csv", index=False
    )
    joined = one_table([tmp_path / "pose.csv", tmp_path / "orders.csv"])
    there = joined["x"].notna()
    np.testing.assert_allclose(joined["time"][there], table["time"], atol=1e-3)
    np.testing.assert_allclose(joined["time"][~there], table["time"].iloc[::5], atol=1e-3)
