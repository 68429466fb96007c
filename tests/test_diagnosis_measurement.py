"""Reading measured runs: every form of file gives the same run, and every mistake one line."""

import json
import re
import tracemalloc

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError
from scipy.io import savemat
from support.closed_form import Allocation, thrust
from support.command import command
from support.cse1 import FIVE, POWER, THREE
from support.measured import DATA, needs_data

import cosim
import diagnosis
from diagnosis import propose_columns
from diagnosis.runs import propose
from diagnosis.runs.columns.columns import TAU, Column, Layout
from diagnosis.runs.files.tables import csv_table
from fmus.ship import ship

N = 400
RNG = np.random.default_rng(0)
TIME = np.arange(N) * 0.05
POSE = RNG.uniform(-3.0, 3.0, (N, 3))
SHARES = RNG.uniform(-1.0, 1.0, (N, 5))
TAU_CMD = np.column_stack(thrust(*SHARES[:, :3].T, Allocation()))


def table(**groups):
    """A table with time and pose, and commands by the names of their columns."""
    columns = {"time": TIME, "x": POSE[:, 0], "y": POSE[:, 1], "psi": POSE[:, 2]}
    return pd.DataFrame(columns | groups)


def with_tau():
    return table(**dict(zip(TAU, TAU_CMD.T, strict=True)))


def same(a, b):
    np.testing.assert_array_equal(a.time, b.time)
    np.testing.assert_array_equal(a.pose, b.pose)
    np.testing.assert_array_equal(a.tau_cmd, b.tau_cmd)


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_what_was_written_is_read(tmp_path, kind):
    path = tmp_path / f"mine.{kind}"
    getattr(with_tau(), f"to_{kind}")(path, index=False)
    run = diagnosis.read(path)
    assert run.name == "mine"
    np.testing.assert_allclose(run.time, TIME, rtol=1e-15)
    np.testing.assert_allclose(run.pose, POSE, rtol=1e-15)
    np.testing.assert_allclose(run.tau_cmd, TAU_CMD, rtol=1e-12, atol=1e-15)
    assert run.commands is None


def test_commands_become_the_force_that_they_mean(tmp_path):
    table(**dict(zip(THREE, SHARES[:, :3].T, strict=True))).to_csv(tmp_path / "a.csv", index=False)
    run = diagnosis.read(tmp_path / "a.csv")
    np.testing.assert_allclose(run.commands, SHARES[:, :3], rtol=1e-15)
    np.testing.assert_allclose(run.tau_cmd, TAU_CMD, rtol=1e-12, atol=1e-15)


def test_five_commands_stay_five(tmp_path):
    table(**dict(zip(FIVE, SHARES.T, strict=True))).to_csv(tmp_path / "a.csv", index=False)
    run = diagnosis.read(tmp_path / "a.csv")
    np.testing.assert_allclose(run.commands, SHARES, rtol=1e-15)
    np.testing.assert_allclose(run.tau_cmd, ship().commanded_force(SHARES), rtol=1e-12, atol=1e-15)


def test_force_of_five_commands():
    assert ship().commanded_force(np.array([[1.0, 0.0, 1.0, 0.0, 0.0]]))[0] == pytest.approx(
        [2.33, 0.0, 0.0]
    )
    port_only = ship().commanded_force(np.array([[1.0, 0.0, 0.0, 0.0, 0.0]]))[0]
    assert port_only[2] == pytest.approx(0.055 * 1.165), (
        "the propeller to port turns the bow to starboard"
    )
    bow = ship().commanded_force(np.array([[0.0, 0.0, 0.0, 0.0, 1.0]]))[0]
    assert bow == pytest.approx([0.0, 2.629, 2.629 * 0.3875])
    both = np.array([[0.3, -0.2, 0.3, -0.2, 0.0]])
    assert ship().commanded_force(both)[0] == pytest.approx(
        2.0 * np.array(thrust(0.3, -0.2, 0.0, Allocation()))
    )


