"""What the columns of foreign logs are: proposed where they are known, blank where not, for one log or a folder."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat
from support.command import command

from cosim import InputError
from diagnosis import propose_columns
from diagnosis.predictors import ship_with
from diagnosis.runs import FOLDER_FILE, line_beside, meaning, prepare, propose, read
from diagnosis.runs.columns.columns import POSE, Named, quantities
from diagnosis.runs.columns.likely_columns import meaning_of_words, motion_of
from diagnosis.runs.columns.unit_check import UNITS, spelt

TANKER = ship_with((), "kvlcc2")
NAMES = {
    "time": "t [s]",
    "x": "x_position_mid [m]",
    "y": "y_position_mid [m]",
    "psi": "psi_hat [rad]",
    "propeller.n": "n_prop [rps]",
    "rudder.delta": "delta_rudder [rad]",
}


def zigzag(seconds: float = 120.0, **columns: str) -> pd.DataFrame:
    """A tanker that is steered to and fro, and speeds up, by names of columns."""
    t = np.arange(0.0, seconds, 0.1)
    rudder = 0.3 * np.sign(np.sin(2.0 * np.pi * t / 40.0))
    rate = 0.03 * np.sin(2.0 * np.pi * (t - 5.0) / 40.0)
    shaft = 8.0 + 4.0 * np.sign(np.sin(2.0 * np.pi * t / 90.0))
    speed = 0.8 + 0.3 * np.sin(2.0 * np.pi * (t - 10.0) / 90.0)
    psi = 0.1 * np.cumsum(rate)
    table = {
        "time": t,
        "x": 0.1 * np.cumsum(speed * np.cos(psi)),
        "y": 0.1 * np.cumsum(speed * np.sin(psi)),
        "psi": psi,
        "propeller.n": shaft,
        "rudder.delta": rudder,
    }
    noise = np.random.default_rng(4).normal(0.0, 1e-3, (3, t.size))
    table = {
        s: v + dict(zip(("x", "y", "psi"), noise, strict=True)).get(s, 0.0) for s, v in table.items()
    }
    return pd.DataFrame(table).rename(columns=NAMES | columns)


def written(path: Path, table: pd.DataFrame) -> Path:
    table.to_csv(path, index=False)
    return path


@pytest.mark.parametrize(
    ("name", "unit", "signal"),
    [
        ("x_position_mid", "m", "x"),
        ("x_position_mid", "m/s", ""),
        ("psi_hat", "rad", "psi"),
        ("psi_ref", "rad", ""),
        ("r_angvelo", "rad/s", "r"),
        ("u_velo", "m/s", "u"),
        ("vm_velo", "m/s", "v"),
        ("yawRate", "deg/s", "r"),
        ("n_prop", "rps", "propeller.n"),
        ("propeller speed", "rpm", "propeller.n"),
        ("n_prop_2", "rps", ""),
        ("n_bow", "rps", ""),
        ("delta_rudder", "rad", "rudder.delta"),
        ("rudder angle", "°", "rudder.delta"),
        ("rudder rate", "deg/s", ""),
        ("wind_velo_true", "m/s", "wind_speed"),
        ("wind_dir_true", "rad", "wind_direction"),
        ("wind_velo_relative_mid", "m/s", ""),
        ("x_position_mid", "", ""),
        ("utm_easting", "m", "y"),
        ("proa", "deg", "psi"),
        ("hélice de proa", "rps", ""),
        ("ângulo do leme", "deg", "rudder.delta"),
        ("północ", "m", "x"),
        ("obroty śruby", "rpm", "propeller.n"),
        ("kurs", "deg", ""),
    ],
)
def test_words_of_a_name_and_its_unit_tell_a_signal(name: str, unit: str, signal: str) -> None:
    assert meaning_of_words(name, unit, quantities(TANKER)) == signal


@pytest.mark.parametrize(
    ("name", "column"),
    [
        ("Mz (Nm)", {"name": "Mz (Nm)"}),
        ("yaw_moment_Nm", "yaw_moment_Nm"),
        ("Mz [N·m]", {"name": "Mz [N·m]"}),
        ("Mz [kNm]", {"name": "Mz [kNm]", "unit": "kN.m"}),
    ],
)
def test_units_of_a_moment_are_read_as_they_are_usually_written(
    name: str, column: object, tmp_path: Path
) -> None:
    table = pd.DataFrame(
        {"time": np.arange(0.0, 60.0, 0.1)} | dict.fromkeys(("x", "y", "psi", "tau_X", "tau_Y"), 0.0)
    )
    table = table.assign(x=0.1 * table.time, tau_X=np.sin(table.time), **{name: np.cos(table.time)})
    found = propose(written(tmp_path / "a.csv", table))
    reported = found.needed["columns"]["tau_N"]
    assert reported == (column["name"] if isinstance(column, dict) and len(column) == 1 else column)
    assert found.unused == []
    assert found.run is not None
    largest = 1e3 if "k" in name else 1.0
    assert np.abs(found.run.tau_cmd[:, 2]).max() == pytest.approx(largest)
    side_car = {"columns": {"tau_N": {"name": name, "unit": "Nm"}}}
    (tmp_path / "a.csv.json").write_text(json.dumps(side_car))
    assert np.abs(read(tmp_path / "a.csv").tau_cmd[:, 2]).max() == pytest.approx(1.0)


def test_a_unit_that_is_not_known_has_a_line_with_its_factor(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", zigzag(x="x [fathom]"))
    with pytest.raises(InputError, match="with its factor to m ") as reported:
        propose(path, TANKER)
    line = str(reported.value).partition("put ")[2].partition(" with its factor to m ")[0]
    columns = json.loads(line)["columns"]
    columns["x"]["factor"] = 1.8288
    (tmp_path / "a.csv.json").write_text(json.dumps({"columns": columns}))
    found = propose(path, TANKER)
    assert found.run is not None
    np.testing.assert_allclose(found.run.pose[:, 0], 1.8288 * zigzag()[NAMES["x"]])


@pytest.mark.parametrize(
    ("name", "decimal", "sep", "cell"),
    [
        ("North (mm)", ".", ",", "{:,.1f}"),
        ("North (mm)", ",", ";", "{:,.1f}"),
        ("Nord (mm)", ".", ",", "{:,.0f}"),
    ],
)
def test_separators_of_thousands_are_named(
    name: str, decimal: str, sep: str, cell: str, tmp_path: Path
) -> None:
    marks = str.maketrans(",.", ".,") if decimal == "," else {}
    table = zigzag(30.0, x=name)
    table[name] = [cell.format(1000.0 * x + 5000.0).translate(marks) for x in table[name]]
    table.to_csv(tmp_path / "a.csv", index=False, sep=sep, decimal=decimal)
    with pytest.raises(InputError, match="separators of thousands"):
        propose(tmp_path / "a.csv", TANKER)


def test_an_actuator_that_was_never_used_needs_no_column(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", zigzag().drop(columns=NAMES["rudder.delta"]))
    side_car = propose(path, TANKER).needed
    beside = path.with_name("a.csv.json")
    beside.write_text(json.dumps(side_car), "utf-8")
    with pytest.raises(InputError, match=r'rudder.delta is blank.* with "unused": \["rudder.delta"\]'):
        read(path, of=TANKER)
    del side_car["columns"]["rudder.delta"]
    beside.write_text(json.dumps(side_car), "utf-8")
    with pytest.raises(InputError, match=r'no column .rudder.delta.*put "unused": \["rudder.delta"\]'):
        read(path, of=TANKER)
    beside.write_text(json.dumps(side_car | {"unused": ["rudder.delta"]}), "utf-8")
    run = read(path, of=TANKER)
    assert not run.commanded["rudder.delta"].any()
    assert not any("rudder" in note for note in run.notes)
    found = propose(path, TANKER)
    assert found.run is not None
    np.testing.assert_array_equal(found.run.commanded["propeller.n"], run.commanded["propeller.n"])
    beside.write_text(json.dumps(side_car | {"unused": ["rudder.alpha"]}), "utf-8")
    with pytest.raises(
        InputError, match=r"'rudder.alpha' is not a command; did you mean 'rudder.delta'"
    ):
        read(path, of=TANKER)


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize("mark", ["-", "*****", "Bad Input", "# jump", "bad 7"])
def test_a_cell_with_words_is_without_a_value(mark: str, decimal: str, tmp_path: Path) -> None:
    table = zigzag()
    text = table.map(lambda x: f"{x:.9g}".replace(".", decimal))
    text.loc[[5, 7], NAMES["x"]] = mark
    text.to_csv(tmp_path / "a.csv", index=False, sep=";")
    run = propose(tmp_path / "a.csv", TANKER).run
    assert run is not None
    assert f"x: 2 cells without a number, such as '{mark}'" in run.notes
    expected = table[NAMES["x"]].to_numpy(float, copy=True)
    expected[[5, 7]] = np.nan
    np.testing.assert_allclose(run.pose[:, 0], expected, rtol=1e-8)


@pytest.mark.parametrize("cell", ["1.2.3", "5 kn", "7-"])
def test_a_cell_that_begins_like_a_number_must_be_one(cell: str, tmp_path: Path) -> None:
    table = zigzag().astype("object")
    table.loc[5, NAMES["x"]] = cell
    with pytest.raises(InputError, match=f"'{cell}' in row 6 is not a number"):
        propose(written(tmp_path / "a.csv", table), TANKER)


def test_a_column_of_words_has_no_numbers(tmp_path: Path) -> None:
    table = zigzag().astype("object")
    table[NAMES["x"]] = "Half ahead"
    with pytest.raises(InputError, match="'Half ahead' in row 1 is not a number"):
        propose(written(tmp_path / "a.csv", table), TANKER)


@pytest.mark.parametrize("line", ["# 09:32, wind 7 m/s", "NAME", "Total rows: 1800"])
def test_a_line_of_words_is_no_sample(line: str, tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", zigzag())
    names, *rows = path.read_text("utf-8").splitlines()
    said = names if line == "NAME" else line
    path.write_text("\n".join([names, *rows[:9], said, *rows[9:], said]) + "\n", "utf-8")
    run = propose(path, TANKER).run
    assert run is not None
    assert not any("missing" in note for note in run.notes)
    first = names.split(",")[0] if line == "NAME" else said.split(",")[0]
    assert f"2 rows with words in place of a time, left out, such as '{first}'" in run.notes
    known = np.isfinite(run.time)
    assert known.sum() == len(rows)
    np.testing.assert_allclose(run.pose[known, 0], zigzag()[NAMES["x"]], rtol=1e-8)


def test_a_log_with_commands_of_actuators_needs_its_ship(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", zigzag())
    done = command(propose_columns.main, path)
    assert "state the ship by --ship NAME|FILE.toml" in " ".join(done.stdout.split())
    assert "put the columns' names into the blanks" in " ".join(done.stdout.split())
    done = command(propose_columns.main, path, "--ship", "kvlcc2")
    assert "--ship" not in done.stdout
    assert "blanks" not in done.stdout


@pytest.mark.parametrize(
    ("factors", "units"),
    [
        (
            {"propeller.n": 60.0, "rudder.delta": np.degrees(1.0)},
            {"propeller.n": "rpm", "rudder.delta": "deg"},
        ),
        ({"propeller.n": 60.0}, {"propeller.n": "rpm", "rudder.delta": None}),
        ({"rudder.delta": np.degrees(1.0)}, {"propeller.n": None, "rudder.delta": "deg"}),
        ({}, {"propeller.n": None, "rudder.delta": None}),
        # Within 1.5 times its limit it overshoots; by 2 pi both rpm and rad/s are within.
        ({"rudder.delta": 3.0}, {"rudder.delta": None}),
        ({"propeller.n": 3.0}, {"propeller.n": None}),
    ],
)
def test_commands_far_beyond_their_limits_are_in_the_unit_within(
    tmp_path: Path, factors: dict[str, float], units: dict[str, str | None]
) -> None:
    names = {"propeller.n": "propeller", "rudder.delta": "rudder_cmd"}
    table = zigzag(**names)
    for signal, factor in factors.items():
        table[names[signal]] *= factor
    layout = propose(written(tmp_path / "a.csv", table), TANKER).layout
    assert {s: layout.column(s).unit for s in units} == units
    assert {s: layout.column(s).name for s in names} == names
    # What is stated stands.
    reported = {"columns": {"rudder.delta": {"name": "rudder_cmd", "factor": 0.5}}}
    (tmp_path / "a.csv.json").write_text(json.dumps(reported))
    column = propose(tmp_path / "a.csv", TANKER).layout.column("rudder.delta")
    assert (column.factor, column.unit) == (0.5, None)


def test_a_column_called_as_an_actuator_is_its_only_command() -> None:
    quantity = quantities(TANKER)
    for name in ("rudder", "Rudder order", "rudder angle", "/rudder/cmd.data"):
        assert meaning_of_words(name, "", quantity) == "rudder.delta"
    assert meaning_of_words("propeller speed", "", quantity) == "propeller.n"
    for name in ("rudder rate", "rudder velocity", "rudder power", "rudder torque"):
        assert meaning_of_words(name, "", quantity) != "rudder.delta"
    pod = {"pod.n": "shaft speed", "pod.alpha": "angle", "pod.thrust": "force"}
    assert meaning_of_words("pod", "", pod) == ""
    sides = {"ps.n": "shaft speed", "sb.n": "shaft speed"}
    assert meaning_of_words("RPM propeller starboard", "rpm", sides) == "sb.n"
    assert meaning_of_words("pod ang", "", pod) == "pod.alpha"
    assert meaning_of_words("pod speed", "", pod) == "pod.n"
    assert meaning_of_words("pod angular speed", "", pod) != "pod.alpha"


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("TimeUS", "us"),
        ("time_boot_ms", "ms"),
        ("timestamp_usec", "us"),
        ("TIMEMS", "ms"),
        ("ms", "ms"),
        ("millis", "ms"),
    ],
)
def test_the_unit_at_the_end_of_the_name_of_a_time(tmp_path: Path, name: str, unit: str) -> None:
    table = zigzag(time=name)
    table[name] = np.round(table[name] / UNITS["time"][unit])
    found = propose(written(tmp_path / "a.csv", table), TANKER)
    assert (found.layout.column("time").name, found.layout.column("time").unit) == (name, unit)
    assert found.run is not None
    np.testing.assert_allclose(found.run.time, zigzag()[NAMES["time"]], atol=1e-9)


def test_a_heading_in_rows_of_its_own_is_seen_to_be_in_degrees(tmp_path: Path) -> None:
    table = zigzag(psi="yaw", x="north", y="east")
    table["yaw"] = np.degrees(8.0 * table["yaw"]) % 360.0
    heading = table[[NAMES["time"], "yaw"]].assign(**{NAMES["time"]: table[NAMES["time"]] + 0.03})
    rows = pd.concat([table.drop(columns="yaw"), heading]).sort_values(NAMES["time"])
    layout = propose(written(tmp_path / "a.csv", rows), TANKER).layout
    assert layout.column("psi").unit == "deg"
    assert layout.column("x").unit is None


@pytest.mark.parametrize(
    ("name", "unit", "signal"),
    [
        ("Ruderlage Bb", "deg", "port_rudder.delta"),
        ("Angle barre tribord", "deg", "starboard_rudder.delta"),
        ("Régime hélice bâbord", "rpm", "port_screw.n"),
        ("Drehzahl Propeller Stb", "rpm", "starboard_screw.n"),
        ("Port Shaft RPM", "rpm", "port_screw.n"),
        ("STEER.SB.AngleSetpoint", "deg", "starboard_rudder.delta"),
        ("Bugstrahlruder", "%", "bow.u"),
        ("Bug Sollwert", "%", "bow.u"),
        ("Cap vrai", "deg", "psi"),
        ("Azimut forut vinkel", "deg", "fore.alpha"),
        ("Azimut akter turtall", "rpm", "aft.n"),
        ("RPM hélice babor", "rpm", "port_screw.n"),
        ("Shaft RPM", "rpm", ""),
        ("Kurs", "deg", ""),
        ("Heckstrahlruder", "%", ""),
    ],
)
def test_words_of_other_languages_and_short_forms(name: str, unit: str, signal: str) -> None:
    screws = {f"{side}_screw.n": "shaft speed" for side in ("port", "starboard")}
    rudders = {f"{side}_rudder.delta": "angle" for side in ("port", "starboard")}
    legs = {
        f"{end}.{c}": q for end in ("fore", "aft") for c, q in (("alpha", "angle"), ("n", "shaft speed"))
    }
    quantity = quantities(TANKER) | screws | rudders | legs | {"bow.u": "command"}
    del quantity["propeller.n"], quantity["rudder.delta"]
    assert meaning_of_words(name, unit, quantity) == signal


@pytest.mark.parametrize(
    ("name", "signal"), [("Hochwert", "x"), ("Zeit", "time"), ("Øst", "y"), ("Est", "y"), ("a.est", "")]
)
def test_names_in_other_languages(name: str, signal: str) -> None:
    assert meaning(name, quantities(TANKER)) == (signal, False)


def test_the_part_of_a_path_that_all_names_have_tells_nothing(tmp_path: Path) -> None:
    table = zigzag()
    names = {
        "x": "PLC1.NAV.North_m",
        "y": "PLC1.NAV.East_m",
        "psi": "PLC1.GYRO.Heading_rad",
        "propeller.n": "PLC1.PROP.SpeedSetpoint_rps",
        "rudder.delta": "PLC1.STEER.AngleSetpoint_rad",
    }
    found = propose(written(tmp_path / "a.csv", zigzag(**names)), TANKER)
    assert {s: found.layout.column(s).name for s in names} == names
    assert found.run is not None
    np.testing.assert_array_equal(
        found.run.commands, table[[NAMES["propeller.n"], NAMES["rudder.delta"]]]
    )


def test_a_folder_is_not_a_measurement(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", zigzag())
    for folder in (tmp_path, Path()):
        done = command(propose_columns.main, folder)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert f"'{folder}' is a folder; give files of it" in done.stderr
    with pytest.raises(InputError, match=f"a measurement is a file, as '{path}'"):
        read(tmp_path)


def test_what_is_known_is_proposed_and_read(tmp_path: Path) -> None:
    found = propose(written(tmp_path / "a.csv", zigzag()), TANKER)
    assert found.needed == {"columns": NAMES}
    assert found.run is not None
    np.testing.assert_allclose(
        found.run.commands, zigzag()[[NAMES["propeller.n"], NAMES["rudder.delta"]]]
    )


def test_of_two_columns_of_one_meaning_none_is_chosen_and_both_are_likely(tmp_path: Path) -> None:
    table = zigzag().rename(columns={"delta_rudder [rad]": "delta_rudder_cmd [rad]"})
    table["delta_rudder_order [rad]"] = table["delta_rudder_cmd [rad]"]
    found = propose(written(tmp_path / "a.csv", table), TANKER)
    assert found.needed["columns"]["rudder.delta"] == ""
    likely = {c.name for c in found.likely["rudder.delta"]}
    assert likely == {"delta_rudder_order [rad]", "delta_rudder_cmd [rad]"}


@pytest.mark.parametrize(
    ("names", "chosen", "measured"),
    [
        (["Rudder feedback [rad]", "Rudder cmd [rad]"], "Rudder cmd [rad]", None),
        (["RudderAct [rad]", "RudderSet [rad]", "rudder angle [rad]"], "RudderSet [rad]", None),
        (["Rudder_Ist [rad]", "Rudder [rad]"], "Rudder [rad]", None),
        (["rudder_fb [rad]"], "rudder_fb [rad]", True),
        (["RSA [rad]"], "RSA [rad]", None),
    ],
)
def test_an_order_is_a_command_and_a_measured_value_where_there_is_none(
    tmp_path: Path, names: list[str], chosen: str, measured: bool | None
) -> None:
    table = zigzag().rename(columns={"delta_rudder [rad]": names[0]})
    table = table.assign(**dict.fromkeys(names[1:], table[names[0]]))
    found = propose(written(tmp_path / "a.csv", table), TANKER)
    column = found.layout.column("rudder.delta")
    assert (column.name, column.measured) == (chosen, measured)


def test_positions_of_the_first_of_two_receivers_count(tmp_path: Path) -> None:
    table = zigzag().drop(columns=[NAMES["x"], NAMES["y"]])
    for k in (2, 1):
        north = 63.0 + 1e-5 * np.arange(len(table))
        table = table.assign(**{f"GPS{k} Lat": north, f"GPS{k} Lon": 10.0 + 1e-6 * k})
    found = propose(written(tmp_path / "a.csv", table), TANKER)
    assert [found.layout.column(s).name for s in "xy"] == ["GPS1 Lat", "GPS1 Lon"]


@pytest.mark.parametrize(
    "names",
    [
        ("TIME_S", "NORTH_M", "EAST_M", "HEADING_DEG"),
        ("Time", "UTM32N_N", "UTM32N_E", "Yaw [deg]"),
        ("时间", "北向", "东向", "首向"),
    ],
)
def test_names_in_capitals_with_a_zone_and_in_chinese_are_known(
    tmp_path: Path, names: tuple[str, ...]
) -> None:
    table = zigzag().rename(columns=dict(zip((NAMES[s] for s in ("time", *POSE)), names, strict=True)))
    path = tmp_path / "a.csv"
    table.to_csv(path, index=False, encoding="gb18030" if names[0] == "时间" else "utf-8")
    found = propose(path, TANKER)
    assert [found.layout.column(s).name for s in ("time", *POSE)] == [*names]
    assert found.run is not None


def test_blanks_have_likely_columns_by_the_motion(tmp_path: Path) -> None:
    table = zigzag(**{"propeller.n": "channel 4", "rudder.delta": "channel 7"})
    table["channel 5"] = np.random.default_rng(1).normal(size=len(table))
    table["channel 6"] = 1.0
    path = written(tmp_path / "a.csv", table)
    done = command(propose_columns.main, path, "--ship", "kvlcc2", "--write")
    assert (done.returncode, done.stderr) == (0, "")
    reported = " ".join(done.stdout.split())
    assert "blank: propeller.n; likely columns: 'channel 4' (correlates +0." in reported
    assert "with the surge speed)" in reported
    assert "blank: rudder.delta; likely columns: 'channel 7' (correlates +0." in reported
    assert "'channel 5' (" not in reported
    assert "'channel 6' (" not in reported
    blank = json.loads((tmp_path / "a.csv.json").read_text())
    assert blank["columns"]["rudder.delta"] == blank["columns"]["propeller.n"] == ""
    with pytest.raises(InputError, match=r"a\.csv\.json': columns\.propeller\.n is blank; put the name"):
        read(path, of=TANKER)
    blank["columns"] |= {"rudder.delta": "channel 7", "propeller.n": "channel 4"}
    (tmp_path / "a.csv.json").write_text(json.dumps(blank))
    np.testing.assert_allclose(read(path, of=TANKER).commands, table[["channel 4", "channel 7"]])


def test_the_motion_of_a_pose_is_that_which_made_it() -> None:
    h = 0.01
    t = np.arange(0.0, 60.0, h)
    made = {
        "surge": 1.0 + 0.3 * np.sin(0.2 * t),
        "sway": -0.4 + 0.2 * np.sin(0.3 * t),
        "yaw": 0.25 + 0.05 * np.sin(0.1 * t),
    }
    psi = 0.7 + h * np.cumsum(made["yaw"])
    u, v = made["surge"], made["sway"]
    north, east = u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)
    found = motion_of({"time": t, "x": h * np.cumsum(north), "y": h * np.cumsum(east), "psi": psi})
    inner = slice(200, -200)  # rates are differences over a second
    for axis, speed in made.items():
        np.testing.assert_allclose(found[f"{axis} speed"][inner], speed[inner], atol=0.02)
        acceleration = np.gradient(speed, h)
        np.testing.assert_allclose(found[f"{axis} acceleration"][inner], acceleration[inner], atol=0.01)
    drift = np.angle(np.exp(1j * (found["course"] - psi - np.arctan2(v, u))))
    np.testing.assert_allclose(drift[inner], 0.0, atol=0.02)


def test_units_have_their_factors_by_definition() -> None:
    minute, degree, foot = 60.0, np.pi / 180.0, 0.3048
    others = {
        "time": {"ms": 1e-3, "us": 1e-6, "ns": 1e-9, "d": 86400.0, "h": 3600.0, "min": minute},
        "length": {"mm": 1e-3, "cm": 1e-2, "km": 1e3, "ft": foot, "in": foot / 12.0},
        "angle": {"deg": degree, "°": degree, "gon": np.pi / 200.0},
        "force": {"mN": 1e-3, "kN": 1e3},
        "moment": {"N.mm": 1e-3, "N.cm": 1e-2, "kN.m": 1e3},
        "command": {"%": 0.01},
        "shaft speed": {"rps": 1.0, "rpm": 1.0 / minute, "rad/s": 0.5 / np.pi},
        "speed": {"mm/s": 1e-3, "cm/s": 1e-2, "km/h": 1e3 / 3600.0, "kn": 1852.0 / 3600.0},
        "rate": {"deg/s": degree, "°/s": degree, "deg/min": degree / minute},
        "acceleration": {"mm/s2": 1e-3, "g": 9.80665},
        "angular acceleration": {"deg/s2": degree},
    }
    for quantity, units in UNITS.items():
        (_, one), *rest = units.items()  # the first is that of SI
        assert one == 1.0
        assert dict(rest) == pytest.approx(others[quantity], rel=1e-12)


@pytest.mark.parametrize(
    ("written_so", "unit"),
    [
        *(("RPM", "rpm"), ("rev/min", "rpm"), ("U/min", "rpm"), ("tr/min", "rpm"), ("o/min", "rpm")),
        *(("Knots", "kn"), ("°/min", "deg/min"), ("deg/sec", "deg/s"), ("grader", "deg")),
    ],
)
def test_usual_spellings_of_a_unit_are_that_unit(written_so: str, unit: str) -> None:
    assert spelt(written_so) == unit


@pytest.mark.parametrize("unit", ["MN", "KN", "Min", "S"])
def test_capitals_count_in_symbols(unit: str) -> None:
    assert spelt(unit) == unit
    assert all(unit not in units for units in UNITS.values())


def test_a_heading_in_degrees_is_likely_by_the_course(tmp_path: Path) -> None:
    table = zigzag(psi="a")
    table["a"] = np.degrees(table["a"])
    found = propose(written(tmp_path / "a.csv", table), TANKER)
    assert found.likely["psi"][0].name == "a"
    assert found.likely["psi"][0].reasons == ["correlates +1.00 with the course"]


def test_what_is_stated_is_kept(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", zigzag(psi="my heading", **{"rudder.delta": "channel 7"}))
    stated = {"trial": "zigzag", "columns": {"psi": {"name": "my heading", "noise": 0.002}}}
    (tmp_path / "a.csv.json").write_text(json.dumps(stated))
    done = command(propose_columns.main, path, "--ship", "kvlcc2", "--write", "--overwrite")
    assert done.returncode == 0
    reported = json.loads((tmp_path / "a.csv.json").read_text())
    assert reported["columns"]["psi"] == stated["columns"]["psi"]
    assert reported["trial"] == "zigzag"
    assert reported["columns"]["rudder.delta"] == ""
    assert reported["columns"]["x"] == NAMES["x"]


def test_a_blank_that_is_there_is_filled_where_it_is_known(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", zigzag())
    (tmp_path / "a.csv.json").write_text('{"columns": {"rudder.delta": "", "x": "x_position_mid [m]"}}')
    assert propose(path, TANKER).needed == {"columns": NAMES}


def test_a_blank_that_is_filled_gets_the_unit_in_its_name(tmp_path: Path) -> None:
    """The file that is there is completed; what is stated of a column stays."""
    table = zigzag(**{"propeller.n": "engine_rpm", "rudder.delta": "helm angle [deg]"})
    table["engine_rpm"] *= 60.0
    table["helm angle [deg]"] = np.degrees(table["helm angle [deg]"])
    path = written(tmp_path / "a.csv", table)
    beside = tmp_path / "a.csv.json"
    filled = {"propeller.n": "engine_rpm", "rudder.delta": {"name": "helm angle [deg]", "noise": 0.1}}
    beside.write_text(json.dumps({"columns": filled}))
    done = command(propose_columns.main, path, "--ship", "kvlcc2", "--write", "--anyway")
    assert (done.returncode, done.stderr) == (0, "")
    reported = json.loads(beside.read_text())["columns"]
    assert reported["propeller.n"] == {"name": "engine_rpm", "unit": "rpm"}
    assert reported["rudder.delta"] == {"name": "helm angle [deg]", "unit": "deg", "noise": 0.1}
    run = read(path, of=TANKER)
    np.testing.assert_allclose(np.ptp(run.commands, axis=0), [8.0, 0.6], rtol=1e-6)


def test_per_cent_of_a_shaft_speed_or_an_angle_are_those_of_its_limit(tmp_path: Path) -> None:
    table = zigzag(**{"propeller.n": "Main engine %", "rudder.delta": "rudder_pct"})
    most, full = (
        np.abs(np.array(x)).max() for x in TANKER.layouts[0].limits(TANKER.nominal_drive.params)
    )
    table["Main engine %"] *= 100.0 / most
    table["rudder_pct"] *= 100.0 / full
    path = written(tmp_path / "a.csv", table)
    named = {"propeller.n": "Main engine %", "rudder.delta": "rudder_pct"}
    (tmp_path / "a.csv.json").write_text(json.dumps({"columns": named}))
    reported = propose(path, TANKER).needed["columns"]
    assert reported["propeller.n"] == {
        "name": "Main engine %",
        "factor": pytest.approx(most / 100.0, rel=1e-5),
    }
    assert reported["rudder.delta"] == {
        "name": "rudder_pct",
        "factor": pytest.approx(full / 100.0, rel=1e-5),
    }
    run = propose(path, TANKER).run
    assert run is not None
    np.testing.assert_allclose(np.ptp(run.commands, axis=0), [8.0, 0.6], rtol=1e-5)


@pytest.mark.parametrize(
    ("name", "signal"),
    [
        ("Rel. wind speed [kn]", "wind_speed_relative"),
        ("Relative wind speed [m/s]", "wind_speed_relative"),
        ("AWA [deg]", "wind_direction_relative"),
        ("rel wind dir [deg]", "wind_direction_relative"),
        ("True wind dir [deg]", "wind_direction"),
    ],
)
def test_winds_are_known_by_their_usual_names(tmp_path: Path, name: str, signal: str) -> None:
    path = written(tmp_path / "a.csv", zigzag(time="Time UTC").assign(**{name: 5.0}))
    found = propose(path, TANKER).layout
    assert found.column(signal).name == name
    assert found.column("time").name == "Time UTC"


def test_coordinates_of_utm_are_known_by_their_usual_names(tmp_path: Path) -> None:
    table = zigzag(x="utm_n [m]", y="UTM E [m]")
    found = propose(written(tmp_path / "a.csv", table), TANKER).layout
    assert [found.column(signal).name for signal in ("x", "y")] == ["utm_n [m]", "UTM E [m]"]


@pytest.mark.parametrize(
    ("north", "east"),
    [("pos_y_north", "pos_x_east"), ("Nordwert", "Ostwert"), ("N_m", "E_m"), ("x_north", "y_east")],
)
def test_a_direction_in_a_name_goes_before_the_letter_of_an_axis(
    tmp_path: Path, north: str, east: str
) -> None:
    found = propose(written(tmp_path / "a.csv", zigzag(x=north, y=east)), TANKER).layout
    assert [found.column(signal).name for signal in ("x", "y")] == [north, east]


@pytest.mark.parametrize("start", [200.0, 1.0], ids=["beyond a turn", "jumps over north"])
def test_directions_in_degrees_are_seen_by_their_values(tmp_path: Path, start: float) -> None:
    """No angle in rad begins beyond a turn or jumps by more than half of one; unwrapped ones go on."""
    table = zigzag().assign(TWS=8.0)
    blows = (start + 25.0 * np.sin(np.arange(len(table)))) % 360.0
    path = written(tmp_path / "a.csv", table.assign(TWD=blows))
    reported = propose(path, TANKER).needed["columns"]
    assert reported["wind_direction"] == {"name": "TWD", "unit": "deg"}
    (tmp_path / "a.csv.json").write_text(json.dumps({"columns": reported | {"wind_direction": "TWD"}}))
    with pytest.raises(
        InputError, match=r'wind_direction up to [23]\d\d.*: is it in deg.*"unit": "deg"'
    ):
        prepare(read(path, of=TANKER))
    unwrapped = written(tmp_path / "b.csv", table.assign(TWD=np.linspace(6.0, 40.0, len(table))))
    assert propose(unwrapped, TANKER).needed["columns"]["wind_direction"] == "TWD"


def test_one_file_holds_for_all_of_a_folder(tmp_path: Path) -> None:
    for k, name in enumerate("abc"):
        written(tmp_path / f"{name}.csv", zigzag(100.0 + 20.0 * k))
    (tmp_path / "README.md").write_text("# Runs\n")
    files = sorted(tmp_path.iterdir())
    done = command(propose_columns.main, *files, "--ship", "kvlcc2", "--write", "--anyway")
    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([*(p.name for p in files), FOLDER_FILE])
    assert json.loads((tmp_path / FOLDER_FILE).read_text()) == {"columns": NAMES}
    assert "not tables: README.md" in done.stdout
    rows = [
        line.split() for line in done.stdout.splitlines() if line.startswith(("a.csv", "b.csv", "c.csv"))
    ]
    assert [row[:2] for row in rows] == [["a.csv", "99.9"], ["b.csv", "119.9"], ["c.csv", "139.9"]]
    assert [int(row[5]) for row in rows] == [1000, 1200, 1400]
    channels = done.stdout[done.stdout.index("Channels") :]
    assert all(f"\n  {name} " in channels for name in ("x", "y", "psi"))
    for name in "abc":
        assert read(tmp_path / f"{name}.csv", of=TANKER).signals == ("propeller.n", "rudder.delta")
    own = NAMES | {"y": {"name": NAMES["y"], "noise": 0.01}}
    (tmp_path / FOLDER_FILE).write_text(json.dumps({"columns": own}))
    again = command(propose_columns.main, *files, "--ship", "kvlcc2", "--write", "--anyway")
    assert (again.returncode, again.stderr) == (0, ""), "what it states stays"
    assert json.loads((tmp_path / FOLDER_FILE).read_text()) == {"columns": own}
    (tmp_path / FOLDER_FILE).write_text('{"trial": "zigzag"}')
    again = command(propose_columns.main, *files, "--ship", "kvlcc2", "--write", "--anyway")
    assert (again.returncode, "columns.json' exists" in again.stderr) == (2, True)


def test_the_file_beside_a_measurement_goes_over_that_of_its_folder(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", zigzag())
    (tmp_path / FOLDER_FILE).write_text(
        json.dumps({"columns": NAMES | {"y": "t [s]"}, "trial": "zigzag"})
    )
    (tmp_path / "a.csv.json").write_text(
        json.dumps({"columns": {"y": {"name": NAMES["y"], "noise": 0.01}}})
    )
    found = read(path, of=TANKER)
    assert (found.trial, found.noise) == ("zigzag", {"y": 0.01})
    np.testing.assert_allclose(found.pose[:, 1], zigzag()[NAMES["y"]])


def test_what_only_one_has_stands_beside_it(tmp_path: Path) -> None:
    written(tmp_path / "a.csv", zigzag())
    other = zigzag()
    other["r_angvelo [rad/s]"] = np.gradient(other["psi_hat [rad]"], 0.1)
    written(tmp_path / "b.csv", other)
    done = command(
        propose_columns.main,
        tmp_path / "a.csv",
        tmp_path / "b.csv",
        "--ship",
        "kvlcc2",
        "--write",
        "--anyway",
    )
    assert json.loads((tmp_path / FOLDER_FILE).read_text()) == {"columns": NAMES}
    reported = "".join(done.stdout.split())  # lines end within a long path
    assert "b.csv'alsoneeds" in reported
    assert '{"columns":{"r":"r_angvelo[rad/s]"}}' in reported


def test_a_unit_that_one_shows_is_that_of_all(tmp_path: Path) -> None:
    one, other = zigzag(psi="heading"), zigzag(psi="heading")
    one["heading"] = np.degrees(one["heading"] * 4.0) % 360.0
    other["heading"] = np.degrees(other["heading"] * 0.2)
    files = written(tmp_path / "a.csv", one), written(tmp_path / "b.csv", other)
    assert "unit" not in propose(files[1], TANKER).needed["columns"]["psi"]
    command(propose_columns.main, *files, "--ship", "kvlcc2", "--write", "--anyway")
    reported = json.loads((tmp_path / FOLDER_FILE).read_text())["columns"]["psi"]
    assert reported == {"name": "heading", "unit": "deg"}


def test_folders_and_texts_that_differ_are_refused(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    files = written(tmp_path / "a.csv", zigzag()), written(tmp_path / "other" / "b.csv", zigzag())
    assert (
        "these files are in several" in command(propose_columns.main, *files, "--ship", "kvlcc2").stderr
    )
    (tmp_path / "b.csv").write_text(zigzag().to_csv(index=False, sep=";"))
    done = command(propose_columns.main, files[0], tmp_path / "b.csv", "--ship", "kvlcc2", "--write")
    assert done.returncode == 2
    assert "b.csv' differs from that of" in done.stderr
    assert not (tmp_path / FOLDER_FILE).exists()


def boat(**columns: object) -> pd.DataFrame:
    """An Otter that turns to both sides, and backs with its port propeller."""
    t = np.arange(0.0, 60.0, 0.1)
    psi = 2.0 * np.sin(2.0 * np.pi * t / 60.0)
    noise = np.random.default_rng(7).normal(0.0, 0.01, (2, t.size))
    table = {
        "time": t,
        "x": 0.08 * np.cumsum(np.cos(psi)) + noise[0],
        "y": 0.08 * np.cumsum(np.sin(psi)) + noise[1],
        "psi": psi,
        "port.n": 5.0 * np.sin(2.0 * np.pi * t / 30.0),
        "starboard.n": np.full(t.size, 6.0),
    }
    return pd.DataFrame(table | columns)


OTTER = ship_with((), "otter")


def test_paths_of_messages_are_known_by_their_last_parts(tmp_path: Path) -> None:
    named = {
        "x": "/gnss/odom/position/x",
        "y": "/gnss/odom/position/y",
        "psi": "/imu/heading",
        "port.n": "/thrusters/port/n_cmd",
        "starboard.n": "/thrusters/starboard/n_cmd",
    }
    found = propose(written(tmp_path / "a.csv", boat().rename(columns=named)), OTTER)
    assert found.needed == {"columns": named}
    assert found.run is not None
    np.testing.assert_allclose(found.run.commands, boat()[["port.n", "starboard.n"]])


def message(table: pd.DataFrame) -> pd.DataFrame:
    """The Otter's log as fields of ROS messages: axes east, north and up, a quaternion, a split stamp."""
    yaw, time = 0.5 * np.pi - table["psi"], 1.7e9 + table["time"]
    return pd.DataFrame(
        {
            "header.stamp.sec": np.floor(time),
            "header.stamp.nanosec": np.round(1e9 * (time % 1.0)),
            "imu.linear_acceleration.x": 0.1,
            "pose.pose.position.x": table["y"],
            "vehicle_local_position.y": table["x"],
            **{f"pose.pose.orientation.{axis}": 0.0 for axis in "xy"},
            "pose.pose.orientation.z": 2.0 * np.sin(0.5 * yaw),  # of any length
            "pose.pose.orientation.w": 2.0 * np.cos(0.5 * yaw),
            "cmd.port.n": table["port.n"],
            "cmd.starboard.n": table["starboard.n"],
        }
    )


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_messages_have_their_heading_as_a_quaternion(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    if suffix == ".csv":
        message(boat()).to_csv(path, index=False)
    else:
        message(boat()).to_parquet(path)
    found = propose(path, OTTER)
    assert found.unused == ["imu.linear_acceleration.x"]
    run = read(path, found.layout, OTTER)
    np.testing.assert_allclose(run.time - run.time[0], boat()["time"], atol=1e-6)
    np.testing.assert_allclose(run.pose[:, :2], boat()[["x", "y"]])
    np.testing.assert_allclose(np.sin(run.pose[:, 2] - boat()["psi"]), 0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("first", "second", "north"), [("X [mm]", "Y [mm]", "Y [mm]"), ("N [mm]", "E [mm]", "N [mm]")]
)
def test_axes_beside_a_quaternion_may_have_units(
    tmp_path: Path, first: str, second: str, north: str
) -> None:
    """Those of letters are of a message, to east and north; the others are named, and stay."""
    names = {"pose.pose.position.x": first, "vehicle_local_position.y": second}
    found = propose(written(tmp_path / "a.csv", message(boat()).rename(columns=names)), OTTER)
    x = found.layout.column("x")
    assert (x.name, x.unit) == (north, "mm")


def test_axes_that_are_stated_stay_beside_a_quaternion(tmp_path: Path) -> None:
    """North and east are named. A width beside x, y and z is no quaternion."""
    table = message(boat()).rename(
        columns={"pose.pose.position.x": "East", "vehicle_local_position.y": "North"}
    )
    found = propose(written(tmp_path / "a.csv", table), OTTER)
    assert [found.layout.column(s).name for s in ("x", "y")] == ["North", "East"]
    without = boat().assign(z=0.1, w=0.2)
    assert propose(written(tmp_path / "b.csv", without), OTTER).unused == ["z", "w"]


@pytest.mark.parametrize("name", ["Time (UTC)", "time [hh:mm:ss]", "Timestamp (UTC+1)"])
def test_brackets_behind_the_name_of_stamps_are_no_unit(tmp_path: Path, name: str) -> None:
    stamps = pd.Timestamp("2026-05-05 23:59:30") + pd.to_timedelta(boat()["time"], unit="s")
    table = boat().assign(time=stamps.dt.strftime("%H:%M:%S.%f")).rename(columns={"time": name})
    run = propose(written(tmp_path / "a.csv", table), OTTER).run
    assert run is not None
    np.testing.assert_allclose(run.time - run.time[0], boat()["time"] - boat()["time"][0], atol=1e-6)


@pytest.mark.parametrize(("others", "name"), [({}, "Stempel"), ({"sent": "2026-01-01T00:00:00"}, "")])
def test_the_only_date_stamps_are_the_time_whatever_their_name(
    tmp_path: Path, others: dict[str, str], name: str
) -> None:
    stamps = pd.Timestamp("2026-03-29T01:59:30Z") + pd.to_timedelta(boat()["time"], unit="s")
    table = boat().drop(columns="time").assign(Stempel=stamps.astype(str), note="none", **others)
    found = propose(written(tmp_path / "a.csv", table), OTTER)
    assert found.layout.column("time").name == name
    assert (found.run is not None) == bool(name)


@pytest.mark.parametrize(
    ("start", "stamp"),
    [
        ("2026-11-20T11:59:30", "%m/%d/%Y %I:%M:%S.%f %p"),
        ("2026-06-03T23:59:30", "%d/%m/%Y %H:%M:%S,%f"),
        ("2026-06-03T23:59:30", "%m/%d/%Y %H:%M:%S.%f"),
        ("2026-06-03T12:59:30", "%I:%M:%S.%f %p"),
    ],
)
def test_dates_with_slashes_and_half_days_are_stamps(tmp_path: Path, start: str, stamp: str) -> None:
    """Day or month first is not stated; a run that is a month longer in one order is of the other."""
    stamps = pd.Timestamp(start) + pd.to_timedelta(boat()["time"], unit="s")
    path = written(tmp_path / "a.csv", boat().assign(time=stamps.dt.strftime(stamp)))
    run = propose(path, OTTER).run
    assert run is not None
    np.testing.assert_allclose(run.time - run.time[0], boat()["time"] - boat()["time"][0], atol=1e-6)


def test_a_unit_may_follow_a_slash(tmp_path: Path) -> None:
    """ISO 80000-1: a quantity divided by its unit is a number."""
    table = boat().assign(x=1e3 * boat()["x"], psi=np.degrees(boat()["psi"]))
    names = {"time": "t/s", "x": "x/mm", "y": "y/m", "psi": "psi/deg"}
    run = propose(written(tmp_path / "a.csv", table.rename(columns=names)), OTTER).run
    assert run is not None
    np.testing.assert_allclose(run.pose, boat()[["x", "y", "psi"]], atol=1e-9)


def test_a_time_of_another_name_is_likely_where_rows_are_repeated(tmp_path: Path) -> None:
    table = boat().iloc[np.r_[0:50, 49 : len(boat())]].rename(columns={"time": "beats"})
    found = propose(written(tmp_path / "a.csv", table), OTTER)
    assert [c.name for c in found.likely["time"]] == ["beats"]


def test_a_struct_of_matlab_is_a_table(tmp_path: Path) -> None:
    """Of vectors of one length; a constant and a text are none of it."""
    path, table = tmp_path / "a.mat", boat()
    log = {
        "t": table["time"].to_numpy(),
        "eta": table[["x", "y", "psi"]].to_numpy(),
        "port": {"n": table["port.n"].to_numpy()},
        "starboard_n": table["starboard.n"].to_numpy(),
        "ship": "otter",
        "gains": np.ones(5),
    }
    savemat(path, {"log": log})
    found = propose(path, OTTER)
    assert found.run is None
    assert found.unused == ["log.eta.1", "log.eta.2", "log.eta.3"]
    pose = {s: f"log.eta.{k}" for k, s in enumerate(("x", "y", "psi"), 1)}
    columns = found.needed["columns"] | pose
    path.with_name("a.mat.json").write_text(json.dumps({"columns": columns}), encoding="utf-8")
    run = read(path, of=OTTER)
    np.testing.assert_array_equal(run.pose, table[["x", "y", "psi"]])
    np.testing.assert_array_equal(run.commands, table[["port.n", "starboard.n"]])
    path.write_bytes(b"MATLAB 7.3 MAT-file" + bytes(200))
    with pytest.raises(InputError, match=r"save it by save\(..., '-v7'\), or as CSV"):
        read(path, of=OTTER)


def test_cells_may_be_separated_by_blanks(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text(boat().round(6).to_string(index=False), encoding="utf-8")
    found = propose(path, OTTER)
    assert found.layout.separator == " "
    assert found.run is not None
    np.testing.assert_allclose(found.run.pose, boat()[["x", "y", "psi"]], atol=1e-6)


def test_messages_of_several_topics_in_rows_of_their_own_are_smoothed(tmp_path: Path) -> None:
    """Position, heading and commands come at times of their own, as a bag of messages has them."""
    table, parts = boat(), []
    for late, every, names in (
        (0.0, 2, ["x", "y"]),
        (0.013, 1, ["psi"]),
        (0.031, 1, ["port.n", "starboard.n"]),
    ):
        part = table[["time", *names]].iloc[::every]
        parts.append(part.assign(time=part["time"] + late))
    path = written(tmp_path / "a.csv", pd.concat(parts).sort_values("time"))
    s = prepare(path, OTTER).smoothed
    assert s.counts.used == len(table) / 2
    inside = (s.time > 2.0) & (s.time < 57.0)
    true = np.interp(s.time, table["time"], 0.8 * np.ones(len(table)))
    assert np.sqrt(np.nanmean((s.nu[inside, 0] - true[inside]) ** 2)) < 0.02


@pytest.mark.parametrize("known", ["compass_heading", "where it points"])
def test_a_heading_in_rows_of_its_own_shows_its_unit_and_the_motion(tmp_path: Path, known: str) -> None:
    """A row with position, heading and command at once is none there: the last values count."""
    table = zigzag(psi=known, **{"rudder.delta": "b"})
    time, heading = NAMES["time"], np.degrees(table[known]) % 360.0
    rest = table.drop(columns=[known, "b"])
    parts = [rest.iloc[::2], table[[time]].assign(**{known: heading}), table[[time, "b"]]]
    each = [part.assign(**{time: part[time] + 0.03 * k}) for k, part in enumerate(parts)]
    path = written(tmp_path / "a.csv", pd.concat(each).sort_values(time))
    likely = propose(path, TANKER).likely
    assert ("psi" in likely) == (known != "compass_heading")  # without a heading no motion is known
    shown = any("correlates" in reason for c in likely["rudder.delta"] for reason in c.reasons)
    assert shown == ("psi" not in likely)
    filled = {"psi": known, "rudder.delta": "b"}
    (tmp_path / "a.csv.json").write_text(json.dumps({"columns": filled}))
    assert propose(path, TANKER).layout.column("psi").unit == "deg"


@pytest.mark.parametrize("stated", [{}, {"unit": "rad"}], ids=["a name alone", "with its unit"])
def test_a_heading_that_is_named_gets_the_unit_of_its_values(
    tmp_path: Path, stated: dict[str, str]
) -> None:
    """A blank that was filled with a name says nothing of the unit; a unit that is stated stays."""
    table = zigzag(psi="where it points")
    table["where it points"] = np.degrees(table["where it points"]) % 360.0
    path = written(tmp_path / "a.csv", table)
    psi = {"name": "where it points", **stated}
    (tmp_path / "a.csv.json").write_text(json.dumps({"columns": {"psi": psi}}))
    reported = propose(path, TANKER).layout.column("psi")
    assert (reported.name, reported.unit) == (psi["name"], stated.get("unit", "deg"))


@pytest.mark.parametrize("factor", [None, 1.0], ids=["names alone", "with a factor"])
def test_latitude_and_longitude_that_are_named_are_read_as_metres(
    tmp_path: Path, factor: float | None
) -> None:
    """A factor that is stated stays: then the columns are lengths, whatever they are called."""
    table = zigzag(x="Latitud", y="Longitud")
    table["Latitud"] = 36.0 + table["Latitud"] / 111_000.0
    table["Longitud"] = -5.0 + table["Longitud"] / 90_000.0
    path = written(tmp_path / "a.csv", table)
    more = {} if factor is None else {"factor": factor}
    named = {"x": {"name": "Latitud", **more}, "y": {"name": "Longitud", **more}}
    (tmp_path / "a.csv.json").write_text(json.dumps({"columns": named}))
    x = propose(path, TANKER).layout.column("x")
    assert x.factor == (pytest.approx(110_959.0, rel=1e-3) if factor is None else factor)


def test_a_unit_with_a_slash_may_follow_the_word_in(tmp_path: Path) -> None:
    """The slash is that of revolutions by minutes, and not of a quantity in minutes."""
    table = zigzag(**{"propeller.n": "propeller in U/min"})
    table["propeller in U/min"] *= 60.0
    assert propose(written(tmp_path / "a.csv", table), TANKER).layout.column("propeller.n").unit == "rpm"


@pytest.mark.parametrize(("unit", "known"), [("mm", True), ("port", False)])
def test_a_unit_may_follow_the_word_in(tmp_path: Path, unit: str, known: bool) -> None:
    name = f"northing in {unit}"
    table = zigzag(x=name)
    table[name] *= 1000.0
    found = propose(written(tmp_path / "a.csv", table), TANKER)
    if known:
        assert (found.layout.column("x").name, found.layout.column("x").unit) == (name, "mm")
    else:
        assert found.layout.column("x").name == ""


def test_a_compass_and_one_shaft_are_known(tmp_path: Path) -> None:
    table = zigzag(psi="compass_deg", **{"propeller.n": "rpm"})
    table["compass_deg"], table["rpm"] = np.degrees(table["compass_deg"]) % 360.0, 480.0
    found = propose(written(tmp_path / "a.csv", table), TANKER)
    assert found.run is not None
    np.testing.assert_allclose(found.run.commands[:, 0], 8.0)
    np.testing.assert_allclose(np.sin(found.run.pose[:, 2]), np.sin(zigzag()[NAMES["psi"]]), atol=1e-9)


def test_names_that_end_in_a_unit_are_known_by_their_words(tmp_path: Path) -> None:
    """Brackets are seldom in the names of loggers; u_1 and rudder_kn have no unit that fits."""
    names = {"x": "pos_n", "y": "pos_e", "psi": "gyro_heading_deg", "rudder.delta": "rudder_deg"}
    table = zigzag(**names, **{"propeller.n": "shaft_rpm"})
    for name in ("gyro_heading_deg", "rudder_deg"):
        table[name] = np.degrees(table[name])
    table["yaw_rate_deg_s"], table["rudder_1"], table["rudder_kn"] = 0.1, table["rudder_deg"], 0.2
    found = propose(written(tmp_path / "a.csv", table), TANKER)
    columns = found.layout.columns
    assert {s: columns[s].name for s in names} == names
    assert (columns["r"].name, columns["r"].unit) == ("yaw_rate_deg_s", "deg/s")
    assert found.unused == ["rudder_1", "rudder_kn"]
    assert found.run is not None
    np.testing.assert_allclose(found.run.commands[:, 1], zigzag()[NAMES["rudder.delta"]], atol=1e-9)


def test_a_shaft_that_turns_evenly_is_likely_by_its_unit(tmp_path: Path) -> None:
    table = zigzag(**{"propeller.n": "A [rpm]"})
    table["B [rpm]"] = table["A [rpm]"] = 480.0
    found = propose(written(tmp_path / "a.csv", table), TANKER)
    assert {c.name for c in found.likely["propeller.n"]} == {"A [rpm]", "B [rpm]"}


def test_a_shaft_without_a_unit_is_likely_by_its_name(tmp_path: Path) -> None:
    table = zigzag(**{"propeller.n": "Engine revolutions"}).assign(**{"Engine revolutions": 105.0})
    found = propose(written(tmp_path / "a.csv", table), TANKER)
    assert [(c.name, c.reasons) for c in found.likely["propeller.n"]] == [
        ("Engine revolutions", ["by its name"])
    ]


def test_a_heading_that_wraps_is_likely_by_the_course(tmp_path: Path) -> None:
    table = boat().rename(columns={"psi": "a"})
    table["a"] = np.degrees(table["a"]) % 360.0
    found = propose(written(tmp_path / "a.csv", table), OTTER)
    assert found.likely["psi"][0].name == "a"


def test_commands_in_percent_are_proposed_so(tmp_path: Path) -> None:
    table = boat().rename(columns={"port.n": "u_vsp_x", "starboard.n": "u_vsp_y"})
    table = table.assign(u_vsp_x=table["u_vsp_x"] / 6.0, u_vsp_y=0.4, u_bow=0.1)
    percent = table.assign(**{n: 100.0 * table[n] for n in ("u_vsp_x", "u_vsp_y", "u_bow")})
    named = {n: f"{n}_pct" for n in ("u_vsp_x", "u_vsp_y", "u_bow")}
    found = propose(written(tmp_path / "c.csv", percent.rename(columns=named)))
    assert {c["name"]: c["unit"] for c in found.needed["columns"].values()} == dict.fromkeys(
        named.values(), "%"
    )
    found = propose(written(tmp_path / "a.csv", percent))
    assert {c["unit"] for c in found.needed["columns"].values()} == {"%"}
    assert found.run is not None
    np.testing.assert_allclose(found.run.commands, table[["u_vsp_x", "u_vsp_y", "u_bow"]])
    assert "columns" not in propose(written(tmp_path / "b.csv", table)).needed


@pytest.mark.parametrize(
    ("port", "starboard"), [("PORT", "STBD"), ("P", "S"), ("Backbord", "Steuerbord")]
)
def test_the_side_of_a_rudder_may_have_a_column_of_its_own(
    tmp_path: Path, port: str, starboard: str
) -> None:
    table = zigzag(**{"rudder.delta": "rudder_deg"})
    angle = np.degrees(table["rudder_deg"])
    table = table.assign(rudder_deg=angle.abs(), rudder_dir=np.where(angle < 0.0, port, starboard))
    found = propose(written(tmp_path / "a.csv", table), TANKER)
    reported = found.layout.column("rudder.delta")
    assert (reported.name, reported.unit, reported.sign, reported.negative) == (
        "rudder_deg",
        "deg",
        "rudder_dir",
        port,
    )
    assert found.run is not None
    np.testing.assert_allclose(found.run.commands[:, 1], np.radians(angle), atol=1e-9)


@pytest.mark.parametrize(("astern", "ahead"), [("R", "F"), (-1, 1), ("astern", "ahead")])
def test_the_sign_of_a_command_may_have_a_column_of_its_own(
    tmp_path: Path, astern: object, ahead: object
) -> None:
    table = boat()
    table["port_dir"] = np.where(table["port.n"] < 0.0, astern, ahead)
    table["port.n"] = table["port.n"].abs()
    path = written(tmp_path / "a.csv", table)
    found = propose(path, OTTER)
    assert found.needed["columns"]["port.n"]["sign"] == "port_dir"
    assert list(found.unused) == []
    (tmp_path / "a.csv.json").write_text(json.dumps(found.needed))
    np.testing.assert_allclose(read(path, of=OTTER).commands, boat()[["port.n", "starboard.n"]])
    wrong = found.needed
    wrong["columns"]["port.n"]["sign"] = "port_dri"
    (tmp_path / "a.csv.json").write_text(json.dumps(wrong))
    with pytest.raises(InputError, match=r"no column 'port_dri' \(for a sign\); .*port_dir"):
        read(path, of=OTTER)


def test_times_of_day_go_on_after_midnight(tmp_path: Path) -> None:
    table = boat()
    stamps = pd.Timestamp("2026-05-05 23:59:30.3") + pd.to_timedelta(table["time"], unit="s")
    path = written(tmp_path / "a.csv", table.assign(time=stamps.dt.strftime("%H:%M:%S.%f")))
    np.testing.assert_allclose(read(path, of=OTTER).time, table["time"], atol=1e-6)


def test_the_line_that_mends_a_column_keeps_the_name_and_unit_it_was_read_by(tmp_path: Path) -> None:
    """Once there is a side-car, names of columns state no units: the line has them all."""
    table = boat().rename(columns={"psi": "psi [deg]", "x": "x [mm]"})
    path = written(tmp_path / "a.csv", table)
    run = read(path, of=OTTER)
    mend = {name: Named(name=name, factor=-1.0) for name in ("y", "psi")}
    line = line_beside(path, run.layout, mend)
    content = json.loads(line.partition("put ")[2].rpartition(" into ")[0])
    assert content["columns"] == {
        "psi": {"name": "psi [deg]", "unit": "deg", "flip": True},
        "x": {"name": "x [mm]", "unit": "mm"},
        "y": {"name": "y", "flip": True},
    }
    (tmp_path / "a.csv.json").write_text(json.dumps(content))
    mended = read(path, of=OTTER)
    np.testing.assert_allclose(mended.pose, run.pose * [1.0, -1.0, -1.0])
    line = line_beside(path, mended.layout, {"x": Named(name="x", factor=-1.0)})
    content = json.loads(line.partition("put ")[2].rpartition(" into ")[0])
    only = {"x": {"name": "x [mm]", "unit": "mm", "flip": True}}
    assert content["columns"] == only, "what the side-car states already is not said again"


def test_units_that_numbers_alone_tell_are_named(tmp_path: Path) -> None:
    table = zigzag()
    degrees = table.assign(**{NAMES["psi"]: np.degrees(table[NAMES["psi"]]) % 360.0})
    for content, units in (
        (table, {}),
        (degrees.rename(columns={NAMES["psi"]: "heading"}), {"psi": "deg"}),
    ):
        path = written(tmp_path / "a.csv", content)
        assert propose(path, TANKER).by_numbers == units
        said = command(propose_columns.main, path, "--ship", "kvlcc2").stdout
        assert ("units by the numbers: psi in deg" in said) == bool(units)


@pytest.mark.parametrize(
    ("name", "signal"), [("North.Value", "x"), ("Heading.Value", "psi"), ("motor_left_rpm", "port.n")]
)
def test_a_value_and_a_motor_are_named_so(tmp_path: Path, name: str, signal: str) -> None:
    found = propose(written(tmp_path / "a.csv", boat().rename(columns={signal: name})), OTTER)
    assert found.layout.column(signal).name == name
