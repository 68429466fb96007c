"""An ensemble on numbers that are given: which parameters are drawn, what is run, and what is shown."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from cosim import InputError, SimulationError
from cosim.campaign import ensemble
from cosim.campaign.ensemble import run_ensemble, spread
from cosim.trials.measures import EVERY


def variable(name, unit="kg", causality="parameter", kind="Real", low=None, high=None):
    return SimpleNamespace(
        name=name,
        causality=causality,
        type=kind,
        min=low,
        max=high,
        unit=None if unit is None else SimpleNamespace(name=unit),
    )


class Entry(SimpleNamespace):
    def model_copy(self, update):
        return Entry(**(vars(self) | update))


def system(seed=3):
    variables = {
        v.name: v
        for v in (
            variable("m", low=0.0),
            variable("k", None),
            variable("u", causality="output"),
            variable("n", kind="Integer"),
        )
    }
    models = {
        "vessel": SimpleNamespace(name="vessel", variables=variables),
        "twin": SimpleNamespace(name="vessel", variables=variables),
    }
    scenario = Entry(
        name="s", seed=seed, stop=10.0, step=0.1, roles=SimpleNamespace(pose=("vessel.x", "vessel.y", "vessel.psi")),
        fmus={"vessel": Entry(parameters={"a": 1.0}, table="t")}, log=None,
    )  # fmt: skip
    return SimpleNamespace(
        models=models, scenario=scenario, warnings=["careful"], parameters={"vessel": [(variables["m"], 9.0)]},
        closed=False,
    )  # fmt: skip


def posterior(names=("vessel.m", "vessel.k"), units=("kg", "1"), std=1.0):
    def draws(members, rng):
        return np.array([5.0, -1.0])[: len(names)] + std * rng.standard_normal((members, len(names)))

    return SimpleNamespace(names=names, units=units, draws=draws)


def axes(given, members=4, beside=()):
    said = []
    found = ensemble._axes(system(), given, members, set(beside), Path("p.json"), said.append)
    return found, said


def test_each_parameter_is_drawn_for_every_fmu_of_its_model():
    found, said = axes(posterior())
    drawn = posterior().draws(4, np.random.default_rng(3))
    assert found["vessel.m"] == {
        "set": ["fmus.vessel.parameters.m", "fmus.twin.parameters.m"], "values": drawn[:, 0].tolist(),
    }  # fmt: skip
    assert found["vessel.k"]["values"] == drawn[:, 1].tolist()
    assert said == []


def test_values_beyond_a_range_are_clipped_with_a_note():
    found, said = axes(posterior(std=100.0), 50)
    drawn = posterior(std=100.0).draws(50, np.random.default_rng(3))[:, 0]
    assert found["vessel.m"]["values"] == np.maximum(drawn, 0.0).tolist()
    outside = (drawn < 0.0).sum()
    assert said == [f"note: {outside} of 50 values drawn for vessel.m are clipped to its range"]


def test_what_is_no_parameter_of_an_fmu_is_left_out_with_a_note():
    found, said = axes(posterior(), beside=["vessel.k"])
    assert [*found] == ["vessel.m"]
    assert said == ["note: 'p.json': vessel.k is not a parameter of an FMU and has no effect here"]
    with pytest.raises(InputError, match="has no parameter of an FMU that runs here"):
        axes(posterior(), beside=["vessel.k", "vessel.m"])


@pytest.mark.parametrize(
    ("name", "unit", "message"),
    [
        ("vesel.m", "kg", "no model 'vesel' for 'vesel.m' runs here; did you mean 'vessel'"),
        ("vessel.mm", "kg", "vessel has no parameter 'mm'; did you mean 'm'"),
        ("vessel.u", "kg", "has no parameter 'u'"), ("vessel.n", "kg", "has no parameter 'n'"),
        ("vessel.m", "g", "vessel.m is in 'g', and in 'kg' in the FMU"),
    ],
)  # fmt: skip
def test_what_no_fmu_has_is_refused(name, unit, message):
    with pytest.raises(InputError, match=message):
        axes(posterior((name,), (unit,)))


@pytest.mark.parametrize(("stop", "rows"), [(10.0, 2000), (10.0, 100), (10.0, 99), (10.0, 33)])
def test_members_log_their_pose_in_so_many_rows(monkeypatch, stop, rows):
    monkeypatch.setattr(ensemble, "ROWS", rows)
    found = ensemble._resolved(system())
    assert found.fmus["vessel"].parameters == {"m": 9.0}
    assert found.fmus["vessel"].table is None
    assert found.log.signals == ["vessel.x", "vessel.y", "vessel.psi"]
    every = found.log.every
    assert 100 / every <= rows
    assert every == 1 or 100 / (every - 1) > rows


@pytest.fixture
def made(monkeypatch, tmp_path):
    """Runs an ensemble of which the campaign is given; returns what was asked, and what was said."""
    asked, said = {}, []
    of = system()
    of.close = lambda: setattr(of, "closed", True)
    table = pd.DataFrame(
        {
            "status": ["done", "failed", "done"],
            "message": ["", "it broke", ""],
            "hash": ["a" * 40, "b" * 40, "c" * 40],
        }
    )

    def run_campaign(content, folder, workers, **more):
        asked.update(content=content, folder=folder, workers=workers, **more)
        folder.mkdir(parents=True, exist_ok=True)
        return asked["table"]

    def read_log(folder, names):
        asked.setdefault("logs", []).append(folder)
        k = 1.0 if "a" in folder.name else 2.0
        psi = np.array([3.0, 3.1, -3.1])
        return {
            "time": np.arange(3.0),
            "vessel.x": k * np.arange(3.0),
            "vessel.y": np.zeros(3),
            "vessel.psi": psi,
        }

    monkeypatch.setattr(ensemble, "prepare", lambda *of_, **more: of)
    monkeypatch.setattr(ensemble, "read_posterior", lambda path: posterior())
    monkeypatch.setattr(ensemble, "find_parameters", lambda paths: [])
    monkeypatch.setattr(ensemble, "demand_packages", lambda: None)
    monkeypatch.setattr(ensemble, "run_campaign", run_campaign)
    monkeypatch.setattr(ensemble, "read_log", read_log)
    asked["table"] = table
    monkeypatch.chdir(tmp_path)

    def run(members=3, **more):
        found = run_ensemble(of.scenario, Path("p.json"), members, show=said.append, **more)
        assert of.closed
        return found

    return SimpleNamespace(run=run, asked=asked, said=said, table=table, system=of, folder=tmp_path)


def test_an_ensemble_is_a_campaign_of_the_members_that_are_drawn(made):
    found = made.run(pictures=False)
    assert found is made.table
    asked = made.asked
    assert asked["folder"] == Path("results/s_ensemble")
    assert (asked["content"]["design"], asked["content"]["seed"]) == ("list", 3)
    assert [len(a["values"]) for a in asked["content"]["axes"].values()] == [3, 3]
    assert (asked["keep_logs"], asked["overwrite"]) == (True, False)
    assert asked["base"].fmus["vessel"].parameters == {"m": 9.0}
    assert made.said == ["warning: careful"]
    assert len(asked["logs"]) == 2, "those that went through"
    bands = pd.read_csv("results/s_ensemble/bands.csv")
    assert bands["time"].tolist() == [0.0, 1.0, 2.0]
    assert bands["x_mean"].tolist() == [0.0, 1.5, 3.0]
    assert bands["psi_mean"].to_numpy() == pytest.approx([3.0, 3.1, 2.0 * np.pi - 3.1]), "over turns"
    assert not Path("results/s_ensemble/bands.png").exists()


def test_a_picture_is_drawn_where_it_is_wanted(made, monkeypatch):
    from cosim.campaign import charts

    def draw(found, poses):
        assert poses.shape == (2, 3, 3)
        return SimpleNamespace(savefig=lambda path, **how: Path(path).write_text(how["format"]))

    monkeypatch.setattr(charts, "draw_bands", draw)
    made.run(out=made.folder / "out")
    assert (made.folder / "out" / "bands.png").read_text() == "png"


def test_where_every_member_fails_there_is_no_ensemble(made):
    made.asked["table"] = made.table.iloc[[1]]
    with pytest.raises(SimulationError, match="every member failed: it broke"):
        made.run()


def test_one_member_is_no_ensemble(made):
    with pytest.raises(InputError, match="two members or more; got 1"):
        made.run(1)
    assert not made.asked.get("content")


def test_the_metrics_of_the_members_have_their_spread():
    name, unit, meaning = EVERY[0]
    values = np.arange(101.0)
    shown = spread(pd.DataFrame({name: [*values, np.nan], EVERY[1][0]: [np.nan] * 102}))
    cells = [[*column.cells] for column in shown.columns]
    assert cells == [[name], ["50"], ["5"], ["95"], [unit], [meaning]]
    assert [column.justify for column in shown.columns] == [
        "left",
        "right",
        "right",
        "right",
        "left",
        "left",
    ]