def test_names_units_and_axes_are_told_in_a_file_beside(tmp_path):
    other = pd.DataFrame(
        {
            "t": 1e3 * TIME,
            "North": POSE[:, 0],
            "West": -1e3 * POSE[:, 1],
            "Mathematical": 90.0 - np.degrees(POSE[:, 2]),
            "tau_X": TAU_CMD[:, 0],
            "tau_Y": TAU_CMD[:, 1],
            "Moment": 1e3 * TAU_CMD[:, 2],
        }
    )
    layout = {
        "separator": ";",
        "decimal": ",",
        "columns": {
            "time": {"name": "t", "unit": "ms"},
            "x": "North",
            "y": {"name": "West", "unit": "mm", "flip": True},
            "psi": {"name": "Mathematical", "unit": "deg", "flip": True, "offset": 90},
            "tau_N": {"name": "Moment", "unit": "N.mm"},
        },
    }
    other.to_csv(tmp_path / "a.csv", index=False, sep=";", decimal=",")
    (tmp_path / "a.csv.json").write_text(json.dumps(layout))
    run = diagnosis.read(tmp_path / "a.csv")
    np.testing.assert_allclose(run.time, TIME, atol=1e-12)
    np.testing.assert_allclose(run.pose, POSE, atol=1e-12)
    np.testing.assert_allclose(run.tau_cmd, TAU_CMD, atol=1e-12)


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_date_stamps_feet_and_any_factor(tmp_path, kind):
    stamps = pd.Timestamp("2026-11-20T09:30:00Z") + pd.to_timedelta(TIME, unit="s")
    other = with_tau().assign(time=stamps, x=POSE[:, 0] / 0.3048, y=POSE[:, 1] / 7.0)
    columns = {"x": {"name": "x", "unit": "ft"}, "y": {"name": "y", "factor": 7.0}}
    path = tmp_path / f"a.{kind}"
    if kind == "csv":  # ISO 8601 has the comma as well
        other.to_csv(path, index=False, date_format="%Y-%m-%dT%H:%M:%S,%fZ")
    else:
        other.to_parquet(path)
    (tmp_path / f"a.{kind}.json").write_text(json.dumps({"columns": columns}))
    run = diagnosis.read(path)
    np.testing.assert_allclose(run.time, TIME - TIME[0], atol=1e-6)
    np.testing.assert_allclose(run.pose, POSE, atol=1e-9)


@pytest.mark.parametrize(("unit", "per"), [("s", 1.0), ("ms", 1e-3)])
def test_times_of_an_epoch_count_from_the_first(tmp_path, unit, per):
    other = with_tau().assign(time=np.round((TIME + 1.765e9) / per))
    other.to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "a.csv.json").write_text(
        json.dumps({"columns": {"time": {"name": "time", "unit": unit}}})
    )
    expected = np.round((TIME + 1.765e9) / per) * per
    np.testing.assert_allclose(
        diagnosis.read(tmp_path / "a.csv").time, expected - expected[0], atol=1e-5
    )


def test_first_stamp_that_is_none_is_told(tmp_path):
    stamps = (pd.Timestamp("2026-11-20T09:30:00Z") + pd.to_timedelta(TIME, unit="s")).astype(str)
    path = tmp_path / "a.csv"
    with_tau().assign(time=np.where(np.arange(N) == 7, "9 o'clock", stamps)).to_csv(path, index=False)
    refused(path, 'time = "9 o\'clock" in row 8 is not a time stamp of ISO 8601')
    words = [*stamps[:3], "noon", *stamps[4:7], "9 o'clock", *stamps[8:]]
    with_tau().assign(time=words).to_csv(path, index=False)
    refused(path, 'time = "9 o\'clock" in row 8')  # a row of words before it counts


def test_unit_that_cannot_be_is_told_with_the_own_name_of_the_column(tmp_path):
    t = np.arange(0.0, 20.0, 0.05)
    turning = np.mod(10.0 * t, 360.0)
    run = pd.DataFrame({"time": t, "x": 0.1 * t, "y": 0.0 * t + 0.01 * np.sin(t), "Hdg [deg]": turning})
    run = run.assign(**dict.fromkeys(TAU, np.sin(t)))
    run.to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "a.csv.json").write_text(json.dumps({"columns": {"psi": "Hdg [deg]"}}))
    with pytest.raises(cosim.InputError, match=re.escape('"psi": {"name": "Hdg [deg]", "unit": "deg"}')):
        diagnosis.clean(diagnosis.read(tmp_path / "a.csv"))


