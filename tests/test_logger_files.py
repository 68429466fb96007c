"""Files as loggers write them: stamps, degrees of latitude, other words for a side; and those that are no table."""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
import pytest

from cosim import InputError
from diagnosis.predictors import ship_with
from diagnosis.runs import common_layout, propose, read
from diagnosis.runs.columns.geographic import EQUATOR, SQUARED_ECCENTRICITY
from diagnosis.runs.files.matlab_files import _vectors
from diagnosis.runs.files.tables import date_stamps
from diagnosis.runs.row_order import ordered

TIME = np.arange(0.0, 60.0, 0.5)
NORTH, EAST = 40.0 * np.sin(0.05 * TIME), 60.0 * np.cos(0.05 * TIME)
NAMES = {
    "psi": 0.3 * np.sin(0.1 * TIME),
    "tau_X": np.sin(TIME),
    "tau_Y": np.cos(TIME),
    "tau_N": np.sin(TIME),
}
OTTER = ship_with((), "otter")


def table(**columns: object) -> pd.DataFrame:
    return pd.DataFrame({"time": TIME, "x": NORTH, "y": EAST, **NAMES} | columns)


def written(path: Path, content: pd.DataFrame) -> Path:
    content.to_csv(path, index=False)
    return path


def placed(latitude: float, longitude: float) -> tuple[np.ndarray, np.ndarray]:
    """Latitude and longitude [deg] of the points NORTH, EAST of a place, by their coordinates in space."""
    phi, lam = np.radians([latitude, longitude])
    radius = EQUATOR / np.sqrt(1.0 - SQUARED_ECCENTRICITY * np.sin(phi) ** 2)
    centre = np.array(
        [
            radius * np.cos(phi) * np.cos(lam),
            radius * np.cos(phi) * np.sin(lam),
            radius * (1.0 - SQUARED_ECCENTRICITY) * np.sin(phi),
        ]
    )
    north = np.array([-np.sin(phi) * np.cos(lam), -np.sin(phi) * np.sin(lam), np.cos(phi)])
    east = np.array([-np.sin(lam), np.cos(lam), 0.0])
    x, y, z = centre[:, None] + np.outer(north, NORTH) + np.outer(east, EAST)
    flat = np.hypot(x, y)
    # At the surface the normal's slope is that of the radius over 1 - e^2; heights are millimetres.
    return np.degrees(np.arctan2(z, (1.0 - SQUARED_ECCENTRICITY) * flat)), np.degrees(np.arctan2(y, x))


@pytest.mark.parametrize("latitude", [-35.0, 1.0, 63.44])
def test_latitude_and_longitude_become_metres(tmp_path: Path, latitude: float) -> None:
    degrees = dict(zip(("gps_latitude [deg]", "lon"), placed(latitude, 10.4), strict=True))
    found = propose(written(tmp_path / "a.csv", table(**degrees).drop(columns=["x", "y"])))
    assert found.run is not None
    middle = np.median(found.run.pose[:, :2], axis=0)
    assert np.abs(middle).max() < 1e-2, "the origin is the median position"
    moved = found.run.pose[:, :2] - np.column_stack([NORTH, EAST])
    # The meridians converge: y to 60 m tan(latitude) 40 m / R.
    assert np.ptp(moved, axis=0).max() < 3e-3


@pytest.mark.parametrize("unit", [1.0, 1e-7])
@pytest.mark.parametrize("longitude", [179.9998, -179.9998])
def test_a_position_goes_on_across_the_date_line(tmp_path: Path, longitude: float, unit: float) -> None:
    latitude, true = placed(-17.0, longitude)
    jumped = (true + 180.0) % 360.0 - 180.0
    assert np.abs(np.diff(jumped)).max() > 359.0
    content = table(Latitude=latitude / unit, Longitude=jumped / unit).drop(columns=["x", "y"])
    found = propose(written(tmp_path / "a.csv", content.round(0 if unit < 1.0 else 12))).run
    assert found is not None
    north, east = (np.ptp(found.pose[:, k]) for k in range(2))
    assert (north, east) == pytest.approx((np.ptp(NORTH), np.ptp(EAST)), rel=1e-3)


@pytest.mark.parametrize(("further", "one"), [(0.02, True), (3.0, False)])
def test_the_runs_of_a_folder_have_one_origin_if_they_are_not_far_apart(
    tmp_path: Path, further: float, one: bool
) -> None:
    paths = [tmp_path / name for name in ("a.csv", "b.csv")]
    places = (63.44, 63.44 + further)
    for path, latitude in zip(paths, places, strict=True):
        degrees = dict(zip(("lat", "lon"), placed(latitude, 10.4), strict=True))
        written(path, table(**degrees).drop(columns=["x", "y"]))
    common, others = common_layout({path: propose(path) for path in paths})
    assert ("x" in common.columns) is ("y" in common.columns) is one
    assert not any(others.values()) or not one
    if one:
        north = [read(path, common).pose[:, 0] for path in paths]
        arc = np.radians(further) * 6.37e6  # of a sphere: the ellipsoid's radius differs by 0.4 %
        assert np.median(north[1]) - np.median(north[0]) == pytest.approx(arc, rel=0.01)


