"""Ensembles: ships drawn from a posterior together, their metrics and bands; posteriors that are none."""

import json

import numpy as np
import pandas
import pytest
from support.command import command

from cosim.campaign import Posterior, read_posterior, run_ensemble
from cosim.campaign.ensemble import bands
from cosim.run import main
from cosim.scenario.load import load_scenario

NAMES, UNITS, MEAN = ["vessel.delta_X_u", "thrusters.plant_F_vsp"], ["N.s/m", "N"], [-2.0, 1.165]
STD = np.array([0.4, 0.1])
TIED = np.array([[1.0, 0.98], [0.98, 1.0]])  # drag and thrust: more of both is hardly to be seen


def content(correlation=TIED, **changes):
    covariance = (STD[:, None] * correlation * STD).tolist()
    return {"names": NAMES, "units": UNITS, "mean": MEAN, "covariance": covariance} | changes


@pytest.fixture
def base(ellipse, tmp_path):
    """A folder with a scenario of 0.5 s and a posterior."""
    ellipse["stop"] = 0.5
    ellipse["metrics"] = {"from": 0.0}
    (tmp_path / "base.json").write_text(json.dumps(ellipse))
    (tmp_path / "posterior.json").write_text(json.dumps(content()))
    return tmp_path


def test_draws_have_the_mean_and_the_covariance():
    given = Posterior.model_validate(content())
    drawn = given.draws(20_000, np.random.default_rng(1))
    assert drawn.mean(axis=0) == pytest.approx(MEAN, abs=0.01)
    assert drawn.std(axis=0) == pytest.approx(STD, rel=0.03)
    assert np.corrcoef(drawn.T)[0, 1] == pytest.approx(0.98, abs=0.005)


def test_values_that_are_exact_stay_so():
    covariance = [[0.04, 0.0], [0.0, 0.0]]
    drawn = Posterior.model_validate(content(covariance=covariance)).draws(5, np.random.default_rng(1))
    assert set(drawn[:, 1]) == {MEAN[1]}
    assert len(set(drawn[:, 0])) == 5


def test_bands_hold_the_shares_of_the_members():
    rng = np.random.default_rng(2)
    time, spread = np.linspace(0.0, 10.0, 5), np.linspace(0.0, 2.0, 5)
    poses = 1.0 + spread * rng.standard_normal((4000, 3, 1))
    found = bands(time, poses)
    for share, low, high in ((0.5, 25, 75), (0.9, 5, 95)):
        for k, name in enumerate(["x", "y", "psi"]):
            ends = found[[f"{name}_{low}", f"{name}_{high}"]].to_numpy().T[..., None, :]
            inside = (poses[:, k] >= ends[0]) & (poses[:, k] <= ends[1])
            assert inside[:, 1:].mean(axis=0) == pytest.approx(share, abs=0.01)
    # The distance of two independent normal values is Rayleigh's.
    assert found["track_90"].iloc[-1] == pytest.approx(2.0 * np.sqrt(-2.0 * np.log(0.1)), rel=0.05)
    assert found["x_mean"].to_numpy() == pytest.approx(np.ones(5), abs=0.1)


def test_members_are_drawn_together_and_told(base):
    scenario = load_scenario(base / "base.json")
    made = run_ensemble(scenario, base / "posterior.json", 12, base / "out", workers=0)
    assert len(made) == 12
    assert set(made["status"]) == {"done"}
    assert np.corrcoef(made[NAMES].to_numpy().T)[0, 1] > 0.9, (
        "independent ones are below 0.7 in 99 of 100"
    )
    assert made["W"].nunique() == 12, "each member is another ship"
    assert pandas.read_parquet(base / "out" / "runs.parquet").equals(made)
    found = pandas.read_csv(base / "out" / "bands.csv")
    assert found["time"].iloc[[0, -1]].tolist() == [0.0, 0.5]
    assert found["track_90"].iloc[0] == 0.0, "all begin at the same place"
    assert found["track_90"].iloc[-1] > found["track_50"].iloc[-1] > 0.0
    assert (base / "out" / "bands.png").stat().st_size > 10_000
    again = Posterior.model_validate(content()).draws(12, np.random.default_rng(scenario.seed))
    assert made[NAMES].to_numpy() == pytest.approx(again), "the seed says which"