def test_of_a_log_only_what_a_ship_would_tell_is_read(ellipse, tmp_path):
    result = cosim.simulate(cosim.load_scenario(ellipse), tmp_path / "first")
    log = cosim.read_log(result.folder)
    run = diagnosis.read(result.folder)
    assert run.name == "first"
    same(run, diagnosis.read(result.folder / "log.csv"))
    for k, name in enumerate(("x_m", "y_m", "psi_m")):
        np.testing.assert_allclose(run.pose[:, k], log[f"observer.{name}"], rtol=1e-15)
    np.testing.assert_allclose(run.tau_cmd[:, 2], log["thrusters.tau_cmd_N"], rtol=1e-15)
    np.testing.assert_allclose(run.commands[:, 0], log["thrusters.u_vsp_x"], rtol=1e-15)
    assert np.abs(run.pose[:, 0] - log["vessel.x"]).max() > 1e-4, "noise is part of the measurement"
    stated = pd.DataFrame(log)
    for name in stated.columns:
        if name.startswith(("vessel.", "controller.", "guidance.")) or "_hat" in name:
            stated[name] = 1.0
    stated.to_csv(result.folder / "log.csv", index=False)
    (result.folder / "log.json").write_text('{"scenario": "another"}')
    same(run, diagnosis.read(result.folder))


def test_missing_commands_are_held_and_told(tmp_path):
    held = with_tau()
    held.loc[0:4, "tau_X"] = np.nan
    held.loc[10:12, "tau_X"] = np.nan
    held.to_csv(tmp_path / "a.csv", index=False)
    run = diagnosis.read(tmp_path / "a.csv")
    assert (run.tau_cmd[:5, 0] == 0.0).all()
    assert (run.tau_cmd[10:13, 0] == TAU_CMD[9, 0]).all()
    assert (run.tau_cmd[:, 1] == TAU_CMD[:, 1]).all()
    assert "missing" in run.notes[0]


def test_lost_poses_are_kept_as_they_are(tmp_path):
    lost = with_tau()
    lost.loc[5, "x"] = np.nan
    lost.loc[6, "psi"] = np.inf
    lost.to_csv(tmp_path / "a.csv", index=False)
    run = diagnosis.read(tmp_path / "a.csv")
    assert np.isnan(run.pose[5, 0])
    assert np.isinf(run.pose[6, 2])


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda t: t.drop(columns="psi").assign(psii=0.0), "no column 'psi'; did you mean 'psii'?"),
        (lambda t: t.drop(columns="time"), "no column 'time'"),
        (lambda t: t.rename(columns={"tau_Y": "Tau_y"}), "no column 'tau_Y'; did you mean 'Tau_y'?"),
        (lambda t: t.drop(columns=list(TAU)), "has no commands: tau_X, tau_Y, tau_N, or u_vsp_x"),
        (lambda t: t.assign(x="north"), "x = 'north' in row 1 is not a number"),
        (lambda t: t.assign(tau_X=np.nan), "the command tau_X has no value in any row; if it was never"),
        (lambda t: t.assign(u1=50.0, u2=0.0, u3=0.0, u4=0.0, u5=0.0), 'commands reach 50; allowed is -1 to 1; are they in percent? Then put {"columns": {"u1": {"name": "u1", "unit": "%"}'),
    ],
)  # fmt: skip
def test_wrong_table_is_refused_with_one_line(tmp_path, edit, message):
    edit(with_tau()).to_csv(tmp_path / "mine.csv", index=False)
    refused(tmp_path / "mine.csv", message)


