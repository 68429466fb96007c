"""The wind over time: in the vessel's FMU, in runs of a scenario, and in predictions of a measured run."""

import json
from dataclasses import replace
from math import cos, pi, sin
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.project import ROOT
from support.ships import SHIPS

import cosim
import diagnosis
from benchmarks.ships.same_windows import Continuous, Nominal, law_errors, table
from diagnosis import Model
from diagnosis.predictors import weak_windows
from diagnosis.predictors.weak_form import omega
from diagnosis.runs import prepare, read_frame
from diagnosis.runs.measured_wind import air_along
from diagnosis.search.findings import Findings
from diagnosis.search.prediction_fit.coefficient_calibration import Calibrator
from diagnosis.search.prior import NominalPrior
from fmus.declare import DeclarationError, packer
from fmus.effects import Motion
from fmus.frames import air_velocity, rotate_to_body
from fmus.ship import ship
from fmus.ships.ship_file import find_ship, read_ship
from fmus.ships.wind import Superstructure, described_numbers, regression
from fmus.signals import Force, ForceInWind

TANKER = SHIPS["esso_osaka"]
SHIP = ship(description=TANKER)
COMMANDS = (10.0, 0.1)  # shaft speed and rudder angle
speed, angle = st.floats(-0.6, 0.6), st.floats(-pi, pi)


def stepped(inputs, values=None, seconds=10.0, of=SHIP):
    """Outputs of the vessel after some time of constant inputs."""
    c = of.vessel
    names = [v.name for v in c.variables]
    start = [float((values or {}).get(v.name, v.start)) for v in c.variables]
    p = packer(c.params)(start[: names.index("tau_X")])
    b, s = c.prepared(p), c.init(c.inputs(), p)
    s, out = c.advance(s, inputs, b, 0.05)
    for _ in range(int(seconds / 0.05) - 1):
        s, out = c.advance(s, inputs, b, 0.05)
    return out


# The force


@given(speed, speed, angle, st.floats(0.0, 5.0), angle)
def test_wind_is_mirrored_and_pushes_along(u, v, psi, W, zeta):
    (wind,) = [e for e in SHIP.effects.values() if e.id == "wind"]
    numbers = [p.start for p in wind.parameters[2:]]

    def force(side):
        s = Motion(psi=side * psi, u=u, v=side * v)
        return wind(s, *air_velocity(W, side * zeta), *numbers)

    X, Y, N = force(1.0)
    assert force(-1.0) == pytest.approx((X, -Y, -N), abs=1e-12)
    _, aside = rotate_to_body(psi, *air_velocity(W, zeta))
    assert Y * (aside - v) >= 0.0


def test_the_regression_has_no_size():
    """Its coefficients are of shape alone."""
    given = {v.name: v.value for v in TANKER.wind}
    units = {v.name: v.unit for v in described_numbers(given)}
    at = type(TANKER.scale)(7.0)
    larger = {name: x * at.factor(units[name]) for name, x in given.items()}
    small, large = (
        regression(k * TANKER.length, k * TANKER.beam, Superstructure(**numbers))
        for k, numbers in ((1.0, given), (7.0, larger))
    )
    assert large == pytest.approx(small)


# The vessel


def test_only_a_ship_with_a_measured_wind_has_it_as_an_input():
    assert SHIP.vessel.inputs is ForceInWind
    for name in ("cse1", "gunnerus"):
        assert ship(description=SHIPS[name]).vessel.inputs is Force


def test_only_a_measured_wind_has_coefficients_with_a_prior(tmp_path):
    groups = {n: known.group for n, known in SHIP.coefficients.items()}
    assert {n for n, group in groups.items() if group == "wind"} == {"wind_drift"} | set(
        regression(1.0, 1.0, Superstructure())
    )
    without = ship(description=TANKER._replace(wind_measured=False))
    assert "wind" not in {known.group for known in without.coefficients.values()}
    text = find_ship("esso_osaka").read_text(encoding="utf-8").partition("[wind]")[0]
    of_drag = (
        "frontal_area = { value = 0.1, rel_std = 0.0 }\nlateral_drag = { value = 1.1, rel_std = 0.2 }"
    )
    (tmp_path / "mine.toml").write_text(f"{text}[wind]\nmeasured = true\n{of_drag}\n", encoding="utf-8")
    known = ship(description=read_ship(tmp_path / "mine.toml")).coefficients
    assert "frontal_area" not in known
    assert known["lateral_drag"].deviation(1.1) == pytest.approx(0.22)


