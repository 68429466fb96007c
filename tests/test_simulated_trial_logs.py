"""Logs of simulated trials, in which orders go to the actuators: the diagnosis reads them as they were."""

import json

import numpy as np
import pytest
from support.project import ROOT

import cosim
import diagnosis
from diagnosis import Model, omega
from diagnosis.predictors.uncertainty import omega_std
from diagnosis.predictors.weak_form import commanded
from fmus.ship import ship


@pytest.fixture(
    scope="module", params=["kvlcc2_zigzag", "otter_zigzag", "gunnerus_circle", "esso_osaka_stop"]
)
def runs(request, tmp_path_factory):
    """The runs of a log with all signals, and of a compact one."""
    folder = tmp_path_factory.mktemp(request.param)
    content = json.loads((ROOT / "scenarios" / f"{request.param}.json").read_text())
    content |= {"stop": 60.0, "metrics": {}}
    for recording in content.get("recordings", ()):
        recording["path"] = str(ROOT / "scenarios" / recording["path"])
    for log in ("all", "compact"):
        assert cosim.simulate(content, folder / log, log=log, pictures=False).status == "done"
    return [diagnosis.load(folder / log)[0] for log in ("all", "compact")]


@pytest.mark.slow
def test_a_compact_log_holds_the_commands_and_the_wind(runs):
    full, compact = (w.run for w in runs)
    assert full.signals == compact.signals
    assert np.array_equal(full.commands, compact.commands)
    assert full.measured.keys() == compact.measured.keys()
    assert {*full.measured} == (
        {"wind_speed", "wind_direction"} if full.ship.name == "esso_osaka" else set()
    )


@pytest.mark.slow
def test_the_model_that_made_a_log_leaves_no_error(runs):
    """In the median of windows; without its wind, the tanker Esso Osaka has 0.6 N in sway."""
    w = runs[1]
    model = Model(ship=ship(description=w.run.ship))
    parts = omega(w, model), omega_std(w, model), commanded([w], model)
    left, noise, command = (np.median(np.abs(x), axis=0) for x in parts)
    assert (left < 2.0 * noise + 0.002 * command).all()
