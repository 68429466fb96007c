"""Measured runs of the tanker Esso Osaka are read by one side-car that the program proposes."""

import json

import numpy as np
import pandas as pd
import pytest
from support.command import command
from support.measured import DATA

from diagnosis import Model, propose_columns, runs
from diagnosis.assessment.command_check import moves_on
from diagnosis.predictors import ship_with, weak_windows
from diagnosis.runs import prepare, read, read_frame
from diagnosis.runs.measured_channels import channels_of

ESSO = DATA / "esso_osaka"
# One whose receiver repeats poses, and one that ends with a minute of zero commands in which the tanker
# accelerates, of which the last five minutes are read. All 31 are read likewise, in three minutes.
LAST = 3000  # rows
HELD, UNLOGGED = "berthing_12-Nov-2020_11_14_47", "random_31-Jul-2020_14_52_18"
DRIFT = "random_06-Aug-2020_16_24_25_6"  # ends with 49 s at rest in the wind, with zero commands
RUNS = [HELD, UNLOGGED]
POSE = {"x": "x_position_mid [m]", "y": "y_position_mid [m]", "psi": "psi_hat [rad]"}
NAMES = POSE | {
    "time": "t [s]",
    "propeller.n": "n_prop [rps]",
    "rudder.delta": "delta_rudder [rad]",
    "wind_speed": "wind_velo_true [m/s]",
    "wind_direction": "wind_dir_true [rad]",
}


pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not ESSO.is_dir(), reason=f"no measured runs in {ESSO}"),
]


def test_one_side_car_for_all(tmp_path, monkeypatch):
    of_runs = {}

    def channels(smoothed):
        found = of_runs[smoothed.track.run.name] = [*channels_of(smoothed)]
        return found

    monkeypatch.setattr(runs, "channels_of", channels)
    paths = [tmp_path / f"{name}.csv" for name in RUNS]
    for path in paths:
        header, *rows = (ESSO / path.name).read_text().splitlines(keepends=True)
        path.write_text("".join([header, *rows[-LAST:]]))
    done = command(propose_columns.main, "--write", "--ship", "esso_osaka", *paths)
    assert done.returncode == 0, done.stderr
    columns = json.loads((tmp_path / "columns.json").read_text())["columns"]
    assert columns.items() >= NAMES.items(), "all that its predictions need"
    craft = ship_with((), "esso_osaka")
    for path in paths:
        table = pd.read_csv(path)
        pose, time = table[[*POSE.values()]].to_numpy(), table["t [s]"].to_numpy()
        span = time[-1] - time[0]
        rows, new = (time.size - 1) / span, np.count_nonzero(np.diff(pose, axis=0).all(axis=1)) / span
        np.testing.assert_allclose(read(path, of=craft).pose, pose)
        channels = {c.name: c for c in of_runs[path.stem]}
        for name in POSE:  # as often as all of the pose is new at least, at most each row
            assert new * 0.99 <= channels[name].rate <= rows * 1.001, (path.stem, name)
            repeats = (np.diff(table[POSE[name]]) == 0.0).mean()
            assert channels[name].held == pytest.approx(repeats, rel=0.1), (path.stem, name)
    assert "not usable yet" not in done.stdout


@pytest.mark.parametrize(("name", "asked"), [(DRIFT, False), (UNLOGGED, True)])
def test_a_drift_in_the_measured_wind_is_no_missing_command(name, asked):
    craft, table = ship_with((), "esso_osaka"), pd.read_csv(ESSO / f"{name}.csv")
    frame = pd.DataFrame({signal: table[column] for signal, column in NAMES.items()})
    w = weak_windows(prepare(read_frame(frame, of=craft), craft).smoothed)
    assert bool(moves_on(w, Model(ship=craft))) is asked