def test_a_measured_wind_is_the_wind_of_the_effect():
    W_n, W_e = air_velocity(1.5, 2.0)
    measured = stepped(ForceInWind(2.0, 0.0, 0.0, 1.5, 2.0))
    effect = stepped(ForceInWind(2.0, 0.0, 0.0), {"W_n": W_n, "W_e": W_e})
    assert tuple(measured.pose) == pytest.approx(tuple(effect.pose), rel=1e-12)
    assert tuple(measured.outside) == pytest.approx(tuple(effect.outside))
    # The nominal model has the measured wind as well, and the one of the effect not.
    assert (measured.omega_X, measured.omega_Y, measured.omega_N) == pytest.approx(
        (0.0, 0.0, 0.0), abs=1e-9
    )
    assert abs(effect.omega_Y) > 0.1
    both = stepped(ForceInWind(2.0, 0.0, 0.0, 1.5, 2.0), {"W_n": -W_n, "W_e": -W_e})
    calm = stepped(ForceInWind(2.0, 0.0, 0.0))
    assert tuple(both.pose) == pytest.approx(tuple(calm.pose), abs=1e-12)


def test_a_wind_that_is_not_known_is_calm():
    lost, calm = (stepped(ForceInWind(1.0, 0.0, 0.0, *w)) for w in ((np.nan, np.nan), (0.0, 0.0)))
    assert tuple(lost.pose) == tuple(calm.pose)


def test_in_a_current_the_wind_is_over_the_water():
    """Water and air that move together are still air, in which a ship at rest in the water stays so."""
    moved = {"V_n": 0.2, "V_e": -0.1, "u_0": 0.2, "v_0": -0.1, "psi_0": 0.0}
    zeta = np.arctan2(0.1, -0.2)
    out = stepped(ForceInWind(0.0, 0.0, 0.0, np.hypot(0.2, 0.1), zeta), moved, 20.0)
    assert (out.velocity.u, out.velocity.v, out.velocity.r) == pytest.approx((0.2, -0.1, 0.0), abs=1e-9)


def test_the_measured_wind_moves_the_water_by_its_share():
    """As a current of that share does, and not at all where the ship's wind is not measured."""
    share, (W_n, W_e) = 0.03, air_velocity(1.5, 2.0)
    blown = ForceInWind(2.0, 0.5, 0.1, 1.5, 2.0)
    drifting, current = (
        stepped(blown, values)
        for values in ({"wind_drift": share}, {"V_n": share * W_n, "V_e": share * W_e})
    )
    assert tuple(drifting.pose) == pytest.approx(tuple(current.pose), rel=1e-12)
    assert tuple(drifting.velocity) == pytest.approx(tuple(current.velocity), rel=1e-12)
    assert drifting.pose.x != pytest.approx(stepped(blown).pose.x, abs=1e-3)
    assert "wind_drift" not in SHIPS["gunnerus"].wind
    assert "wind_drift" not in ship(description=SHIPS["gunnerus"]).parameters["vessel"]


# A run


def scenario(tmp_path, **recorded):
    content = json.loads((ROOT / "scenarios" / "esso_osaka_stop.json").read_text()) | {"stop": 40.0}
    content["fmus"]["guidance"]["parameters"]["start"] = 35.0
    table = {"time": [0.0, 20.0], "wind_speed": [2.0, 0.5], "wind_direction": [1.0, 2.5]} | recorded
    pd.DataFrame(table).to_csv(tmp_path / "wind.csv", index=False)
    content["recordings"][0]["path"] = str(tmp_path / "wind.csv")
    return cosim.load_scenario(content)


@pytest.mark.slow
def test_a_run_takes_the_wind_of_a_file(tmp_path):
    assert cosim.simulate(scenario(tmp_path), tmp_path / "out").status == "done"
    log = cosim.read_log(tmp_path / "out")
    rows = {0.5: (2.0, 1.0), 25.0: (0.5, 2.5)}
    for t, blows in rows.items():
        k = np.searchsorted(log["time"], t)
        found = log["vessel.wind_speed"][k], log["vessel.wind_direction"][k]
        assert found == pytest.approx(blows)