def test_values_beyond_a_range_are_its_end_and_the_set_gives_the_others(base):
    """A thrust cannot be negative; what the parameter set says holds in every member."""
    (base / "posterior.json").write_text(json.dumps(content(mean=[-2.0, 0.0])))
    (base / "more.ssv").write_text(
        '<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" '
        'version="1.0" name="more"><ssv:Parameters><ssv:Parameter name="vessel.m"><ssv:Real '
        'value="20.0"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>'
    )
    stated = []
    made = run_ensemble(
        load_scenario(base / "base.json"),
        base / "posterior.json",
        4,
        base / "out",
        [base / "more.ssv"],
        workers=0,
        show=stated.append,
    )
    assert (made["thrusters.plant_F_vsp"] >= 0.0).all()
    assert any("plant_F_vsp are clipped to its range" in line for line in stated)
    ran = json.loads((base / "out" / "campaign.json").read_text())["scenario"]
    assert ran["fmus"]["vessel"]["parameters"]["m"] == 20.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"covariance": [[0.04, 0.01], [0.02, 0.01]]}, "are not symmetric"),
        ({"covariance": [[0.04, 0.03], [0.03, 0.01]]}, "not positive semidefinite"),
        ({"covariance": [[-0.04, 0.0], [0.0, 0.01]]}, "variance of 'vessel.delta_X_u' is negative"),
        ({"covariance": [[0.04, 0.0]]}, "not 2 rows of 2 numbers"),
        ({"mean": [1.0]}, "mean has 1 entries for 2 names"),
        ({"mean": [1.0, "much"]}, "mean[1]: Input should be a valid number"),
        ({"names": ["vessel.X_u", "vessel.X_u"]}, "'vessel.X_u' occurs twice"),
        ({"names": ["vessel.X_uu_", NAMES[1]]}, "no parameter 'X_uu_'; did you mean 'X_uu'?"),
        ({"names": ["vesel.X_u", NAMES[1]]}, "no model 'vesel' for 'vesel.X_u' runs here"),
        ({"names": ["vessel.x", NAMES[1]]}, "vessel has no parameter 'x'"),
        ({"units": ["kg", "N"]}, "vessel.delta_X_u is in 'kg', and in 'N.s/m' in the FMU"),
        ({"covariance": None}, "covariance: Input should be a valid array"),
    ],
)
def test_posterior_that_is_none_is_refused_in_one_line(base, changes, message):
    (base / "posterior.json").write_text(json.dumps(content(**changes)))
    options = ("--ensemble", 3, "--posterior", base / "posterior.json", "--out", base / "out")
    done = command(main, base / "base.json", *options)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (base / "out").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--ensemble", 3), "--ensemble N needs --posterior"),
        (("--posterior", "posterior.json"), "--ensemble N needs --posterior"),
        (("--ensemble", 1, "--posterior", "posterior.json"), "from two on"),
        (("--ensemble", 3, "--posterior", "none.json"), "no such posterior"),
        (("--ensemble", 3, "--posterior", "base.json"), "names: is missing"),
        (("--ensemble", 3, "--posterior", "posterior.json", "--realtime"), "does not run in real time"),
    ],
)
def test_options_that_cannot_be_are_refused(base, options, message):
    done = command(main, "base.json", *options, "--out", "out", cwd=base)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (base / "out").exists()


def test_help_has_the_example():
    done = command(main, "--help")
    assert "--parameters model.ssv --ensemble 50 --posterior posterior.json" in done.stdout


def test_numbers_of_seven_digits_are_a_covariance_still():
    """A pair tied fully, as it is read from a file with rounded numbers."""
    covariance = np.round(STD[:, None] * np.ones((2, 2)) * STD, 7).tolist()
    assert Posterior.model_validate(content(covariance=covariance)).correlation[0, 1] > 0.9999


def test_what_was_read_is_what_was_written(base):
    assert read_posterior(base / "posterior.json").model_dump() == content()
