"""The 31 training runs of the tanker Esso Osaka are read by one side-car that the program proposes."""

import json

import pytest
from support.measured import DATA
from test_diagnosis_commands import run

import diagnosis
from cosim import InputError
from diagnosis import propose_columns
from diagnosis.predictors import ship_with
from diagnosis.runs import prepare
from diagnosis.runs.measured_channels import channels_of

ESSO = DATA / "esso_osaka"
RUNS = sorted(ESSO.glob("*.csv"))
NAMES = {
    "time": "t [s]",
    "x": "x_position_mid [m]",
    "y": "y_position_mid [m]",
    "psi": "psi_hat [rad]",
    "propeller.n": "n_prop [rps]",
    "rudder.delta": "delta_rudder [rad]",
    "wind_speed": "wind_velo_true [m/s]",
    "wind_direction": "wind_dir_true [rad]",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Copies of the runs, beside which a side-car may be written."""
    if not RUNS:
        pytest.skip(f"no measured runs in {ESSO}")
    made = tmp_path_factory.mktemp("esso")
    for path in RUNS:
        (made / path.name).write_bytes(path.read_bytes())
    return made


@pytest.mark.slow
def test_one_side_car_for_all(folder):
    arguments = ["--write", "--ship", "esso_osaka", *sorted(folder.glob("*.csv"))]
    code, shown, *_ = run(propose_columns.main, *arguments)
    assert code == 0, shown
    columns = json.loads((folder / "columns.json").read_text())["columns"]
    assert columns.items() >= NAMES.items(), "all that its predictions need"
    craft, refused = ship_with((), "esso_osaka"), {}
    for path in sorted(folder.glob("*.csv")):
        smoothed = prepare(path, craft).smoothed
        pose = {c.name: c for c in channels_of(smoothed) if c.name in ("x", "y", "psi")}
        assert len(pose) == 3
        assert all(c.rate == pytest.approx(10.0, rel=0.01) for c in pose.values()), path.name
        try:
            diagnosis.load(path, ship="esso_osaka")
        except InputError as error:
            refused[path.stem] = str(error)
    # They end with half a minute to a minute of zero commands, in which the tanker accelerates.
    assert {*refused} <= {
        "random_06-Aug-2020_16_24_25_6",
        "random_31-Jul-2020_12_29_58",
        "random_31-Jul-2020_14_52_18",
    }
    assert all("all commands are zero for" in text for text in refused.values())
