"""Logs in the styles of widespread tools: PX4, MAVLink, ROS, libcosim, LabVIEW, MOOS, and tables of pandas and numpy."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cosim import InputError
from diagnosis.predictors import ship_with
from diagnosis.runs import Run, clean, propose
from diagnosis.runs.columns.unit_check import likely_unit
from diagnosis.runs.files.tables import clock_seconds
from diagnosis.runs.files_of_one_run import one_table
from diagnosis.runs.sensors.unit_faults import without_code

OTTER, TANKER = ship_with((), "otter"), ship_with((), "kvlcc2")
TIME = np.arange(0.0, 30.0, 0.1)
PSI = 0.6 + 0.12 * TIME + 0.7 * np.sin(0.5 * TIME)
NORTH, EAST = 0.15 * np.cumsum(np.cos(PSI)), 0.15 * np.cumsum(np.sin(PSI))
SHAFTS = {"port.n": 9.0 + np.sin(TIME), "starboard.n": 9.0 - np.sin(TIME)}
TANKER_NAMES = ("time", "x", "y", "psi", "rudder.delta", "propeller.n")
TANKER_LOG = (TIME, NORTH, EAST, PSI, 0.3 * np.sin(TIME), 8.0 + np.sin(TIME))


def log(**columns: object) -> pd.DataFrame:
    return pd.DataFrame({"time": TIME, "x": NORTH, "y": EAST, "psi": PSI, **SHAFTS} | columns)


def tanker_text(header: str, separator: str, decimal: str = ".", end: str = "\n") -> str:
    rows = np.column_stack(TANKER_LOG).round(5).astype(str)
    lines = [separator.join(row).replace(".", decimal) for row in rows]
    return end.join([header, *lines]) + end


def seen(path: Path, content: pd.DataFrame | str, of=OTTER) -> Run:
    if isinstance(content, str):
        path.write_text(content)
    else:
        content.to_csv(path, index=False)
    run = propose(path, of).run
    assert run is not None
    return run


def is_the_motion(run: Run) -> None:
    np.testing.assert_allclose(run.time - run.time[0], TIME, atol=2e-4)
    place = run.pose[:, :2] - run.pose[:1, :2] + [NORTH[0], EAST[0]]
    np.testing.assert_allclose(place, np.column_stack([NORTH, EAST]), atol=0.02)
    np.testing.assert_allclose(np.sin(run.pose[:, 2] - PSI), 0.0, atol=1e-3)


def test_the_quaternion_of_px4_is_an_array_with_its_real_part_first(tmp_path: Path) -> None:
    """Its axes are north, east and down, so that x and y stay; ax beside vx is along these."""
    parts = (np.cos(0.5 * PSI), 0.0 * PSI, 0.0 * PSI, np.sin(0.5 * PSI))
    array = {f"q[{k}]": part for k, part in enumerate(parts)}
    others = {"delta_q_reset[0]": 1.0, "vx": 1.5 * np.cos(PSI), "ax": 0.1, "timestamp": 1e6 * TIME}
    run = seen(tmp_path / "a.csv", log(**array, **others).drop(columns=["psi", "time"]))
    is_the_motion(run)
    assert "a_x" not in run.measured


def test_whole_numbers_of_mavlink_are_parts_of_a_degree(tmp_path: Path) -> None:
    """Latitude and longitude are in 1e-7 degrees, the heading in hundredths."""
    lat, lon = 59.4292 + NORTH / 111_402.0, 10.4691 + EAST / 56_758.0
    whole = {"lat": 1e7 * lat, "lon": 1e7 * lon, "hdg": 100.0 * (np.degrees(PSI) % 360.0)}
    table = log(**{name: np.round(v).astype(int) for name, v in whole.items()})
    is_the_motion(seen(tmp_path / "a.csv", table.drop(columns=["x", "y", "psi"])))


def test_whole_numbers_of_ais_are_parts_of_a_minute(tmp_path: Path) -> None:
    """Positions are in 1/10,000 minutes; 91 and 181 degrees are none, also in this unit."""
    lat, lon = 59.4292 + NORTH / 111_402.0, 10.4691 + EAST / 56_758.0
    table = log(lat=np.round(6e5 * lat).astype(int), lon=np.round(6e5 * lon).astype(int)).drop(
        columns=["x", "y"]
    )
    run = seen(tmp_path / "a.csv", table)
    np.testing.assert_allclose(np.ptp(run.pose[:, 0]), np.ptp(NORTH), atol=0.4)  # rounded to 0.19 m
    np.testing.assert_allclose(np.ptp(run.pose[:, 1]), np.ptp(EAST), atol=0.4)
    table.loc[5, ["lat", "lon"]] = 54_600_000, 108_600_000
    missing = seen(tmp_path / "b.csv", table)
    assert np.isnan(missing.pose[5, :2]).all()
    np.testing.assert_allclose(
        np.delete(missing.pose, 5, 0), np.delete(run.pose, 5, 0), atol=0.2
    )  # of another median


def test_the_yaw_of_a_quaternion_is_a_part_of_it(tmp_path: Path) -> None:
    """Beside the quaternion its yaw from the east is a column of its own in exports of PlotJuggler."""
    yaw = 0.5 * np.pi - PSI
    parts = {"x": 0.0, "y": 0.0, "z": np.sin(0.5 * yaw), "w": np.cos(0.5 * yaw), "yaw": yaw}
    orientation = {f"/odom/pose/orientation/{name}": part for name, part in parts.items()}
    position = {"/odom/pose/position/x": EAST, "/odom/pose/position/y": NORTH}
    table = log(**orientation, **position).drop(columns=["x", "y", "psi"])
    is_the_motion(seen(tmp_path / "a.csv", table))


def test_names_of_libcosim_end_in_a_reference(tmp_path: Path) -> None:
    names = ("Time", *("north", "east", "heading", "rudderAngle"), "propellerRPM")
    kinds = ("", *(f" [{k} real output]" for k in range(3)), " [7 real input]", " [8 real input]")
    header = ",".join(name + kind for name, kind in zip(names, kinds, strict=True))
    text = tanker_text(header + ",", ",", end=",\n")  # a separator ends each line
    is_the_motion(seen(tmp_path / "a.csv", text.rstrip(",\n") + "\n", TANKER))


@pytest.mark.parametrize("separator", [" ", "   "])
def test_a_mark_before_the_names_is_none_of_them(tmp_path: Path, separator: str) -> None:
    """As numpy writes names, or MOOS."""
    run = seen(tmp_path / "a.txt", tanker_text("# " + separator.join(TANKER_NAMES), separator), TANKER)
    is_the_motion(run)
    np.testing.assert_allclose(run.commanded["propeller.n"], TANKER_LOG[-1], atol=1e-5)


def test_an_index_without_a_name_may_be_the_time(tmp_path: Path) -> None:
    """As pandas writes it; another one is not used."""
    stamps = pd.Timestamp("2021-06-01 08:58:07") + pd.to_timedelta(TIME, unit="s")
    table = log(index=stamps).drop(columns="time").rename(columns={"index": ""})
    is_the_motion(seen(tmp_path / "a.csv", pd.DataFrame(table[["", *table.columns[:-1]]])))
    log().to_csv(tmp_path / "b.csv")
    found = propose(tmp_path / "b.csv", OTTER)
    assert found.unused == ["Unnamed: 0"]
    blank = log().drop(columns="psi")
    blank.to_csv(tmp_path / "c.csv")
    assert propose(tmp_path / "c.csv", OTTER).run is None


def test_numbers_in_a_header_are_not_the_table(tmp_path: Path) -> None:
    """As LabVIEW writes it; the last name has no cells."""
    zeros, steps = "\t".join(["X0", *["0,0"] * 5]), "\t".join(["Delta_X", *["0,1"] * 5])
    names = "X_Value\tNorth\tEast\tYaw\tRudder\tPropeller speed\tComment"
    head = f"LabVIEW Measurement\nChannels\t5\n{zeros}\n{steps}\n***End_of_Header***\n"
    is_the_motion(seen(tmp_path / "a.lvm", head + tanker_text(names, "\t", ","), TANKER))


def test_days_since_an_epoch_are_days(tmp_path: Path) -> None:
    """As of spreadsheets and MATLAB: not minutes with a row each millisecond."""
    for row in (1.0, 0.1):
        assert likely_unit(row / 86_400.0) == "d"
    slow = log(Utc=44_348.374 + 10.0 * TIME / 86_400.0, x=10.0 * NORTH, y=10.0 * EAST)
    run = seen(tmp_path / "a.csv", slow.drop(columns="time"))
    np.testing.assert_allclose(run.time - run.time[0], 10.0 * TIME, atol=1e-5)


@pytest.mark.parametrize(
    ("name", "unit", "factor"),
    [
        *(("headingDeg", "deg", 1.0), ("Heading magnetic, deg", "deg", 1.0), ("heading[0]", None, 0.0)),
    ],
)
def test_units_may_be_a_word_or_follow_a_comma(
    tmp_path: Path, name: str, unit: str | None, factor: float
) -> None:
    table = log(psi=np.degrees(PSI)).rename(columns={"psi": name})
    table.to_csv(tmp_path / "a.csv", index=False, sep=";")
    found = propose(tmp_path / "a.csv", OTTER)
    assert (found.layout.column("psi").name, found.layout.column("psi").unit) == (
        name * bool(factor),
        unit,
    )


@pytest.mark.parametrize(
    ("rudder", "shaft"), [("delta", "n"), ("steering.rudderAngle", "Shaft speed"), ("Rudder, rad", "n")]
)
def test_commands_by_their_symbols_and_usual_names(tmp_path: Path, rudder: str, shaft: str) -> None:
    text = tanker_text(";".join([*TANKER_NAMES[:4], rudder, shaft]), ";")
    run = seen(tmp_path / "a.csv", text, TANKER)
    np.testing.assert_allclose(run.commanded["rudder.delta"], TANKER_LOG[-2], atol=1e-5)
    np.testing.assert_allclose(run.commanded["propeller.n"], TANKER_LOG[-1], atol=1e-5)


@pytest.mark.parametrize(
    "names",
    [
        "tempo (s);nord (m);est (m);prua (gradi);giri elica (giri/min);angolo timone (gradi)",
        "tijd [s];noord [m];oost [m];heading [graden];toerental [omw/min];roerhoek [graden]",
        "tid (s);nord (m);ost (m);heading (grader);varvtal (varv/min);rodervinkel (grader)",
        "Heure (s);Nord (m);Est (m);Cap (deg);Régime hélice (tr/min);Angle de barre (deg)",
        "時刻 [s];北 [m];東 [m];船首方位 [deg];回転数 [rpm];舵角 [deg]",
        "时间 (s);北向 (m);东向 (m);艏向角 (deg);螺旋桨转速 (rpm);舵角 (deg)",
        "Zeit [s];X0 [m];Y0 [m];PSI [deg];RPS [1/s];DELTA [deg]",
        "Elapsed time [s];Distance north [m];Distance east [m];Heading [deg];Shaft [rpm];Rudder [deg]",
        "t_s;gps_north_m;gps_east_m;gyro_heading_deg;shaft_rpm;rudder_deg",
    ],
)
def test_names_of_loggers_in_nine_languages(tmp_path: Path, names: str) -> None:
    rows = np.array(TANKER_LOG)[[0, 1, 2, 3, 5, 4]]
    rows[[3, 5]] = np.degrees(rows[[3, 5]])
    rows[4] *= 1.0 if "1/s" in names else 60.0
    lines = [";".join(row) for row in rows.T.round(5).astype(str)]
    log = tmp_path / "a.csv"
    log.write_text("\n".join([names, *lines]) + "\n", encoding="utf-8")
    run = propose(log, TANKER).run
    assert run is not None
    is_the_motion(run)
    np.testing.assert_allclose(run.commanded["rudder.delta"], TANKER_LOG[4], atol=1e-5)
    np.testing.assert_allclose(run.commanded["propeller.n"], TANKER_LOG[5], atol=1e-5)


def test_an_estimate_is_no_east(tmp_path: Path) -> None:
    """Est alone is the east of France and Italy, and as a part of a name an estimate."""
    log(**{"heading.est": EAST, "y_est": EAST}).drop(columns="y").to_csv(tmp_path / "a.csv", index=False)
    assert propose(tmp_path / "a.csv", OTTER).layout.column("y").name == ""


def test_the_side_of_a_rudder_may_be_a_letter(tmp_path: Path) -> None:
    delta = TANKER_LOG[4]
    table = pd.DataFrame(
        dict(zip(TANKER_NAMES, TANKER_LOG, strict=True)) | {"rudder.delta": np.abs(delta)}
    )
    table["rudder_side"] = np.where(delta < 0.0, "L", "R")
    run = seen(tmp_path / "a.csv", table, TANKER)
    np.testing.assert_allclose(run.commanded["rudder.delta"], delta)


def test_two_gyros_are_a_heading_and_a_second_one(tmp_path: Path) -> None:
    both = {"Gyro2 Heading [deg]": np.degrees(PSI) + 1.0, "Gyro1 Heading [deg]": np.degrees(PSI)}
    run = seen(tmp_path / "a.csv", log(**both).drop(columns="psi"))
    is_the_motion(run)
    np.testing.assert_allclose(run.measured["psi_2"], PSI + np.radians(1.0), atol=1e-6)
    table = log(**both, **{"Gyro3 Heading [deg]": np.degrees(PSI)}).drop(columns="psi")
    table.to_csv(tmp_path / "b.csv", index=False)
    assert propose(tmp_path / "b.csv", OTTER).run is None, "which of three is not known"


def test_a_reference_is_no_measurement(tmp_path: Path) -> None:
    given = {"heading order [deg]": np.degrees(PSI), "x cmd [m]": NORTH, "true wind": 3.0 + np.sin(TIME)}
    log(**given).drop(columns=["psi", "x"]).to_csv(tmp_path / "a.csv", index=False)
    found = propose(tmp_path / "a.csv", OTTER)
    assert (found.layout.column("psi").name, found.layout.column("x").name) == ("", "")
    assert "true wind" in found.unused, "its speed or its direction"


def test_the_newest_row_may_be_the_first(tmp_path: Path) -> None:
    """A heading in degrees shows all the same."""
    table = log(psi=np.degrees(PSI) % 360.0, time=1e3 * TIME)[::-1]
    run = seen(tmp_path / "a.csv", pd.DataFrame(table))
    is_the_motion(run.rows(np.arange(TIME.size)[::-1]))


def test_the_form_of_commands_is_that_of_the_columns(tmp_path: Path) -> None:
    """Columns of actuators leave the blanks of actuators, not those of a force."""
    names = ("vsp_surge_pct", "vsp_sway_pct", "bow_pct")
    shares = {name: 10.0 * np.sin((k + 1) * TIME) for k, name in enumerate(names)}
    table = pd.DataFrame({"time": TIME, "x": NORTH, "y": EAST, "psi": PSI, **shares})
    table.to_csv(tmp_path / "a.csv", index=False)
    found = propose(tmp_path / "a.csv", ship_with(()))
    first = {signal: likely[0].name for signal, likely in found.likely.items()}
    assert first == dict(zip(("u_vsp_x", "u_vsp_y", "u_bow"), names, strict=True))


def test_of_several_latitudes_that_without_another_word_counts(tmp_path: Path) -> None:
    degrees = {"Latitude": 59.4292 + NORTH / 111_402.0, "Longitude": 10.4691 + EAST / 56_758.0}
    table = log(**degrees, **{"Next Lat": 59.43, "Next Long": 10.47}).drop(columns=["x", "y"])
    is_the_motion(seen(tmp_path / "a.csv", table))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("FMT, 128, 89, FMT, BBnNZ, Type,Length\nGPS, 1, 3, 0, 0, 1.2, 59.4\n", "DataFlash"),
        ("2021-06-01 08:58:07 $GPRMC,085807.00,A,5925.75,N*5C\n", "NMEA 0183 sentences"),
        (
            'received_at,protocol,raw_data\n16225,NMEA0183,"$GPRMC,085807.00,A*5C"\n',
            "NMEA 0183 sentences",
        ),
        ("_time,_value,_field\n2021-06-01T08:58:07Z,1.5,heading\n2021-06-01T08:58:08Z,2,sog\n", "join"),
        ("0.0  1.0  2.0\n0.1  1.1  2.0\n", "write a line with these above them"),
    ],
)
def test_other_texts_are_named_with_what_to_do(tmp_path: Path, content: str, said: str) -> None:
    (tmp_path / "a.csv").write_text(content)
    with pytest.raises(InputError, match=said):
        propose(tmp_path / "a.csv", OTTER)


def test_the_letter_of_a_hemisphere_is_the_sign(tmp_path: Path) -> None:
    lat, lon = 33.42 + NORTH / 110_915.0, 70.4691 - EAST / 92_981.0  # to the west
    degrees = {"Latitude": lat, "N/S": "N", "Longitude": lon, "E/W": "W"}
    is_the_motion(seen(tmp_path / "a.csv", log(**degrees).drop(columns=["x", "y"])))


def test_numbers_of_a_clock_are_its_times(tmp_path: Path) -> None:
    """hhmmss.ss, as of NMEA 0183; seconds, and other numbers, stay."""
    seconds = 86_390.0 + TIME
    hours, rest = np.divmod(seconds % 86_400.0, 3600.0)
    clock = 1e4 * hours + 1e2 * (rest // 60.0) + rest % 60.0
    is_the_motion(seen(tmp_path / "a.csv", log(utc=clock).drop(columns="time")))
    date = np.where(hours > 12.0, 20_210_601e6, 20_210_602e6)
    found = clock_seconds(date + clock)  # to the digits that such a number has
    np.testing.assert_allclose(found - found[0], TIME, atol=0.005)
    is_the_motion(seen(tmp_path / "b.csv", log(time=40.0 + TIME)))
    for numbers in (0.1 * np.arange(3000), np.arange(0.0, 200.0), 50.0 * np.arange(500), 1e9 + TIME):
        np.testing.assert_array_equal(clock_seconds(numbers), numbers)


@pytest.mark.parametrize(
    "form",
    [
        *("{:g} sec", "0 days 00:00:{:09.6f}", "2021-06-01 08:58:{:06.3f} UTC"),
        *("2021-06-01_08:58:{:06.3f}", "[2021-06-01 08:58:{:06.3f}]", "20210601_0858{:06.3f}"),
        *("01.06.2021 08.58.{:06.3f}", "01JUN2021:08:58:{:06.3f}", "2021-06-01 08:58:{:06.3f} CEST"),
        *("2021-152T08:58:{:06.3f}Z", "2021年6月1日 8時58分{:06.3f}秒", "2021:06:01 08:58:{:06.3f}"),
    ],
)
def test_durations_and_zones_are_stamps(tmp_path: Path, form: str) -> None:
    is_the_motion(seen(tmp_path / "a.csv", log(time=[form.format(t) for t in TIME])))


def test_a_year_that_ends_changes_no_zone(tmp_path: Path) -> None:
    """Behind the time both are one text."""
    stamps = pd.Timestamp("2021-12-31 23:59:50") + pd.to_timedelta(TIME, unit="s")
    is_the_motion(seen(tmp_path / "a.csv", log(time=stamps.strftime("%a %b %d %H:%M:%S.%f CET %Y"))))


def test_a_day_that_no_year_has_and_a_zone_that_changes_are_refused(tmp_path: Path) -> None:
    """At the end of summer time the same hour comes twice."""
    zones = ["CEST" if t < TIME[-1] / 2.0 else "CET" for t in TIME]
    changing = [f"2021-10-31 02:58:{t:06.3f} {zone}" for t, zone in zip(TIME, zones, strict=True)]
    for stamps in (changing, [f"2021-400T08:58:{t:06.3f}" for t in TIME]):
        log(time=stamps).to_csv(tmp_path / "a.csv", index=False)
        with pytest.raises(InputError):
            propose(tmp_path / "a.csv", OTTER)


def test_names_of_other_quantities_are_none_of_the_pose(tmp_path: Path) -> None:
    """q is the pitch rate, or the quality of a position; n in rps is no position to the north."""
    log(q=0.01 * np.sin(TIME)).drop(columns="psi").to_csv(tmp_path / "a.csv", index=False)
    assert propose(tmp_path / "a.csv", OTTER).layout.column("psi").name == ""
    names = [*TANKER_NAMES[:4], "delta [rad]", "n [rps]"]
    names[1:4] = ["x [m]", "y [m]", "Heading (True)"]
    is_the_motion(seen(tmp_path / "b.csv", tanker_text(";".join(names), ";"), TANKER))


def test_units_of_a_time_may_have_their_epoch(tmp_path: Path) -> None:
    name = "timestamp (seconds since 01/01/1970)"
    is_the_motion(seen(tmp_path / "a.csv", log().rename(columns={"time": name})))


@pytest.mark.parametrize(("name", "known"), [("left", False), ("left_cmd", False), ("left_n", True)])
def test_fractions_of_the_full_command_are_no_shaft_speed(
    tmp_path: Path, name: str, known: bool
) -> None:
    """A name that does not say so is that of a shaft speed only beyond -1 to 1."""
    fraction = log().rename(columns={"port.n": name}).assign(**{name: np.sin(TIME)})
    fraction.to_csv(tmp_path / "a.csv", index=False)
    assert propose(tmp_path / "a.csv", OTTER).layout.column("port.n").name == name * known
    seen(tmp_path / "b.csv", fraction.assign(**{name: 9.0 + np.sin(TIME)}))


def test_numbers_of_thrusters_are_names(tmp_path: Path) -> None:
    """As of messages of LSTS; a number of the row is none."""
    path = tmp_path / "a.csv"
    values = {"time": np.repeat(TIME, 2), "id": [0, 1] * TIME.size, "value": np.repeat(TIME, 2)}
    pd.DataFrame(values).to_csv(path, index=False)
    assert [*one_table([path])] == ["time", "id 0", "id 1"]
    pd.DataFrame({"time": TIME, "id": np.arange(TIME.size), "value": TIME}).to_csv(path, index=False)
    assert [*one_table([path])] == ["time", "id", "value"]


@pytest.mark.parametrize(
    ("place", "read_as"),
    [((59.43, 10.47), "rad"), ((-35.0, 139.0), "rad"), ((0.001, 0.001), "deg"), ((1.0, 10.4), "deg")],
)
def test_latitudes_in_rad_are_those_of_no_sea_in_degrees(
    tmp_path: Path, place: tuple[float, float], read_as: str
) -> None:
    radius = 6_371_000.0  # m, of a sphere
    lat = np.radians(place[0]) + NORTH / radius
    lon = np.radians(place[1]) + EAST / radius / np.cos(np.radians(place[0]))
    size = 1.0 if read_as == "rad" else 180.0 / np.pi
    run = seen(tmp_path / "a.csv", log(lat=size * lat, lon=size * lon).drop(columns=["x", "y"]))
    way = run.pose[:, :2] - run.pose[0, :2] + [NORTH[0], EAST[0]]
    np.testing.assert_allclose(way, np.column_stack([NORTH, EAST]), atol=0.2)  # of the ellipsoid


def test_x_of_a_grid_is_to_the_east(tmp_path: Path) -> None:
    grid = {"utm_x [m]": 583_000.0 + EAST, "utm_y [m]": 6_588_000.0 + NORTH}
    is_the_motion(seen(tmp_path / "a.csv", log(**grid).drop(columns=["x", "y"])))


def test_a_heading_of_ais_that_is_not_available_is_missing(tmp_path: Path) -> None:
    heading = np.degrees(PSI) % 360.0
    heading[50:80] = 511.0
    run = seen(tmp_path / "a.csv", log(heading=heading).drop(columns="psi"))
    assert np.flatnonzero(np.isnan(run.pose[:, 2])).tolist() == [*range(50, 80)]


def test_greek_letters_are_symbols(tmp_path: Path) -> None:
    is_the_motion(seen(tmp_path / "a.csv", tanker_text("t,x,y,ψ,δ,n", ","), TANKER))


@pytest.mark.parametrize("error", [{}, {"e": 0.1 * np.sin(TIME)}])
def test_letters_that_mean_other_quantities(tmp_path: Path, error: dict[str, np.ndarray]) -> None:
    """Revolutions, a cross-track error, volts and degrees beside a latitude; n beside e is to the north."""
    names = ["T", "Timestamp", "lat", "lon", "heading", "delta", "n", "V"]
    lat, lon = 59.4292 + NORTH / 111_402.0, 10.4691 + EAST / 56_758.0
    values = [21.0 + 0.01 * TIME, TIME, lat, lon, *TANKER_LOG[3:], 12.0 + 0.0 * TIME]
    run = seen(tmp_path / "a.csv", pd.DataFrame(dict(zip(names, values, strict=True)) | error), TANKER)
    is_the_motion(run)
    np.testing.assert_allclose(run.commanded["propeller.n"], TANKER_LOG[-1])
    assert not run.measured
    is_the_motion(seen(tmp_path / "b.csv", log().rename(columns={"x": "n", "y": "e"})))


BROKEN = "cannot be read as a table"


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.csv", b"time,x,y\n" + b"0.1,2,3\n" * 9 + b'0.2,"3,4\n'),
        ("a.txt", b"\xff\xfe" + "time,x\n0.1,2\n0.2,3\n".encode("utf-16-le") + b"4"),
        ("a.parquet", b"PAR1 and no table"),
        ("b.txt", b"# time x x\n" + b"0.1 2 3\n" * 9),
    ],
)
@pytest.mark.parametrize(
    ("look", "twice"),
    [
        (lambda path: propose(path, OTTER), BROKEN),
        (lambda path: one_table([path]), "has more than one column 'x'"),
    ],
)
def test_a_broken_table_is_named(
    tmp_path: Path, name: str, content: bytes, look: Callable[[Path], object], twice: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=f"{name}' {twice if name == 'b.txt' else BROKEN}"):
        look(tmp_path / name)


def test_a_heading_in_gon_jumps_by_four_hundred(tmp_path: Path) -> None:
    gon = np.degrees(4.0 * PSI) % 360.0 / 0.9
    is_turned = seen(tmp_path / "a.csv", log(psi=gon.round(2)))
    np.testing.assert_allclose(np.sin(is_turned.pose[:, 2] - 4.0 * PSI), 0.0, atol=1e-3)


def test_an_azimuth_that_goes_round_is_in_the_counts_of_its_span(tmp_path: Path) -> None:
    of = ship_with((), "gunnerus")
    alpha = (0.4 * TIME) % (2.0 * np.pi)
    table = log(**{s: np.full(TIME.size, 1.0) for s in of.commands}).drop(columns=[*SHAFTS])
    angle = next(s for s in of.commands if s.endswith("alpha"))
    tenths = np.floor(10.0 * np.degrees(alpha))
    run = seen(tmp_path / "a.csv", table.assign(**{angle: tenths}), of)
    assert run.commands is not None
    found = run.commands[:, run.signals.index(angle)]
    np.testing.assert_allclose(np.sin(found - alpha), 0.0, atol=2e-3)
    steps = 1600.0 * np.sign(np.sin(TIME))  # within a part of a turn: tenths, or mils
    with pytest.raises(InputError, match="in deg, or in a part of one"):
        clean(seen(tmp_path / "b.csv", table.assign(**{angle: steps}), of))


def test_a_current_in_the_name_of_an_angle_is_no_angle(tmp_path: Path) -> None:
    table = log(**{"Rudder [mA]": 12.0 + np.sin(TIME), "rpm": 60.0}).drop(columns=[*SHAFTS])
    path = tmp_path / "a.csv"
    table.to_csv(path, index=False)
    path.with_suffix(".csv.json").write_text('{"columns": {"rudder.delta": "Rudder [mA]"}}')
    with pytest.raises(InputError, match=r"'mA' is not a unit of rudder\.delta"):
        propose(path, TANKER)


@pytest.mark.parametrize("name", ["HDM", "Heading magnetic"])
def test_a_magnetic_heading_is_the_last_of_several_and_said_to_be_one(tmp_path: Path, name: str) -> None:
    degrees = np.degrees(PSI).round(3)
    both = {name: degrees - 4.0, "Heading true": degrees}
    table = log().drop(columns="psi")
    run = seen(tmp_path / "a.csv", table.assign(**both))
    is_the_motion(run)
    assert not any("magnetic" in note for note in run.notes)
    alone = seen(tmp_path / "b.csv", table.assign(**{name: degrees}))
    assert sum("magnetic compass" in note for note in alone.notes) == 1


def test_a_place_that_is_not_available_is_none(tmp_path: Path) -> None:
    """Of AIS: 91 and 181 degrees."""
    lat, lon = 59.4292 + NORTH / 111_402.0, 10.4691 + EAST / 56_758.0
    gone = np.arange(TIME.size) % 30 == 7
    place = {"lat": np.where(gone, 91.0, lat), "lon": np.where(gone, 181.0, lon)}
    run = seen(tmp_path / "a.csv", log(**place).drop(columns=["x", "y"]))
    assert np.isnan(run.pose[gone, :2]).all()
    assert np.isfinite(run.pose[~gone]).all()


def test_rows_of_commands_between_those_of_the_pose_hide_no_unit(tmp_path: Path) -> None:
    """As of two tables that were joined, with rows of the same times."""
    pose = log(psi=np.degrees(PSI).round(2)).drop(columns=[*SHAFTS])
    commands = pd.DataFrame({"time": TIME, **SHAFTS})
    both = pd.concat([pose, commands]).sort_values("time", kind="stable")
    both.to_csv(tmp_path / "a.csv", index=False)
    assert propose(tmp_path / "a.csv", OTTER).by_numbers == {"psi": "deg"}


def test_revolutions_of_a_generator_are_none_of_a_shaft(tmp_path: Path) -> None:
    others = {"ME1_RPM_ACT": 59.0, "ME1_RPM_ORD": 60.0 + TIME, "DG1_RPM": 1800.0, "rudder": 0.1}
    table = log(**others).drop(columns=[*SHAFTS])
    run = seen(tmp_path / "a.csv", table, TANKER)
    assert run.called is not None
    assert run.called["propeller.n"] == "ME1_RPM_ORD"


def test_a_side_is_the_sign_of_a_thruster_that_pushes_sideways(tmp_path: Path) -> None:
    """To port is negative."""
    of = ship_with((), "cybership2")
    power = np.sin(TIME).round(3)
    others = {s: 1.0 for s in of.commands if s != "bow.u"}
    table = log(**others, bow_power=np.abs(power), bow_side=np.where(power < 0.0, "P", "S"))
    path = tmp_path / "a.csv"
    path.with_suffix(".csv.json").write_text('{"columns": {"bow.u": "bow_power"}}')
    run = seen(path, table, of)
    assert run.commands is not None
    np.testing.assert_allclose(run.commands[:, run.signals.index("bow.u")], power, atol=1e-9)


def test_a_rate_of_turn_that_is_coded_as_by_ais_is_not_used() -> None:
    """Whole degrees per minute are no such code, and a unit."""
    t, rng = np.arange(0.0, 1500.0), np.random.default_rng(0)
    psi, rate = 2.0 * np.sin(0.01 * t), 0.02 * np.cos(0.01 * t)
    pose = np.column_stack([np.cumsum(5.0 * np.cos(psi)), np.cumsum(5.0 * np.sin(psi)), psi])
    pose += rng.normal(0.0, 1e-3, pose.shape)
    per_minute = 60.0 * np.degrees(rate)
    code = np.round(4.733 * np.sign(rate) * np.sqrt(np.abs(per_minute)))
    run = Run("a", t, pose, np.ones((t.size, 3)), measured={"r": code})
    found = without_code(run)
    assert "r" not in found.run.measured
    assert found.notes == ("r is coded as by AIS, by roots of degrees per minute: it is not used",)
    for other in (np.round(per_minute), rate, np.round(per_minute) + 0.5):
        measured = replace(run, measured={"r": other})
        assert without_code(measured).run is measured


def test_a_rate_of_turn_that_is_not_available_is_none(tmp_path: Path) -> None:
    gone = np.arange(TIME.size) % 20 == 3
    run = seen(tmp_path / "a.csv", log(**{"ROT [deg/min]": np.where(gone, -128.0, 60.0 * TIME)}))
    assert np.isnan(run.measured["r"]).tolist() == gone.tolist()
    below = np.where(gone, -128.0, -200.0)
    kept = seen(tmp_path / "b.csv", log(**{"ROT [deg/min]": below}))
    assert np.isfinite(kept.measured["r"]).all()