def in_minutes(degrees: np.ndarray) -> np.ndarray:
    """Degrees as degrees and minutes, ddmm.mmmm."""
    whole = np.floor(np.abs(degrees))
    return 100.0 * whole + 60.0 * (np.abs(degrees) - whole)


def sexagesimal(value: float, seconds: bool) -> str:
    whole, minutes = divmod(60.0 * value, 60.0)
    text = f"{whole:.0f}°{minutes:.6f}'"
    return f"{whole:.0f}°{int(minutes)}'{60.0 * (minutes % 1.0):.5f}\"" if seconds else text


ANGLES: dict[str, Callable[[float, str], str]] = {
    "degrees and a letter": lambda value, side: f"{value:.8f}° {side}",
    "a letter before": lambda value, side: f"{side}{value:.8f}",
    "minutes": lambda value, side: f"{sexagesimal(value, False)}{side}",
    "seconds": lambda value, side: f"{sexagesimal(value, True)} {side}",
    "minutes as of NMEA 0183": lambda value, side: f"{in_minutes(np.array(value)):.6f}{side}",
}


@pytest.mark.parametrize("form", ANGLES)
@pytest.mark.parametrize(("latitude", "longitude"), [(63.44, 10.4), (-33.9, -70.5)])
def test_positions_that_are_written_as_angles_are_read(
    tmp_path: Path, form: str, latitude: float, longitude: float
) -> None:
    content = table().drop(columns=["x", "y"])
    for name, sides, degrees in zip(
        ("lat", "lon"), ("NS", "EW"), placed(latitude, longitude), strict=True
    ):
        content[name] = [ANGLES[form](abs(value), sides[int(value < 0.0)]) for value in degrees]
    found = propose(written(tmp_path / "a.csv", content)).run
    assert found is not None
    for k, true in enumerate((NORTH, EAST)):
        np.testing.assert_allclose(found.pose[:, k] - found.pose[0, k], true - true[0], atol=0.02)


def test_a_cell_that_is_no_angle_refuses_the_position(tmp_path: Path) -> None:
    content = table().drop(columns=["x", "y"]).assign(lat="63.44 N", lon="10.40 Q")
    with pytest.raises(InputError, match=r"a cell of lat and lon is not a number: '.*decimal degrees"):
        propose(written(tmp_path / "a.csv", content))


HEADS = {
    "names, description, units, types": (
        "Time;PosN;PosE;Hdg;X;Y;N",
        "Time since start;North;East;Gyro heading;Surge force;Sway force;Yaw moment",
        "s;m;m;rad;N;N;N.m",
        "REAL;REAL;REAL;REAL;REAL;REAL;REAL",
    ),
    "a ruled line": ("time;x;y;psi;tau_X;tau_Y;tau_N", "----;-;-;---;-----;-----;-----"),
    "types": ("time;x;y;psi;tau_X;tau_Y;tau_N", "REAL;REAL;REAL;REAL;REAL;REAL;REAL"),
}