# Predictions of a measurement


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """A run of the tanker in gusts, its pose as it was, and the wind true and relative."""
    folder = tmp_path_factory.mktemp("wind")
    time = np.arange(0.0, 61.0, 1.0)
    gusts = {
        "time": time,
        "wind_speed": 2.0 + np.sin(0.4 * time),
        "wind_direction": 1.0 + 0.1 * np.sin(time),
    }
    done = cosim.simulate(scenario(folder, **gusts), folder / "out")
    assert done.status == "done"
    log = cosim.read_log(folder / "out")
    table = {name: log[f"vessel.{name}"] for name in ("x", "y", "psi", "wind_speed", "wind_direction")}
    table |= {"time": log["time"], "propeller.n": log["guidance.n"], "rudder.delta": 0.0 * log["time"]}
    a = table["wind_direction"] - table["psi"]
    ahead = table["wind_speed"] * np.cos(a) + log["vessel.u"]
    aside = table["wind_speed"] * np.sin(a) + log["vessel.v"]
    table["wind_speed_relative"] = np.hypot(ahead, aside)
    table["wind_direction_relative"] = np.arctan2(aside, ahead)
    return pd.DataFrame(table).iloc[::2]


def smoothed(table, *dropped):
    columns = [c for c in table.columns if not c.startswith(dropped)] if dropped else table.columns
    run = read_frame(table[list(columns)], of=SHIP)
    return prepare(run, of=SHIP).smoothed


def missed(run, model):
    position, heading = diagnosis.Windows([run], 15.0).errors(model).over_all()
    return float(position), float(heading)


@pytest.mark.slow
def test_predictions_take_the_measured_wind(measured):
    nominal = Model(ship=SHIP)
    true = smoothed(measured, "wind_speed_relative", "wind_direction_relative")
    with_wind, heading = missed(true, nominal)
    calm, turned = missed(smoothed(measured, "wind"), nominal)
    assert with_wind < 0.1 * calm
    assert heading < 0.3 * turned
    without = Model(ship=ship(description=TANKER._replace(wind_measured=False)))
    assert missed(true, without)[0] > 5.0 * with_wind
    left, blown = (np.abs(omega(weak_windows(true), m)).mean(axis=0) for m in (nominal, without))
    assert (left[1:] < 0.3 * blown[1:]).all()


@pytest.mark.slow
def test_methods_in_the_table_of_ships_meet_the_measured_wind(measured):
    """Their nominal model predicts as the project's does; in forces they see that of the wind."""
    run = smoothed(measured, "wind_speed_relative", "wind_direction_relative")
    wrong = Model(ship=SHIP).plus({"wind_Y_1": SHIP.parameters["vessel"]["wind_Y_1"].start})
    nominal, windows = Nominal(wrong, run.track.run.commands), diagnosis.Windows([run], 15.0)
    errors = law_errors(Continuous(nominal.acceleration, 0.05), windows)
    assert errors == pytest.approx(windows.errors(wrong).over_all(), rel=0.02)
    t = table(run, 0.5)
    assert t.given.shape[1] == len(COMMANDS) + 2
    part = t.parts[0]
    forces = nominal.inputs("forces", t.nu[part], t.given[part])
    assert forces.shape[1] == 6
    assert np.abs(forces[:, 4]).max() > 1e-4, "the wind accelerates the ship at rest to the side"


@pytest.mark.slow
def test_calibration_finds_the_force_of_a_measured_wind(measured):
    """From a force that is a third too large sideways, all else known, it returns to the simulated one."""
    run = weak_windows(smoothed(measured, "wind_speed_relative", "wind_direction_relative"))
    true = SHIP.parameters["vessel"]["wind_Y_1"].start
    start = Model(ship=SHIP).plus({"wind_Y_1": 0.35 * true})
    others = {known.group for known in SHIP.coefficients.values()} - {"wind"}
    prior = NominalPrior.of(start, dict.fromkeys(others, 0.0))
    fit = Calibrator(Findings(model=start, searched=prior), [run], start, prior).coefficients()
    assert fit.findings.model.value("wind_Y_1") == pytest.approx(true, rel=0.1)
    assert start.value("wind_Y_1") > 1.3 * true


@pytest.mark.slow
def test_calibration_finds_that_the_water_does_not_move_with_the_wind(measured):
    """All else known, from a share of 2 % it returns to none; propeller and rudder meet the same water."""
    run = weak_windows(smoothed(measured, "wind_speed_relative", "wind_direction_relative"))
    start = Model(ship=SHIP).plus({"wind_drift": 0.02})
    prior = NominalPrior.of(start, {name: 0.0 for name in SHIP.coefficients if name != "wind_drift"})
    fit = Calibrator(Findings(model=start, searched=prior), [run], start, prior).coefficients()
    assert fit.findings.model.value("wind_drift") == pytest.approx(0.0, abs=0.002)


