"""Effects that act like a coefficient beyond its prior are possibilities, however sure the prior is."""

import numpy as np
import pytest
from support.planted import voyages

from diagnosis.predictors import Model
from diagnosis.search.findings import Finding, Findings
from diagnosis.search.prediction_fit.disturbance import ForceDisturbance
from diagnosis.search.prediction_fit.disturbance_summary import Unrecorded
from diagnosis.search.prediction_fit.joint_posterior import JointPosterior
from diagnosis.search.prediction_fit.refit import RefitOutcome
from diagnosis.search.prior import NominalPrior
from diagnosis.verdict.effects_like_coefficients import in_place_of_coefficients

START = Model()
LOST = 0.4  # 1, of the bow thruster


def possible(name, z, of_prior, std=0.01, known=()):
    """What may have the place of a coefficient that is off by z standard deviations of its prior.

    ``of_prior`` and ``std`` are those of the prior and of the fit, relative to its value.
    """
    value = START.value(name)
    prior = NominalPrior({name: value}, {name: of_prior * abs(value)})
    model = START.plus({name: z * of_prior * abs(value)})
    findings = Findings(list(known), model=model, moved={name: z}, sigma=np.array([0.1, 0.1, 0.05]))
    at = np.array([model.value(name)])
    posterior = JointPosterior(
        [f"{START.owner(name)}.{name}"], [""], at, np.array([[(std * value) ** 2]])
    )
    none = Unrecorded(ForceDisturbance(np.zeros(3), np.zeros(3)), {}, [])
    runs = voyages(count=2, seconds=90.0, thrusters={"loss_bow": LOST})
    return in_place_of_coefficients(RefitOutcome(findings, posterior, none), runs, START, prior)


def test_a_thruster_that_is_weaker_than_its_prior_allows_may_have_lost_a_part_of_its_force():
    (f,) = possible("plant_F_bow", -4.0, 0.1)
    assert f.id == "loss_bow"
    assert f.values == {"loss_bow": pytest.approx(LOST, rel=1e-3)}
    low, high = f.ci95["loss_bow"]
    assert high - LOST == pytest.approx(1.96 * np.hypot(0.1, 0.01), rel=0.01), "by prior and fit"
    assert low < LOST < high
    assert 0.0 < f.share <= 1.0
    assert "plant_F_bow" in f.doubt
    assert "4 standard deviations" in f.doubt


def test_the_further_a_coefficient_is_off_the_likelier_is_the_effect_and_never_sure():
    chances = [possible("plant_F_bow", -LOST / s, s)[0].confidence for s in (0.13, 0.1, 0.07, 0.04)]
    assert chances == sorted(chances)
    assert 0.0 < chances[0] < 0.4 < 0.49 < chances[-1] <= 0.5
    assert (
        possible("plant_F_bow", -4.0, 0.1)[0].together
        == possible("plant_F_bow", -4.0, 0.1)[0].confidence
    )


@pytest.mark.parametrize(("z", "why"), [(-2.9, "within its prior"), (-11.0, "more than all is lost")])
def test_no_effect_takes_the_place(z, why):
    assert possible("plant_F_bow", z, 0.1) == [], why


def test_an_effect_in_the_model_has_a_confidence_of_its_own():
    known = Finding("loss_bow", {"loss_bow": 0.1}, {}, 0.9, [], 0.5, 0.5)
    assert possible("plant_F_bow", -4.0, 0.1, known=[known]) == []


def test_a_force_of_another_shape_does_not_act_like_it():
    """A change of linear damping is that coefficient, and no other term of the hull."""
    assert [f.id for f in possible("X_u", -4.0, 0.3)] == ["X_u"]