@pytest.mark.parametrize("head", HEADS)
def test_names_stand_above_units_types_and_ruled_lines(tmp_path: Path, head: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text("\n".join(HEADS[head]) + "\n" + table().to_csv(index=False, header=False, sep=";"))
    found = propose(path).run
    assert found is not None
    np.testing.assert_array_equal(found.time[np.isfinite(found.time)], TIME)
    np.testing.assert_allclose(found.pose[-TIME.size :, 0], NORTH)


@pytest.mark.parametrize("mark", [" ", " | "])
def test_tables_that_databases_print_are_read(tmp_path: Path, mark: str) -> None:
    names = [*table()]
    rule = ("+" if "|" in mark else " ").join(["-" * 22] * len(names))
    rows = [mark.join(f"{x:>20.12f}" for x in row) for row in table().to_numpy()]
    lines = [mark.join(f"{name:<20}" for name in names), rule, *rows, "", f"({len(rows)} rows)"]
    path = tmp_path / "a.txt"
    path.write_text("\n".join(lines) + "\n")
    found = propose(path).run
    assert found is not None
    np.testing.assert_allclose(found.time[: TIME.size], TIME)
    np.testing.assert_allclose(found.pose[: TIME.size, 1], EAST, atol=1e-9)


@pytest.mark.parametrize(
    ("many", "read_as_words"), [(1, True), (TIME.size // 2, False)], ids=["few", "half of all"]
)
def test_words_with_numbers_are_remarks_if_they_are_few(
    tmp_path: Path, many: int, read_as_words: bool
) -> None:
    cells = [f"Alarm {x:.1f}" if k < many else f"{x:.1f}" for k, x in enumerate(TIME)]
    path = written(tmp_path / "a.csv", table(tau_X=cells))
    if read_as_words:
        assert "tau_X: 1 cell without a number, such as 'Alarm 0.0'" in read(path).notes
    else:
        with pytest.raises(InputError, match=r"tau_X = 'Alarm 0\.0' in row 1 is not a number"):
            read(path)


SPELLINGS: dict[str, Callable[[float], str]] = {
    "other minus, hard blank": lambda x: f"\u00a0{x:.6f}".replace("-", "\u2212"),
    "a dash": lambda x: f"{x:.6f}".replace("-", "\u2013"),
    "a blank behind the minus": lambda x: f"{x:.6f}".replace("-", "- "),
    "brackets": lambda x: f"({-x:.6f})" if x < 0.0 else f"{x:.6f}",
    "Fortran": lambda x: f"{x:.8E}".replace("E", "D"),
    "a formula": lambda x: f'="{x:.6f}"',
    "a text of a spreadsheet": lambda x: f"'{x:.6f}",
    "sides": lambda x: f"{abs(x):.6f} {'P' if x < 0.0 else 'S'}",
    "words before": lambda x: f"{'Port' if x < 0.0 else 'Stbd'} {abs(x):.6f}",
    "one way alone": lambda x: f"{'Astern ' if x < 0.0 else ''}{abs(x):.6f}",
}


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_numbers_in_other_spellings_are_read(tmp_path: Path, spelling: str) -> None:
    cells = [SPELLINGS[spelling](x) for x in NAMES["tau_Y"]]
    content = table(tau_Y=cells)
    if spelling == "Fortran":  # whole tables are written so
        content = content.map(lambda x: SPELLINGS[spelling](float(str(x).replace("D", "E"))))
    found = propose(written(tmp_path / "a.csv", content)).run
    assert found is not None
    np.testing.assert_allclose(found.tau_cmd[:, 1], NAMES["tau_Y"], atol=1e-6)
    assert not any("without a number" in note for note in found.notes)


@pytest.mark.parametrize("cells", [["20.0 P", "3.0 X"], ["20.0 5.0", "3.0 P"], ["1.0 kn", "2.0 kn"]])
def test_numbers_with_other_words_are_refused(tmp_path: Path, cells: list[str]) -> None:
    content = table(tau_Y=[cells[k % 2] for k in range(TIME.size)])
    with pytest.raises(InputError, match=f"tau_Y = '{cells[0]}' in row 1 is not a number"):
        read(written(tmp_path / "a.csv", content))


CLOCKS: dict[str, Callable[[pd.Series], pd.Series]] = {
    "hhmmssfff": lambda at: at.dt.strftime("%H%M%S%f").str[:9].astype("int64"),
    "yyyymmddhhmmssfff": lambda at: at.dt.strftime("%Y%m%d%H%M%S%f").str[:17].astype("int64"),
    "hhmmssff": lambda at: at.dt.strftime("%H%M%S%f").str[:8].astype("int64"),
    "100 ns since 1601": lambda at: (
        (at - pd.Timestamp("1970-01-01")).dt.total_seconds().mul(1e7).astype("int64")
        + 116_444_736_000_000_000
    ),
}


@pytest.mark.parametrize("clock", CLOCKS)
def test_numbers_that_are_clocks_are_seconds(tmp_path: Path, clock: str) -> None:
    seconds = 1.5 * TIME  # more than a minute
    at = pd.Series(pd.Timestamp("2024-05-13 23:58:50") + pd.to_timedelta(seconds, unit="s"))
    found = propose(written(tmp_path / "a.csv", table(time=CLOCKS[clock](at)))).run
    assert found is not None
    time = ordered(found).time
    np.testing.assert_allclose(time - time[0], seconds, atol=5e-3)  # of numbers with 17 digits


@pytest.mark.parametrize(("unit", "said"), [(1e3, "ms"), (1e2, "10 ms")])
def test_a_time_in_hundredths_is_none_in_thousandths(tmp_path: Path, unit: float, said: str) -> None:
    found = propose(written(tmp_path / "a.csv", table(time=unit * TIME)))
    assert found.by_numbers == {"time": said}
    assert found.run is not None
    np.testing.assert_allclose(found.run.time, TIME)


@pytest.mark.parametrize("form", ["to the minute", "rounded"])
def test_coarse_stamps_are_spread_evenly(tmp_path: Path, form: str) -> None:
    seconds = 0.5 * np.arange(600)
    begin = pd.Timestamp("2024-05-13 10:12:33")
    north, east = 40.0 * np.sin(0.05 * seconds), 60.0 * np.cos(0.05 * seconds)
    stamps = {
        "to the minute": (begin + pd.to_timedelta(seconds, unit="s")).strftime("%d.%m.%Y %H:%M"),
        "rounded": [f"{x:.0f}" for x in seconds],
    }
    content = pd.DataFrame({"time": stamps[form], "x": north, "y": east, "psi": 0.1 * np.sin(seconds)})
    path = written(
        tmp_path / "a.csv", content.assign(**dict.fromkeys(("tau_X", "tau_Y", "tau_N"), north))
    )
    found = propose(path)
    assert not found.by_numbers
    assert found.run is not None
    time = ordered(found.run).time
    np.testing.assert_allclose(time - time[0], seconds, atol=0.02)


@pytest.mark.parametrize(("latitude", "side"), [(63.44, "N"), (-33.9, "S")])
def test_degrees_and_minutes_of_nmea_are_read(tmp_path: Path, latitude: float, side: str) -> None:
    """With the hemisphere in the next column, a position and the ship's course are as in degrees."""
    lat, lon = placed(latitude, 10.4)
    course = np.arctan2(np.gradient(EAST), np.gradient(NORTH))
    columns = {"GGA lat": in_minutes(lat), "NS": side, "GGA lon": in_minutes(lon), "EW": "E"}
    content = table(**columns).drop(columns=["x", "y", "psi"]).round(7)
    content["HDT heading"] = np.degrees(course) % 360.0
    found = propose(written(tmp_path / "a.csv", content))
    assert found.run is not None
    moved = found.run.pose[:, :2] - np.column_stack([NORTH, EAST])
    assert np.ptp(moved, axis=0).max() < 3e-3
    content = content.rename(columns={"HDT heading": "seventh"})
    (likely,) = propose(written(tmp_path / "b.csv", content)).likely["psi"]
    assert likely.reasons == ["correlates +1.00 with the course"], "on the right side of the equator"


def test_the_quality_of_a_latitude_is_none(tmp_path: Path) -> None:
    lat, lon = placed(63.44, 10.4)
    columns = {"GPS.Lat": lat, "GPS.Lat.Quality": 1.0, "GPS.Lon": lon}
    found = propose(written(tmp_path / "a.csv", table(**columns).drop(columns=["x", "y"])))
    assert found.layout.column("x").name == "GPS.Lat"
    assert found.unused == ["GPS.Lat.Quality"]


@pytest.mark.parametrize("other", [{"lat": 6371.4 + TIME}, {"lat": 63.0 + TIME, "latitude": TIME}])
def test_other_latitudes_are_left_blank(tmp_path: Path, other: dict[str, np.ndarray]) -> None:
    """Numbers that are no latitude, or two columns of one meaning."""
    content = table(**other, longitude=10.0 + 1e-5 * TIME).drop(columns=["x", "y"])
    found = propose(written(tmp_path / "a.csv", content))
    assert found.run is None
    assert found.needed["columns"]["x"] == ""


def test_a_leap_second_is_a_second(tmp_path: Path) -> None:
    ticks = (TIME * 2).astype(int)  # half seconds, 23:59:60 from 30 s on
    clock = pd.Timestamp("2016-12-31T23:59:30Z") + pd.to_timedelta(
        0.5 * (ticks - 2 * (ticks >= 62)), "s"
    )
    stamps = np.array([f"{t:%Y-%m-%dT%H:%M:%S}.{t.microsecond // 100000}Z" for t in clock], dtype=object)
    stamps[60:62] = ["2016-12-31T23:59:60.0Z", "2016-12-31T23:59:60.5Z"]
    run = read(written(tmp_path / "a.csv", table(time=stamps)))
    np.testing.assert_allclose(run.time, TIME, atol=1e-9)


FORMS = (
    "%d.%m.%Y %H:%M:%S.%f",
    "%d.%m.%y %H:%M:%S,%f",
    "%d/%m/%Y %H:%M:%S.%f",
    "%m/%d/%Y %I:%M:%S.%f %p",
    "%m-%d-%Y %H:%M:%S.%f",
    "%d-%b-%Y %H:%M:%S.%f",
    "%b %d, %Y %I:%M:%S.%f %p",
    "%a %b %d %H:%M:%S.%f %Y",
    "%Y:%m:%d %H:%M:%S:%f",
    "%Y%m%dT%H%M%S.%f",
    "%I:%M:%S.%f %p",
    "%H:%M:%S:%f",
)


@pytest.mark.parametrize("begin", ["2026-05-04T23:59:40", "2026-12-31T11:59:40"])
@pytest.mark.parametrize("form", FORMS)
def test_the_same_instants_in_any_form_are_the_same_times(form: str, begin: str) -> None:
    """Past noon or midnight, with a day that may be a month: in one log the shorter time has passed."""
    clock = pd.Timestamp(begin) + pd.to_timedelta(TIME, "s")
    seconds = date_stamps(pd.Series(clock.strftime(form)), "'a.csv'")
    np.testing.assert_allclose(seconds, TIME, atol=1e-6)


def test_a_text_that_is_no_stamp_is_none() -> None:
    for texts in (["on", "off"], ["A1", "A2"], ["May", "Auto"], ["12 deg", "13 deg"], ["1:2:3", "x"]):
        assert date_stamps(pd.Series(texts)) is None
    with pytest.raises(InputError, match=r"'31\.31\.2026 10:00:00' in row 2 is not a time stamp"):
        date_stamps(pd.Series(["30.12.2026 10:00:00", "31.31.2026 10:00:00"]), "'a.csv'")


def test_an_index_of_a_parquet_file_is_a_column(tmp_path: Path) -> None:
    stamps = pd.DatetimeIndex(pd.Timestamp("2026-05-04T09:30Z") + pd.to_timedelta(TIME, "s"), name="t")
    table().drop(columns="time").set_axis(stamps).to_parquet(tmp_path / "a.parquet")
    found = propose(tmp_path / "a.parquet")
    assert found.run is not None
    np.testing.assert_allclose(found.run.time, TIME, atol=1e-9)


def test_other_words_for_a_side_and_the_unit_in_a_name(tmp_path: Path) -> None:
    own = {"RPM stbd": 60.0 * np.ones_like(TIME), "n left [1/s]": 2.0 * np.ones_like(TIME)}
    content = table(**own).drop(columns=["tau_X", "tau_Y", "tau_N"])
    found = propose(written(tmp_path / "a.csv", content), OTTER)
    assert found.run is not None
    assert found.run.commanded["starboard.n"][0] == pytest.approx(1.0)
    assert found.run.commanded["port.n"][0] == pytest.approx(2.0)


def test_the_unit_of_the_time_is_known_beside_a_blank(tmp_path: Path) -> None:
    content = table(time=(1.7e18 + 1e9 * TIME).astype("int64"), deck=NORTH).drop(columns="x")
    found = propose(written(tmp_path / "a.csv", content))
    assert found.needed["columns"] == {"time": {"name": "time", "unit": "ns"}, "x": ""}


@pytest.mark.parametrize("name", ["a.nmea", "a.csv"])
def test_sentences_are_no_table(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(
        "$GPGGA,093000.00,6326.4,N,01024.0,E,4,12,0.8,5.0,M,40.0,M,,*65\r\n" * 9
    )
    for reader in (propose, read):
        with pytest.raises(InputError, match="NMEA 0183 sentences; a measurement is a table"):
            reader(tmp_path / name)


def test_a_table_may_have_any_ending(tmp_path: Path) -> None:
    found = propose(written(tmp_path / "a.txt", table().rename(columns={"x": "North"})))
    (tmp_path / "a.txt.json").write_text(json.dumps(found.needed))
    np.testing.assert_allclose(read(tmp_path / "a.txt").pose[:, 0], NORTH)


@pytest.mark.parametrize("look", [propose, read])
def test_a_spreadsheet_is_no_text(tmp_path: Path, look: Callable[[Path], object]) -> None:
    path = tmp_path / "a.csv"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")
    with pytest.raises(InputError, match="is an archive, as a spreadsheet is; save its table as a CSV"):
        look(path)


@pytest.mark.parametrize("compression", ["gzip", "bz2", "xz"])
@pytest.mark.parametrize("look", [propose, read])
def test_a_compressed_file_is_to_be_unpacked(
    tmp_path: Path, look: Callable[[Path], object], compression: Literal["gzip", "bz2", "xz"]
) -> None:
    path = tmp_path / "a.csv"
    table().to_csv(path, index=False, compression=compression)
    with pytest.raises(InputError, match=r"a\.csv' is compressed; unpack it"):
        look(path)


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"#ROSBAG V2.0\n", "recording"),
        (b"\x89MCAP0\r\n", "recording"),
        (b"ULog\x01\x12\x35\x01", "recording"),
        (b'{"time": 0.0, "x": 1.0}\n', "JSON"),
        (b"\x89HDF\r\n\x1a\n\x00\x00", "not a text"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1\x00\x00", "not a text"),
    ],
)
@pytest.mark.parametrize("look", [propose, read])
def test_other_kinds_of_files_are_named(
    tmp_path: Path, look: Callable[[Path], object], content: bytes, what: str
) -> None:
    path = tmp_path / "run.log"
    path.write_bytes(content)
    with pytest.raises(InputError, match=what):
        look(path)


def test_a_number_at_once_in_north_east_and_heading_is_no_value(tmp_path: Path) -> None:
    clean = table()
    lost = np.isin(np.arange(len(clean)), [*range(20, 30), *range(60, 80)])
    marked = clean.mask(np.tile(lost[:, None], clean.shape[1]) & (clean.columns != "time"), -999.0)
    marked.loc[0, "tau_X"] = -999.0  # elsewhere it is a value
    run = read(written(tmp_path / "run.csv", marked))
    assert np.array_equal(np.isnan(run.pose).all(axis=1), lost)
    np.testing.assert_array_equal(run.pose[~lost], clean[["x", "y", "psi"]].to_numpy()[~lost])
    assert run.held is not None
    assert np.array_equal(run.held.all(axis=1), lost)
    assert run.tau_cmd[0, 0] == -999.0
    assert "-999 in x, y and psi at once, left out in 30 rows" in run.notes


def test_one_row_with_equal_numbers_is_a_place(tmp_path: Path) -> None:
    content = table()
    content.loc[5, ["x", "y", "psi"]] = 1.0
    assert np.isfinite(read(written(tmp_path / "run.csv", content)).pose).all()


def test_rows_without_a_time_have_the_stated_period(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", table().drop(columns="time"))
    with pytest.raises(InputError, match='rows are evenly spaced, put "period": SECONDS'):
        read(path)
    assert "time" in propose(path).likely
    path.with_name("run.csv.json").write_text('{"period": 0.5}')
    np.testing.assert_array_equal(read(path).time, TIME)
    found = propose(path).run
    assert found is not None
    np.testing.assert_array_equal(found.time, TIME)


def test_year_to_second_in_columns_are_the_time(tmp_path: Path) -> None:
    begin = pd.Timestamp("2028-02-28 23:59:40")
    stamps = pd.Series(begin + pd.to_timedelta(86_400.0 * (TIME > 20.0) + TIME, unit="s"))
    parts = {"Year": "year", "Month": "month", "Day": "day", "Hour": "hour", "Minute": "minute"}
    content = table(**{name: getattr(stamps.dt, part) for name, part in parts.items()})
    content["Second"] = stamps.dt.second + 1e-6 * stamps.dt.microsecond
    found = propose(written(tmp_path / "run.csv", content.drop(columns="time"))).run
    assert found is not None
    np.testing.assert_allclose(found.time, 86_400.0 * (TIME > 20.0) + TIME, atol=1e-5)


def test_minutes_and_seconds_are_durations() -> None:
    cells = pd.Series([f"{int(s // 60)}:{s % 60:04.1f}" for s in 3550.0 + 10.0 * np.arange(20)])
    np.testing.assert_allclose(date_stamps(cells), 10.0 * np.arange(20))


def test_a_text_in_utf_16_is_named_with_the_line_that_reads_it(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    table().to_csv(path, index=False, encoding="utf-16")
    with pytest.raises(InputError, match=r'utf-16; put {"encoding": "utf-16"} into'):
        read(path)
    path.with_name("a.csv.json").write_text('{"encoding": "utf-16"}')
    np.testing.assert_allclose(read(path).pose[:, 0], NORTH)


@pytest.mark.parametrize(("mark", "coarse"), [(1e38, False), (1e8, False), (None, True)])
def test_a_mark_of_a_missing_value_does_not_make_the_others_coarse(
    tmp_path: Path, mark: float | None, coarse: bool
) -> None:
    """A value that is no position says nothing of the rounding; values in whole metres do."""
    x = np.round(NORTH, 4)
    if mark is None:
        x = np.round(NORTH)
    else:
        x[::40] = mark
    run = read(written(tmp_path / "a.csv", table(x=x)))
    assert (np.median(run.coarse[:, 0]) > 0.5) == coarse


@pytest.mark.parametrize("shape", [(6,), (2, 3)])
def test_vectors_of_a_machine_with_another_byte_order_are_numbers_of_this_one(
    shape: tuple[int, ...],
) -> None:
    values = np.arange(6.0).reshape(shape)
    own, other = (dict(_vectors("a", values.astype(order))) for order in ("<f8", ">f8"))
    assert own.keys() == other.keys()
    for name, vector in other.items():
        assert vector.dtype.isnative
        np.testing.assert_array_equal(vector, own[name])


@pytest.mark.parametrize("begin", ["08:59:58", "23:59:58"])
def test_milliseconds_behind_a_colon_are_no_leap_second(begin: str) -> None:
    """``:59:600`` begins as ``:59:60``."""
    tenths = 0.1 * np.arange(60)
    clock = pd.Timestamp(f"2026-05-04T{begin}") + pd.to_timedelta(tenths, "s")
    stamps = [f"{t:%H:%M:%S}:{t.microsecond // 1000:03d}" for t in clock]
    np.testing.assert_allclose(date_stamps(pd.Series(stamps)), tenths, atol=1e-6)


TANKER = ship_with((), "kvlcc2")
SHAFT = {"rpm": np.full(TIME.size, 600.0), "rudder_deg": 10.0 * np.sin(0.1 * TIME)}


@pytest.mark.parametrize(
    "name", ["shaft_dir", "propeller_direction", "prop dir", "Shaft clutch direction"]
)
@pytest.mark.parametrize(("cells", "sign"), [((1, 1), 1.0), ((1, -1), -1.0), (("AHEAD", "AHEAD"), 1.0)])
def test_the_direction_of_a_shaft_is_not_its_speed(
    tmp_path: Path, name: str, cells: tuple[object, object], sign: float
) -> None:
    """One that changes is the sign of the speed beside it."""
    astern = TIME > 30.0
    content = table(**SHAFT, **{name: np.where(astern, cells[1], cells[0])})
    found = propose(
        written(tmp_path / "a.csv", content.drop(columns=["tau_X", "tau_Y", "tau_N"])), TANKER
    )
    assert found.run is not None
    np.testing.assert_allclose(found.run.commanded["propeller.n"], np.where(astern, sign * 10.0, 10.0))


@pytest.mark.parametrize(("cells", "is_sign"), [("AHR", True), ("AHR?", False), ("AH", False)])
def test_a_column_of_more_words_than_both_ways_and_stop_is_no_sign(
    tmp_path: Path, cells: str, is_sign: bool
) -> None:
    states = np.array([*cells])[np.arange(len(TIME)) * len(cells) // len(TIME)]
    content = table(**SHAFT, shaft_dir=states).drop(columns=["tau_X", "tau_Y", "tau_N"])
    found = propose(written(tmp_path / "a.csv", content), TANKER)
    assert (found.layout.column("propeller.n").sign == "shaft_dir") == is_sign


@pytest.mark.parametrize("mark", [-999.0, 9999.0, -32768.0, -99.9, 35.0])
def test_cells_far_beyond_the_limit_of_a_command_are_missing(tmp_path: Path, mark: float) -> None:
    """As loggers mark what they do not have; a column of them is in another unit."""
    own = {"port.n": 5.0 + np.sin(0.3 * TIME), "starboard.n": np.full(TIME.size, 4.0)}
    content = table(**own).drop(columns=["tau_X", "tau_Y", "tau_N"])
    content.loc[[20, 50, 51], "port.n"] = mark
    run = read(written(tmp_path / "a.csv", content), of=OTTER)
    expected = own["port.n"].copy()
    expected[[20, 50, 51]] = expected[[19, 49, 49]]
    np.testing.assert_allclose(run.commanded["port.n"], expected)
    np.testing.assert_allclose(run.commanded["starboard.n"], 4.0)
    assert "port.n: 3 cells far beyond its limits left out" in run.notes
    content.loc[:60, "port.n"] = 60.0 * content.loc[:60, "port.n"]  # in revolutions a minute
    as_written = content["port.n"].to_numpy()
    run = read(written(tmp_path / "a.csv", content), of=OTTER)
    np.testing.assert_allclose(run.commanded["port.n"], as_written)


@pytest.mark.parametrize("given", [(35.0, 36.0, 35.0), (30.0, 30.0, 30.0)])  # of at most 16.5 1/s
def test_a_demand_beyond_the_limit_of_an_actuator_is_a_command(
    tmp_path: Path, given: tuple[float, float, float]
) -> None:
    own = {"port.n": 5.0 + np.sin(0.3 * TIME), "starboard.n": np.full(TIME.size, 4.0)}
    own["port.n"][[20, 50, 51]] = given
    content = table(**own).drop(columns=["tau_X", "tau_Y", "tau_N"])
    run = read(written(tmp_path / "a.csv", content), of=OTTER)
    np.testing.assert_allclose(run.commanded["port.n"], own["port.n"])


@pytest.mark.parametrize(("ratio", "stated"), [(1.04, False), (1.9, True)])
def test_commands_that_are_often_beyond_their_limits_are_told(
    tmp_path: Path, ratio: float, stated: bool
) -> None:
    """As where a log has the speed of the engine, and a gear is behind it."""
    own = {"port.n": np.where(TIME > 30.0, ratio * 16.541, 5.0), "starboard.n": np.full(TIME.size, 4.0)}
    content = table(**own).drop(columns=["tau_X", "tau_Y", "tau_N"])
    run = read(written(tmp_path / "a.csv", content), of=OTTER)
    share = f"{100.0 * (TIME > 30.0).mean():.0f} %"
    line = f"port.n is beyond its limit of 16.54 1/s in {share} of the rows, up to {ratio * 16.541:.4g}"
    assert [note for note in run.notes if note.startswith(line)] == list(run.notes)
    assert bool(run.notes) is stated
    np.testing.assert_allclose(run.commanded["port.n"], own["port.n"])


@pytest.mark.parametrize("speed", ["wind_speed", "wind_speed_relative"])
def test_a_wind_speed_below_zero_is_missing(tmp_path: Path, speed: str) -> None:
    measured = np.where(TIME == 7.5, -999.0, 3.0 + np.sin(TIME))
    of = {speed: measured, speed.replace("speed", "direction"): 0.1 * TIME}
    run = read(written(tmp_path / "a.csv", table(**of)))
    expected = np.where(TIME == 7.5, np.nan, measured)
    np.testing.assert_array_equal(run.measured[speed], expected)
    assert f"{speed}: 1 cell far beyond its limits left out" in run.notes
    calm = read(written(tmp_path / "b.csv", table(**of | {speed: np.abs(measured)})))
    assert not calm.notes


def test_the_length_of_a_field_is_no_internal_error(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("x" * 200_000 + "\n" + "y" * 200_000)
    with pytest.raises(InputError, match="has no table of numbers"):
        propose(path)


@pytest.mark.parametrize("rows", [0, 3])
def test_a_time_without_a_value_is_named(tmp_path: Path, rows: int) -> None:
    content = table().iloc[:rows].assign(time=np.nan)
    with pytest.raises(InputError, match=f"'.*a.csv': time has no value in any of {rows} rows"):
        read(written(tmp_path / "a.csv", content))


def circling(turn: float, wraps: bool) -> pd.DataFrame:
    """A ship that goes where it heads, its heading in counts of a turn."""
    psi = 0.1 * TIME + 0.5
    x, y = np.cumsum(0.25 * np.cos(psi)), np.cumsum(0.25 * np.sin(psi))
    within = psi % (2.0 * np.pi) if wraps else np.minimum(psi, 6.2)
    return table(x=x, y=y, psi=np.round(within / (2.0 * np.pi) * turn))


@pytest.mark.parametrize(
    ("turn", "wraps"),
    [
        (3600.0, True),
        (3600.0, False),
        (36000.0, True),
        (36000.0, False),
        (6400.0, True),
        (65536.0, True),
    ],
)
def test_a_heading_in_counts_of_a_turn_is_told_by_where_the_ship_goes_and_by_its_jumps(
    tmp_path: Path, turn: float, wraps: bool
) -> None:
    content = circling(turn, wraps)
    found = propose(written(tmp_path / "a.csv", content))
    assert found.run is not None
    expected = content["psi"] * 2.0 * np.pi / turn
    np.testing.assert_allclose(np.unwrap(found.run.pose[:, 2]), np.unwrap(expected), atol=1e-9)


def test_a_spike_makes_no_other_unit_of_a_heading_in_degrees(tmp_path: Path) -> None:
    """One in a hundred cells is a mark, or a bit that is lost."""
    content = circling(360.0, True)
    content.loc[40, "psi"] = 32767.0
    found = propose(written(tmp_path / "a.csv", content))
    assert found.needed["columns"]["psi"] == {"name": "psi", "unit": "deg"}


@pytest.mark.parametrize(("ship", "size"), [("cse1", 1.1), ("otter", 2.0), ("gunnerus", 31.3)])
@pytest.mark.parametrize(("unit", "parts"), [("mm", 1e3), ("cm", 1e2)])
def test_of_two_units_of_a_position_that_of_a_usual_speed_is_proposed(
    tmp_path: Path, ship: str, size: float, unit: str, parts: float
) -> None:
    """By Froude number 0.2, whatever the size."""
    speed = 0.2 * np.sqrt(9.81 * size)
    content = (
        table(x=parts * speed * TIME, y=parts * 0.1 * speed * TIME)
        .drop(columns=[*NAMES][1:])
        .assign(**{s: 0.1 * np.sin(TIME) for s in ship_with((), ship).commands})
    )
    if parts * speed < 30.0:
        pytest.skip("so slow, it may be in metres")
    found = propose(written(tmp_path / "a.csv", content), ship_with((), ship))
    assert found.needed["columns"]["x"] == {"name": "x", "unit": unit}


def test_decimal_commas_in_quotes_beside_commas_between_cells(tmp_path: Path) -> None:
    """As spreadsheets of some countries write them."""
    names = ",".join(f'"{name}"' for name in table().columns)
    rows = [",".join(f'"{x:.6f}"'.replace(".", ",") for x in row) for row in table().to_numpy()]
    (tmp_path / "a.csv").write_text("\n".join([names, *rows]))
    found = propose(tmp_path / "a.csv")
    assert found.run is not None
    assert found.needed["decimal"] == ","
    np.testing.assert_allclose(found.run.pose[:, 0], NORTH, atol=1e-6)
    np.testing.assert_allclose(found.run.time, TIME, atol=1e-6)