@pytest.mark.slow
def test_the_relative_wind_gives_the_true_one(measured):
    whole = smoothed(measured)
    run, keep = whole.track.run, ("wind_speed_relative", "wind_direction_relative")
    alone = replace(run, measured={n: run.measured[n] for n in keep})
    found = air_along(alone, whole.eta[:, 2], whole.nu)
    assert found == pytest.approx(whole.air, abs=0.05)


@pytest.mark.slow
def test_gaps_of_the_wind_are_bridged_and_none_is_none(measured):
    table = measured.copy()
    table.loc[table.index[100:140], "wind_speed"] = np.nan
    run = smoothed(table, "wind_speed_relative", "wind_direction_relative")
    assert run.air is not None
    assert np.isfinite(run.air).all()
    assert smoothed(measured, "wind").air is None


# The file


def described(tmp_path, *, without="", also=""):
    lines = find_ship("esso_osaka").read_text(encoding="utf-8").splitlines()
    kept = [line for line in lines if not (without and line.startswith(f"{without} "))]
    (tmp_path / "mine.toml").write_text("\n".join([*kept, also]), encoding="utf-8")
    return read_ship(tmp_path / "mine.toml")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"without": "lateral_height"}, "wind: lateral_height is missing"),
        ({"also": "lateral_drag = 0.9"}, "wind: unknown key 'lateral_drag'"),
        ({"without": "superstructure_area"}, "wind: unknown key 'lateral_height'"),
        ({"without": "measured", "also": "measured = 1"}, "wind.measured"),
        ({"without": "air_density", "also": "air_density = -1.0"}, "out of its range"),
    ],
)
def test_a_wrong_wind_is_refused_in_a_line(tmp_path, change, message):
    with pytest.raises(DeclarationError, match=message):
        described(tmp_path, **change)


def test_a_measured_wind_needs_what_it_acts_on(tmp_path):
    text = find_ship("esso_osaka").read_text(encoding="utf-8").partition("[wind]")[0]
    (tmp_path / "mine.toml").write_text(f"{text}[wind]\nmeasured = true\n", encoding="utf-8")
    with pytest.raises(DeclarationError, match="wind: frontal_area is missing"):
        read_ship(tmp_path / "mine.toml")


def test_directions_are_from_where_it_blows():
    """A northerly wind moves the air to the south."""
    assert air_velocity(3.0, 0.0) == pytest.approx((-3.0, 0.0))
    assert air_velocity(3.0, 0.5 * pi) == pytest.approx((-3.0 * cos(0.5 * pi), -3.0 * sin(0.5 * pi)))


@pytest.mark.parametrize("relative", [False, True])
def test_the_air_is_that_of_the_measured_wind_and_on_a_line_where_none_was_measured(relative):
    """A wind is named by where it comes from; relative to the ship, whose velocity it does not have."""
    rng, n = np.random.default_rng(6), 50
    time, psi = np.cumsum(rng.uniform(0.1, 1.0, n)), rng.uniform(-9.0, 9.0, n)
    nu, air = rng.normal(size=(n, 3)), rng.normal(size=(n, 2))
    c, s = np.cos(psi), np.sin(psi)
    seen = air.copy()
    if relative:
        seen = (
            np.column_stack([c * air[:, 0] + s * air[:, 1], c * air[:, 1] - s * air[:, 0]]) - nu[:, :2]
        )
    power, from_ = np.hypot(*seen.T), np.arctan2(-seen[:, 1], -seen[:, 0])
    lost = np.isin(np.arange(n), [0, 1, 20, 21, 22, 49])
    power[lost] = np.nan
    after = "_relative" if relative else ""
    run = SimpleNamespace(
        time=time, measured={f"wind_speed{after}": power, f"wind_direction{after}": from_}
    )
    expected = np.column_stack([np.interp(time, time[~lost], x[~lost]) for x in air.T])
    assert air_along(run, psi, nu) == pytest.approx(expected, abs=1e-9)
    del run.measured[f"wind_direction{after}"]
    assert air_along(run, psi, nu) is None
    run.measured = {f"wind_speed{after}": np.full(n, np.nan), f"wind_direction{after}": from_}
    assert air_along(run, psi, nu) is None
