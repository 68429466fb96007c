"""What a run holds beside pose and commands is read by names, units and signs as the pose is."""

import json

import numpy as np
import pandas as pd
import pytest

import diagnosis
from cosim import InputError
from diagnosis.predictors import ship_with

N = 200
T = np.arange(N) * 0.1


def table(**more):
    still = dict.fromkeys(("tau_X", "tau_Y", "tau_N"), np.zeros(N))
    return pd.DataFrame({"time": T, "x": T, "y": np.sin(T), "psi": np.cos(T)} | still | more)


def test_channels_of_their_own_names_are_read_in_SI(tmp_path):
    table(u=1.0 + T, r=np.sin(T), wind_speed=T).to_csv(tmp_path / "a.csv", index=False)
    run = diagnosis.read(tmp_path / "a.csv")
    assert set(run.measured) == {"u", "r", "wind_speed"}
    np.testing.assert_allclose(run.measured["u"], 1.0 + T, rtol=1e-12)
    half = run.rows(np.arange(0, N, 2))
    np.testing.assert_allclose(half.measured["u"], (1.0 + T)[::2], rtol=1e-12)


def test_names_units_signs_and_noise_are_told_beside(tmp_path):
    path = tmp_path / "a.csv"
    table(SOG=T, ROT=T).to_csv(path, index=False)
    columns = {
        "speed": {"name": "SOG", "unit": "kn", "noise": 0.1},
        "r": {"name": "ROT", "unit": "deg/min", "flip": True},
    }
    path.with_name("a.csv.json").write_text(json.dumps({"columns": columns}))
    run = diagnosis.read(path)
    np.testing.assert_allclose(run.measured["speed"], T * 1852.0 / 3600.0, rtol=1e-12)
    np.testing.assert_allclose(run.measured["r"], -np.radians(T) / 60.0, rtol=1e-12)
    assert run.noise == {"speed": pytest.approx(0.1 * 1852.0 / 3600.0)}


def test_a_unit_of_another_quantity_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    table(r=T).to_csv(path, index=False)
    path.with_name("a.csv.json").write_text('{"columns": {"r": {"name": "r", "unit": "m/s"}}}')
    with pytest.raises(InputError, match="is not a unit of r"):
        diagnosis.read(path)


def test_units_stand_in_the_names_of_a_frame():
    run = diagnosis.runs.read_frame(table(**{"r [deg/s]": T, "u (kn)": T}))
    np.testing.assert_allclose(run.measured["r"], np.radians(T), rtol=1e-12)
    np.testing.assert_allclose(run.measured["u"], T * 1852.0 / 3600.0, rtol=1e-12)


def test_what_an_actuator_gives_is_read_beside_its_command():
    otter = ship_with((), "otter")
    pose = pd.DataFrame({"time": T, "x": T, "y": np.sin(T), "psi": np.cos(T)})
    both = dict.fromkeys(otter.commands, T)
    run = diagnosis.runs.read_frame(pose.assign(**both, **{"port.thrust [kN]": T}), of=otter)
    np.testing.assert_allclose(run.measured["port.thrust"], 1e3 * T, rtol=1e-12)
    assert run.signals == tuple(otter.commands)


def test_what_is_missing_in_a_channel_is_missing_in_the_run():
    gone = np.where(T > 10.0, np.nan, T)
    run = diagnosis.runs.read_frame(table(u=gone))
    assert np.isnan(run.measured["u"][T > 10.0]).all()
