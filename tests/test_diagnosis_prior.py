"""How well the nominal coefficients are known: by where their values come from, or as the user says."""

import numpy as np
import pytest
from support.command import command
from support.cse1 import THRUSTERS
from support.project import ROOT

import diagnosis
from cosim import InputError
from diagnosis import Model, learn
from diagnosis.search.findings import Findings
from diagnosis.search.prior import MEASURED, NominalPrior, shares
from diagnosis.search.refinement import RefinedModel
from fmus.declare import variables
from fmus.hull import Damping, Inertia
from fmus.ship import ship
from fmus.ships.ship_file import read_ship

KNOWN = ship().coefficients
OTTER = Model(ship=ship(description=read_ship("otter")))


def std(**given):
    """Relative standard deviation of each coefficient that is not zero."""
    prior = NominalPrior.of(Model(), **given)
    return {n: prior.std[n] / abs(mean) for n, mean in prior.mean.items()}


def test_each_nominal_coefficient_says_where_it_comes_from():
    plant = [v.name for v in variables(type(THRUSTERS.params().plant)) if v.start]  # zero stays zero
    names = [v.name for group in (Inertia, Damping) for v in variables(group)]
    assert sorted(KNOWN) == sorted([*names, *plant])
    assert all(k.origin and k.group and 0.0 < k.share <= 1.0 for k in KNOWN.values())


def test_a_zero_of_stated_origin_is_a_coefficient_of_a_model_that_has_it():
    of_file, other = (NominalPrior.of(Model(vessel=v)) for v in ({}, {"Y_uv": -3.0, "Y_rdot": -0.1}))
    assert other.std == of_file.std | {"Y_uv": 3.0, "Y_rdot": 0.05}
    assert "Y_rdot" not in OTTER.ship.coefficients, "a plain zero is nobody's"


def raft(folder, inertia="", actuator=""):
    """A model of a raft of one propeller, with further lines of its file."""
    path = folder / "raft.toml"
    path.write_text(
        f"""name = "raft"\ntitle = "the raft"\nlength = 2.0\nbeam = 1.0
[inertia]\nm = 50.0\nI_z = 20.0\n{inertia}
[[actuators]]\nname = "stern"\nlaw = "fixed_propeller"\n{actuator}
"""
    )
    return Model(ship=ship(description=read_ship(path)))


def test_a_zero_with_a_standard_deviation_is_as_uncertain_as_that_and_a_plain_one_stays(tmp_path):
    at_sea = raft(tmp_path, "x_g = { value = 0.0, std = 0.05 }", "y = { value = 0, std = 0.02 }")
    for most in (np.inf, MEASURED):
        prior = NominalPrior.of(at_sea, most=most)
        assert [prior.mean["x_g"], prior.std["x_g"]] == [0.0, 0.05]
        assert [prior.mean["plant_stern_y"], prior.std["plant_stern_y"]] == [0.0, 0.02]
    moved = RefinedModel(at_sea, 2.0 * np.array([n == "x_g" for n in prior.mean])).model(prior)
    assert moved.value("x_g") == 0.1
    assert moved.value("plant_stern_y") == 0.0
    assert "x_g" not in NominalPrior.of(at_sea, 0.1).mean, "a relative one of a zero is none"
    assert (
        not {"x_g", "plant_stern_y"}
        & NominalPrior.of(raft(tmp_path, "x_g = 0.0", "y = 0.0")).mean.keys()
    )


def test_a_standard_deviation_holds_for_the_value_of_another_model_and_a_share_goes_with_it(tmp_path):
    model = raft(tmp_path, "x_g = { value = 0.2, std = 0.05 }\nX_udot = { value = -5.0, rel_std = 0.1 }")
    prior = NominalPrior.of(model.plus({"x_g": 0.2, "X_udot": -5.0}))
    assert [prior.std["x_g"], prior.std["X_udot"]] == [0.05, 1.0]
    assert NominalPrior.of(model, most=MEASURED).std["x_g"] == pytest.approx(0.02)


def test_what_was_weighed_is_known_better_than_what_was_borrowed():
    found = std()
    assert found["m"] < found["X_u"] < found["N_r"]
    assert found["m"] == 0.01
    assert found["plant_F_vsp"] == 0.5


def test_the_search_believes_in_each_to_a_tenth():
    found = std(most=MEASURED)
    assert found["m"] == 0.01, "what is known better stays so"
    assert found["N_r"] == found["plant_F_vsp"] == MEASURED


def test_a_lag_of_a_ships_file_is_as_uncertain_as_it_says_and_never_negative():
    prior = NominalPrior.of(OTTER)
    assert [prior.mean["lag_port"], prior.std["lag_port"]] == [1.0, 0.5]
    assert "lag" not in prior.mean, "no number of the file, but what may be missing"
    at = RefinedModel.at(OTTER, prior)
    for off, lag in ((-1.0, 0.5), (-4.0, 0.0)):
        moved = at.plus({}, off * np.array([n == "lag_port" for n in prior.mean]))
        assert moved.model(prior).value("lag_port") == pytest.approx(lag)


@pytest.mark.parametrize(("share", "plausible"), [(0.2, True), (0.1, False)])
def test_coefficients_are_held_to_where_they_come_from_not_to_the_search(share, plausible):
    searched, own = (NominalPrior.of(Model(), {"X_u": s}) for s in (MEASURED, share))
    offset = 4.0 * np.array([n == "X_u" for n in searched.mean])
    found = Findings(
        moved={"X_u": 4.0},
        estimate=RefinedModel(Model(), offset),
        searched=searched,
    )
    assert not found.plausible
    assert found.plausible_by(own) is plausible


def test_a_prior_of_some_beats_the_ships_and_a_single_one_its_group():
    found = std(prior={"damping": 0.2, "X_u": 0.4, "thrust": 0.0}, most=MEASURED)
    assert found["N_r"] == 0.2
    assert found["X_u"] == 0.4
    assert found["plant_F_vsp"] == found["plant_F_bow"] == 0.0
    assert found["m"] == 0.01


def test_a_common_prior_leaves_what_was_measured_at_a_tenth():
    found = std(prior=1.0)
    assert found["N_r"] == 1.0
    assert found["m"] == MEASURED
    assert set(std(prior=0.0).values()) == {0.0}


@pytest.mark.parametrize(
    ("prior", "said"),
    [
        ({"trust": 0.5}, "did you mean 'thrust'"),
        ({"X_uu_": 0.5}, "did you mean 'X_uu'"),
        ({"mass": -0.5}, "zero or more"),
        ({"mass": float("nan")}, "zero or more"),
        (-0.1, "zero or more"),
    ],
)
def test_a_prior_of_what_is_none_is_refused(prior, said):
    with pytest.raises(InputError, match=said):
        shares(ship(), prior)
    with pytest.raises(InputError, match=said):
        diagnosis.diagnose([], prior=prior)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("trust=0.5", "did you mean 'thrust'"),
        ("mass=heavy", "needs a number"),
        ("mass=0.1,", "needs a number"),
        ("mass=-1", "needs a number"),
    ],
)
def test_the_command_refuses_it_before_it_reads_a_run(text, said, tmp_path):
    done = command(learn.main, tmp_path / "none.csv", "--prior", text, "--out", tmp_path / "out")
    assert done.returncode == 2
    assert said in done.stderr
    assert not (tmp_path / "out").exists()


def test_docs_tell_the_origin_of_each_group():
    text = (ROOT / "docs" / "method.md").read_text(encoding="utf-8")
    for known in set(KNOWN.values()):
        assert f"| `{known.group}` | {known.origin} | {100.0 * known.share:g} %" in text