@pytest.mark.parametrize(
    ("layout", "message"),
    [
        ({"columns": {"x": {"name": "x", "unit": "mn"}}}, "'mn' is not a unit of x; did you mean 'm'?"),
        (
            {"columns": {"psi": {"name": "psi", "unit": "m"}}},
            "'m' is not a unit of psi; there are rad, deg",
        ),
        ({"columns": {"pzi": "psi"}}, "'pzi' is not a signal of a run; did you mean 'psi'?"),
        ({"columns": {"x": "North"}}, "no column 'North' (for x)"),
        ({"columns": {"u1": "x"}}, "no column 'u2'"),
        ({"colums": {}}, "colums: unknown key; did you mean 'columns'?"),
        ({"columns": {"x": {"unit": "m"}}}, "columns.x.name: is missing"),
        ({"columns": {"x": {"name": "x", "faktor": 2}}}, "columns.x.faktor: unknown key; did you mean 'factor'?"),
        ({"columns": {"x": {"name": "x", "factor": 0}}}, "x.factor is 0; give another number"),
        ([1], "should be an object"),
    ],
)  # fmt: skip
def test_wrong_layout_is_refused_with_one_line(tmp_path, layout, message):
    with_tau().to_csv(tmp_path / "mine.csv", index=False)
    (tmp_path / "mine.csv.json").write_text(json.dumps(layout))
    refused(tmp_path / "mine.csv", message)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("mine.csv", b"", "mine.csv' is empty"),
        ("mine.csv", b"\xff\xfe\x00time", "probably in utf-16"),
        ("mine.csv", b"time,x\n1,2\n1,2,3,4\n", "mine.csv' has no commands"),
        ("mine.parquet", b"no parquet", "cannot be read as a table"),
        ("mine.mat", b"no matlab", "is not a measured run"),
        ("mine.csv.json", b"{", "mine.csv.json' has no"),
    ],
)
def test_unreadable_file_is_refused_with_one_line(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    refused(tmp_path / name, message)


def as_a_logger_writes_it(path, encoding="utf-8", decimal=".", sep=","):
    """A table with lines before the names, one of units below them, and a letter that is not ASCII."""
    table = with_tau().to_csv(index=False, sep=sep, decimal=decimal)
    names, rows = table.split("\n", 1)
    units = sep.join("s" if name == "time" else "SI" for name in names.split(sep))
    path.write_bytes(f"Schlepptank, Länge 12 m\n\n{names}\n{units}\n{rows}".encode(encoding))


@pytest.mark.parametrize(("encoding", "decimal", "sep"), [("utf-8", ".", ","), ("latin-1", ",", ";")])
def test_file_of_a_logger_is_read_when_it_was_told(tmp_path, encoding, decimal, sep):
    """Each refusal gives the whole line for the file beside it; in a few steps the run is there."""
    path, beside = tmp_path / "a.csv", tmp_path / "a.csv.json"
    as_a_logger_writes_it(path, encoding, decimal, sep)
    for _ in ("encoding", "skip and separator", "units_line", "decimal"):
        try:
            diagnosis.read(path)
        except diagnosis.InputError as error:
            beside.write_text(str(error).partition("put ")[2].partition(" into ")[0])
    found = diagnosis.read(path)
    assert {"skip", "units_line"} <= json.loads(beside.read_text()).keys()
    with_tau().to_csv(tmp_path / "b.csv", index=False)
    plain = diagnosis.read(tmp_path / "b.csv")
    assert np.array_equal(found.pose, plain.pose)
    assert np.array_equal(found.tau_cmd, plain.tau_cmd)
    assert np.array_equal(found.time, plain.time)


@pytest.mark.parametrize("encoding", ["latin-99", "zlib", "undefined"])
def test_unknown_encoding_is_refused(tmp_path, encoding):
    with_tau().to_csv(tmp_path / "a.csv", index=False)
    (tmp_path / "a.csv.json").write_text(json.dumps({"encoding": encoding}))
    refused(tmp_path / "a.csv", f"encoding: '{encoding}' is not an encoding")


@pytest.mark.parametrize(
    ("sep", "decimal", "line"),
    [
        (";", ".", '{"separator": ";"}'),
        (";", ",", '{"separator": ";", "decimal": ","}'),
        ("\t", ".", '{"separator": "\\t"}'),
    ],
)
def test_other_separator_is_told_with_its_line(tmp_path, sep, decimal, line):
    with_tau().to_csv(tmp_path / "a.csv", index=False, sep=sep, decimal=decimal)
    refused(tmp_path / "a.csv", f"put {line} into")
    (tmp_path / "a.csv.json").write_text(line)
    np.testing.assert_allclose(diagnosis.read(tmp_path / "a.csv").pose, POSE, rtol=1e-12)


def test_absent_file_suggests_the_nearest(tmp_path):
    with_tau().to_csv(tmp_path / "mine.csv", index=False)
    refused(tmp_path / "mime.csv", "did you mean 'mine.csv'?")
    refused(tmp_path, "log.csv is missing")


def test_matlab_matrix_of_another_kind_is_refused(tmp_path):
    savemat(tmp_path / "a.mat", {"cse1_data": np.zeros((5, 100))})
    refused(tmp_path / "a.mat", "a matrix of shape (5, 100)")
    savemat(tmp_path / "a.mat", {"other": np.zeros((5, 100))})
    refused(tmp_path / "a.mat", "it has no 'cse1_data'")


def matlab(path, by_hand, steered):
    """A file of NTNU with two stretches, whose power settings are given."""
    data = np.zeros((16, N))  # what follows the two power settings is not read
    data[0], data[[1, 2, 6]], data[7:12] = TIME, POSE.T, SHARES.T
    half = N // 2
    data[10, half:] = data[8, half:]  # a controller asks the same of both VSP in sway
    data[12:14, :half], data[12:14, half:] = np.array([by_hand, steered])[:, :, None]
    savemat(path, {"cse1_data": data})
    return diagnosis.read(path)


def test_power_settings_change_places_when_a_controller_steers(tmp_path):
    run = matlab(tmp_path / "a.mat", by_hand=(1.0, 0.2), steered=(0.4, 0.5))
    np.testing.assert_allclose(run.power[: N // 2], np.tile([0.25, 2.0], (N // 2, 1)), rtol=1e-12)
    np.testing.assert_allclose(run.power[N // 2 :], np.ones((N // 2, 2)), rtol=1e-12)
    vsp_only, bow_only = run.commands * [1, 1, 1, 1, 0], run.commands * [0, 0, 0, 0, 1]
    expected = run.power[:, :1] * ship().commanded_force(vsp_only) + run.power[
        :, 1:
    ] * ship().commanded_force(bow_only)
    np.testing.assert_allclose(run.tau_cmd, expected, atol=1e-12)


def test_without_power_there_is_no_force(tmp_path):
    run = matlab(tmp_path / "a.mat", by_hand=(0.0, -0.1), steered=(0.0, 0.0))
    assert (run.tau_cmd == 0.0).all()


def test_power_may_be_told_beside_the_five_commands(tmp_path):
    columns = dict(zip(FIVE, SHARES.T, strict=True)) | {"power_vsp": 50.0, "power_bow": 100.0}
    table(**columns).to_csv(tmp_path / "a.csv", index=False)
    stated = {name: {"name": name, "unit": "%"} for name in POWER}
    (tmp_path / "a.csv.json").write_text(json.dumps({"columns": stated}))
    run = diagnosis.read(tmp_path / "a.csv")
    np.testing.assert_allclose(run.tau_cmd[:, 0], 0.5 * ship().commanded_force(SHARES)[:, 0], atol=1e-12)


def refused(path, message):
    with pytest.raises(diagnosis.InputError) as error:
        diagnosis.read(path)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@needs_data
def test_measured_runs_are_read():
    for path in sorted((DATA / "cse1").glob("*.mat")):
        run = diagnosis.read(path)
        assert run.name == path.stem
        assert run.commands.shape == (run.time.size, 5)
        assert np.median(np.diff(run.time)) == pytest.approx(0.05)
        most = np.abs(run.tau_cmd[:, 0]).max()
        assert most == pytest.approx(2.33 * run.power[:, 0].max(), rel=0.01), "full ahead, once"


@pytest.mark.parametrize(("made", "field"), [(Column(name="x"), "factor"), (Layout(), "skip")])
def test_a_description_of_a_file_does_not_change(made, field):
    with pytest.raises(ValidationError, match="frozen"):
        setattr(made, field, 1)


def test_columns_of_a_large_file_take_less_memory_than_the_file(tmp_path):
    path = tmp_path / "wide.csv"
    path.write_text("time,x,other\n" + "".join(f"{k},{2 * k},{'9' * 1000}\n" for k in range(20_000)))
    tracemalloc.start()
    try:
        table = csv_table(path, Layout(), {"time", "x"})
        assert set(table) <= {"time", "x"}
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert (table["x"] == 2 * table["time"]).all()
    assert len(table) == 20_000
    assert most < 0.5 * path.stat().st_size


def test_a_row_with_more_cells_than_names_is_refused(tmp_path):
    """A decimal comma in one row shifts its cells; separators at the ends of rows shift none."""
    path = tmp_path / "a.csv"
    with_tau().to_csv(path, index=False)
    names, *rows = path.read_text().splitlines()
    good = diagnosis.read(path)
    for end in (",", ",,", ', " "'):
        path.write_text("\n".join([names, *(row + end for row in rows)]))
        np.testing.assert_array_equal(diagnosis.read(path).pose, good.pose)
    path.write_text("\n".join([names, *rows[:4], rows[4].replace(".", ",", 1), *rows[5:]]))
    with pytest.raises(cosim.InputError, match="line 6 has more cells than the 7 names"):
        diagnosis.read(path)
    path.write_text("\n".join([f"{names},note", *(f'{row},"to port, then back"' for row in rows)]))
    np.testing.assert_array_equal(diagnosis.read(path).pose, good.pose)


def test_roles_of_a_log_are_its_names(tmp_path):
    """A system with instances of other names: the pose and the force are those that its roles state."""
    roles = {"pose": ["boat.n", "boat.e", "boat.h"], "force": ["jets.a", "jets.b", "jets.c"]}
    names = dict(zip(("x", "y", "psi", *TAU), [*roles["pose"], *roles["force"]], strict=True))
    with_tau().rename(columns=names).to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(cosim.InputError, match="has no commands"):
        diagnosis.read(tmp_path)
    stated = {"metrics": {"from": None, "to": None}, "roles": roles}
    (tmp_path / "log.json").write_text(json.dumps({"scenario": stated}))
    with_tau().to_csv(tmp_path / "plain.csv", index=False)
    same(diagnosis.read(tmp_path), diagnosis.read(tmp_path / "plain.csv"))


FOREIGN = {
    "time": "Time [ms]", "x": "North (mm)", "y": "West", "psi": "Heading_deg",
    "tau_X": "Surge force", "tau_Y": "Sway force [mN]", "tau_N": "Yaw moment",
}  # fmt: skip


class TestColumns:
    """``cybership columns``: what a file needs to be told is read off the file."""

    def foreign(self, path, encoding="latin-1", sep=";", decimal=",", units_line=False):
        """A measurement in names, units and text of somebody else; the same run as ``with_tau``."""
        table = with_tau()
        table["time"] *= 1e3
        table["x"] *= 1e3
        table["y"] *= -1.0
        table["psi"] = np.degrees(table["psi"])
        table["tau_Y"] *= 1e3
        names, units = dict(FOREIGN), {}
        if units_line:
            units = {
                "time": "ms",
                "x": "[mm]",
                "y": "m",
                "psi": "°",
                "tau_X": "N",
                "tau_Y": "mN",
                "tau_N": "N.m",
            }
            names = {
                k: n.partition(" [")[0].partition(" (")[0].removesuffix("_deg") for k, n in names.items()
            }
        table.insert(2, "Länge", 12.0)
        text = table.rename(columns=names).to_csv(index=False, sep=sep, decimal=decimal)
        head, rows = text.split("\n", 1)
        below = sep.join(units.get(name, "-") for name in table.columns) + "\n" if units_line else ""
        path.write_bytes(f"Schlepptank Länge\n\nrun 3\n{head}\n{below}{rows}".encode(encoding))

    @pytest.mark.parametrize(
        ("encoding", "sep", "decimal", "units_line"),
        [("latin-1", ";", ",", True), ("utf-8", ",", ".", False), ("utf-16", "\t", ".", False)],
    )
    def test_foreign_file_is_proposed_written_and_read(
        self, tmp_path, encoding, sep, decimal, units_line
    ):
        path = tmp_path / "mine.csv"
        self.foreign(path, encoding, sep, decimal, units_line)
        done = command(propose_columns.main, path, "--anyway")
        assert (done.returncode, done.stderr) == (0, "")
        assert "not used: Länge" in done.stdout
        assert [p.name for p in tmp_path.iterdir()] == ["mine.csv"]
        assert command(propose_columns.main, path, "--write", "--anyway").returncode == 0
        found = diagnosis.read(path)
        with_tau().to_csv(tmp_path / "plain.csv", index=False)
        plain = diagnosis.read(tmp_path / "plain.csv")
        for name in ("time", "pose", "tau_cmd"):
            assert getattr(found, name) == pytest.approx(getattr(plain, name), abs=1e-9)

    def test_what_is_there_is_replaced_only_on_request(self, tmp_path):
        path, beside = tmp_path / "mine.csv", tmp_path / "mine.csv.json"
        self.foreign(path)
        beside.write_text("{}")
        done = command(propose_columns.main, path, "--write", "--anyway")
        assert done.returncode == 2
        assert "exists; --overwrite replaces it" in done.stderr
        assert beside.read_text() == "{}"
        assert command(propose_columns.main, path, "--write", "--overwrite", "--anyway").returncode == 0
        assert json.loads(beside.read_text())["skip"] == 3

    def test_units_that_nobody_told_are_seen_in_the_numbers(self, tmp_path):
        table = with_tau()
        table["time"] *= 1e3
        table["psi"] = np.degrees(table["psi"]) % 360.0
        table[["x", "y"]] *= 1e5
        table.to_csv(tmp_path / "a.csv", index=False)
        stated = propose(tmp_path / "a.csv").needed["columns"]
        assert {signal: column["unit"] for signal, column in stated.items()} == {
            "time": "ms", "x": "mm", "y": "mm", "psi": "deg",
        }  # fmt: skip

    def test_a_file_as_it_should_be_needs_nothing(self, tmp_path):
        with_tau().to_csv(tmp_path / "a.csv", index=False)
        assert propose(tmp_path / "a.csv").needed == {}
        done = command(propose_columns.main, tmp_path / "a.csv", "--write", "--anyway")
        assert "no side-car is needed" in done.stdout
        assert [p.name for p in tmp_path.iterdir()] == ["a.csv"]

    @pytest.mark.parametrize(
        ("content", "message"),
        [
            (
                "time,x [fathom],y,psi,tau_X\n0,0,0,0,1\n1,0,1,1,1\n",
                "column 'x [fathom]': 'fathom' is not a unit of x",
            ),
            ("0,0,0,1\n1,0,1,1\n", "no table of numbers below a line of names"),
            ("a word\n", "no table of numbers below a line of names"),
            ("", "no table of numbers below a line of names"),
        ],
    )
    def test_what_cannot_be_proposed_is_one_line(self, tmp_path, content, message):
        (tmp_path / "a.csv").write_text(content)
        done = command(propose_columns.main, tmp_path / "a.csv", "--write")
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
        assert message in done.stderr

    def test_signals_without_a_known_column_are_blank(self, tmp_path):
        (tmp_path / "a.csv").write_text("time,north,east,speed\n0,0,0,1\n1,0,1,1\n")
        done = command(propose_columns.main, tmp_path / "a.csv", "--write")
        assert (done.returncode, done.stderr) == (0, "")
        assert "no column is known for psi, tau_X, tau_Y, tau_N" in " ".join(done.stdout.split())
        stated = json.loads((tmp_path / "a.csv.json").read_text())["columns"]
        assert stated == {"x": "north", "y": "east"} | dict.fromkeys(
            ("psi", "tau_X", "tau_Y", "tau_N"), ""
        )

    def test_lines_before_names_that_nobody_knows_are_told(self, tmp_path):
        """The hint about ``skip`` needs no name: the line of the names is the one above the numbers."""
        self.foreign(tmp_path / "a.csv", "utf-8", ",", ".")
        with pytest.raises(
            cosim.InputError, match=r"names of its columns in line 4; put \{\"skip\": 3\}"
        ):
            diagnosis.read(tmp_path / "a.csv")
