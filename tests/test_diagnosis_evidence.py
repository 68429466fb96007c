"""What is told of a finding, a prediction or a remainder, in closed form: confidence, bands, words, ranges."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from diagnosis.assessment.residual import remainder
from diagnosis.assessment.residual.recurrence import Recurrence
from diagnosis.assessment.residual.remainder import AxisRemainder
from diagnosis.predictors import Model
from diagnosis.predictors.evaluation import Bands
from diagnosis.predictors.uncertainty import NOISE_TOLERANCE
from diagnosis.predictors.windows import WindowErrors, Windows, between_steps
from diagnosis.search.effect_evidence import EffectEvidence, evidence, variation, with_unknown_cause
from diagnosis.search.findings import Finding, Findings
from diagnosis.search.prior import NominalPrior
from diagnosis.verdict import coefficients
from diagnosis.verdict.coefficients import concluded
from diagnosis.verdict.confidence import probability
from fmus.ops import wrap
from fmus.scale import Scale


def drawn(*shape, seed=0):
    return np.random.default_rng(seed).standard_normal(shape)


# Confidence


def test_confidence_is_even_odds_where_a_third_is_left_or_the_size_varies_by_as_much():
    assert probability(EffectEvidence(1.0, 0.0, 0.0, 0.0, 0.0)) == pytest.approx(0.99, abs=1e-4)
    third = 4.6 / 14.0
    for left, varies in ((third, 0.0), (0.0, third), (0.5 * third, 0.5 * third)):
        assert probability(EffectEvidence(0.8, left, varies, 0.0, 0.0)) == pytest.approx(0.4)


def test_what_is_left_counts_beyond_the_noise_and_by_how_far_the_effect_acts_on_an_axis():
    ones, one_block = np.ones((60, 3)), np.zeros(60, int)
    left, std = ones * [0.5, 0.1, 9.0], ones * [0.2, 0.1, 1.0] / NOISE_TOLERANCE
    e = evidence(0.7, 0.2, ones * [2.0, 1.0, 0.0], left, std, one_block)
    weight = np.array([2.0**2 / 0.2**2, 1.0 / 0.1**2])
    assert e.left == pytest.approx(np.sqrt(weight @ [(0.5**2 - 0.2**2) / 2.0**2, 0.0] / weight.sum()))
    assert (e.bagged, e.varies, e.nearest) == (0.7, 0.0, 0.2)
    noise = std**2
    beyond = (left**2 - noise)[0, :2] / [2.0**2, 1.0]
    assert e.remains == pytest.approx(np.sqrt(weight @ beyond / weight.sum()))
    assert e.remains > e.left, "what is within the tolerance of the noise remains, too"
    assert evidence(0.7, 0.2, 0.0 * ones, left, std, one_block).left == 0.0


def test_the_size_of_an_effect_varies_by_its_spread_less_that_of_noise():
    force, blocks = np.full((40, 3), 2.0), np.arange(40) // 10
    size = np.array([0.2, -0.3, 0.5, 0.1])
    weight = 10 * 3 * 2.0**2
    found = variation(force, size[blocks, None] * force, blocks)
    assert found == pytest.approx(np.sqrt(size.var(ddof=1) - 1.0 / weight))
    two = np.where(np.arange(40) < 10, 3, 7)
    h = 1.0 / (1.0 / weight + 1.0 / (3 * weight))
    found = variation(force, np.where(two == 3, 0.4, 0.0)[:, None] * force, two)
    assert found == pytest.approx(np.sqrt((0.4**2 * h - 1.0) / (2.0 * h)))
    assert variation(force, 0.01 * force, two) == 0.0
    assert variation(force * (two == 3)[:, None], force, two) == 0.0, "of one block nothing varies"


@pytest.mark.parametrize("nearest", [1e-4, 0.02, 0.17, 1.0])
def test_beside_a_residual_an_effect_is_as_sure_as_unknown_causes_are_further_than_it(nearest):
    """Unknown causes as dense as known ones: one known within the nearest, so many within what is left."""

    def probability_of(remains, nearest):
        return with_unknown_cause(remains**2, nearest)

    sure = [probability_of(remains, nearest) for remains in np.linspace(0, 1.2, 25)]
    assert sure[0] == 1.0
    assert np.all(np.diff(sure) <= 0.0)
    assert min(sure) == 0.5, "as far as the nearest candidate or further: even odds"
    assert probability_of(np.sqrt(nearest / 9.0), nearest) == pytest.approx(0.9)
    assert probability_of(0.1, 0.0) == 0.5, "it has a twin"


# Bands, and errors of windows


def bands(covariance):
    """Two windows of three steps of 2 s, and samples at 1 s and 4 s of the first, 3 s of the second."""
    windows = SimpleNamespace(since=np.array([1.0, 4.0, 3.0]), sample_window=np.array([0, 0, 1]))
    predicted = np.arange(18.0).reshape(2, 3, 3)
    return Bands(windows, np.array([0.0, 2.0, 4.0]), predicted, covariance)


def test_a_sample_is_inside_a_band_by_the_squared_distance_in_its_covariance():
    rng = np.random.default_rng(0)
    roots = rng.standard_normal((3, 3))
    covariance = roots @ roots.T
    of = bands(np.broadcast_to(covariance, (2, 3, 3, 3)))
    own = covariance[:2, :2]
    limit = -2.0 * np.log(1.0 - 0.9)  # chi-square with two degrees of freedom
    direction = rng.standard_normal((3, 2))
    length = np.sqrt([limit / (d @ np.linalg.solve(own, d)) for d in direction])
    heading = 1.6449 * np.sqrt(covariance[2, 2])  # 95 % quantile: 90 % between both ends
    for factor, within in ((0.99, True), (1.01, False)):
        residuals = np.column_stack([direction * length[:, None], np.full(3, heading)]) * factor
        assert (of.inside(residuals, 0.9) == within).all()


def test_a_prediction_that_diverges_is_in_no_band_and_its_heading_is_any():
    """A drag that makes a ship unstable: one window of a training run diverged, and the report crashed."""
    known = np.diag([1.0, 4.0, 0.01])
    covariance = np.tile(known, (2, 3, 1, 1))
    covariance[0, 1] = 1e40 * np.ones((3, 3))  # singular
    covariance[0, 2] = np.nan
    of = bands(covariance)
    near = np.full((3, 3), 0.01)
    assert of.inside(near, 0.9).tolist()[1] == [False, False]
    assert of.inside(near, 0.9).tolist()[2] == [True, True]
    assert 0.0 < of.coverage(near) < 1.0
    low, high = of.headings(0, 0.9)
    assert (high - low)[:2] == pytest.approx([2.0 * 1.6449 * 0.1, 2.0 * np.pi], rel=1e-4)
    lines = of.ellipses(0, 0.9) - of.predicted[0, :, None, :2]
    assert np.isnan(lines[2]).all()
    scaled = lines[0] / np.sqrt([1.0, 4.0])
    assert np.sum(scaled**2, axis=1) == pytest.approx(-2.0 * np.log(0.1))
    assert np.isfinite(lines[1]).all()


def test_bands_have_the_covariance_of_their_time_and_the_probability_of_their_level():
    V = np.array([[4.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 0.25]])
    size = np.array([[1.0, 2.0, 5.0], [1.0, 3.0, 4.0]])
    b = bands(size[..., None, None] * V)
    assert b.at_samples == pytest.approx(np.array([1.5, 5.0, 3.5])[:, None, None] * V)
    step = np.sqrt(chi2.ppf(0.9, 1) * 0.25 * np.array([1.0, 3.0, 4.0]))
    assert b.headings(1, 0.9) == pytest.approx(b.predicted[1, :, 2] + np.array([[-1.0], [1.0]]) * step)
    ellipses = b.ellipses(1, 0.5)
    assert ellipses[:, 0] == pytest.approx(ellipses[:, -1])
    off = ellipses - b.predicted[1, :, None, :2]
    squares = np.einsum("tpi,ij,tpj->tp", off, np.linalg.inv(V[:2, :2]), off)
    level = chi2.ppf(0.5, 2) * size[1][:, None]
    assert squares == pytest.approx(np.tile(level, squares.shape[1]))
    for share, within in ((0.99, True), (1.01, False)):
        root = np.linalg.cholesky(V[:2, :2]) @ [0.6, -0.8]
        place = share * np.sqrt(chi2.ppf(0.9, 2) * np.array([1.5, 5.0, 3.5]))[:, None] * root
        heading = share * np.sqrt(chi2.ppf(0.9, 1) * 0.25 * np.array([1.5, 5.0, 3.5]))
        residuals = np.column_stack([place, heading])
        assert b.inside(residuals, 0.9).tolist() == [[within] * 2] * 3
        assert b.coverage(residuals) == b.coverage(-residuals) == float(within)
        assert b.coverage(residuals * [1.0, 1.0, 0.0]) == (1.0 if within else 0.5)
        assert b.coverage(residuals, 0.999) == 1.0


def test_errors_of_windows_are_root_mean_squares_by_their_samples():
    w = object.__new__(Windows)
    w.run, w.start, w.sample_window = np.array([0, 0, 1]), np.array([0.0, 8.0, 0.0]), np.array([0, 0, 1, 2, 2])  # fmt: skip
    off = drawn(5, 3)
    e = w.summary(off)
    assert e.samples.tolist() == [2, 1, 2]
    assert e.position[0] == pytest.approx(np.sqrt(np.square(off[:2, :2]).sum() / 2.0))
    assert e.heading == pytest.approx([np.sqrt(np.mean(off[k, 2] ** 2)) for k in ([0, 1], [2], [3, 4])])
    for run, rows in ((None, slice(None)), (0, slice(3)), (1, slice(3, None))):
        position, heading = e.over_all(run)
        assert position == pytest.approx(np.sqrt(np.square(off[rows, :2]).sum(axis=1).mean()))
        assert heading == pytest.approx(np.sqrt(np.mean(off[rows, 2] ** 2)))
    two = w.summary(np.stack([off, 2.0 * off]))
    assert two.position[1] == pytest.approx(2.0 * e.position)
    off[1, 0] = np.nan
    lost = w.summary(off)
    assert np.isinf(lost.position).tolist() == [True, False, False]
    assert lost.heading == pytest.approx(e.heading)
    none = WindowErrors(*np.zeros((3, 0)), np.zeros(0), np.zeros(0)).over_all()
    assert np.isnan(none).all()


def test_poses_between_steps_are_on_a_cubic_and_headings_on_the_short_way():
    t = np.arange(6.0)
    steps = np.zeros((6, 3, 2, 2))
    steps[:, 0] = (t**3 - 2.0 * t)[:, None, None] * [[1.0, 10.0], [2.0, 20.0]]
    steps[:, 2] = wrap(3.0 + 0.2 * t)[:, None, None]
    place = np.array([0.5, 1.25, 4.7, 6.0])
    found = between_steps(steps, np.array([0, 1, 0, 1]), place)
    assert found.shape == (2, 4, 3)
    exact = (place**3 - 2.0 * place) * [1.0, 10.0, 1.0, 10.0]
    assert found[0, :, 0] == pytest.approx(exact), "beyond the last step goes on"
    assert found[1, :, 0] == pytest.approx(2.0 * exact)
    assert wrap(found[0, :, 2] - 3.0 - 0.2 * place) == pytest.approx(0.0, abs=1e-12)
    two = between_steps(steps[:2], np.array([0]), np.array([0.5]))
    assert two[0, 0, 0] == pytest.approx(-0.5), "two steps are on a line"


# The remainder in words

LEFT = AxisRemainder(0.5, 0.1, 0.04, 0.3, 1e-9, 0.2, True, 0.03)
SLIGHT = replace(LEFT, significant=False)
NOTHING = replace(SLIGHT, p_value=0.5)


def repeats(best=None, lasts=10.0, in_part=False):
    shares = dict.fromkeys(("place", "heading", "motion", "command", "time"), 0.0)
    return Recurrence(shares | ({best: 0.6} if best else {}), lasts, in_part)


@pytest.mark.parametrize(
    ("how", "scale", "comes", "cause"),
    [
        (repeats("place"), 1.0, "depends on the position", "a bank"),
        (repeats("place", in_part=True), 1.0, "depends on the position", "a bank"),
        (repeats("heading"), 1.0, "depends on the heading", "error of the compass"),
        (repeats("motion"), 1.0, "speed, drift and yaw rate", "a force on the hull"),
        (
            repeats("motion", in_part=True),
            1.0,
            "proportional to the command",
            "fails and recovers, cavitates",
        ),
        (repeats("command"), 1.0, "on the commands", "differs from the thruster model"),
        (repeats("time"), 1.0, "since the start of a run", "a drift"),
        (
            repeats(in_part=True)._replace(changes=("lap", 71.2)),
            1.0,
            "at about 71 s of lap",
            "other water (learn --split lap@71 gives both parts values of their own)",
        ),
        (repeats(lasts=3.1), 1.0, "lasts for about 3 s", "gusts"),
        (repeats(lasts=2.9), 1.0, "and lasts for 3 s at the most, the width of a window", "waves"),
        (
            repeats(lasts=5.9),
            4.0,
            "and lasts for 6 s at the most",
            "waves",
        ),  # a ship of four times the length, twice the time
        (repeats(lasts=6.1), 4.0, "lasts for about 6 s", "gusts"),
    ],
)
def test_what_a_remainder_repeats_with_suggests_its_cause(how, scale, comes, cause):
    axes = {"X": LEFT, "Y": NOTHING, "N": replace(LEFT, share=1.0, of_command=np.nan)}
    place = SimpleNamespace(axis="N", phrase="in the north")
    text = remainder.remainder_sentence(axes, [how] * 3, [place], False, Scale(scale))
    assert text.startswith("Surge: 0.5 N (uncertainty 0.1, 20 % of the initial model error, 3 % of the commanded force) and Yaw: 0.5 N m (uncertainty 0.1)")  # fmt: skip
    assert "not explained, most in the north. It " in text
    assert "Sway" not in text
    assert comes in text
    assert cause in text
    apart = remainder.remainder_sentence(axes, [how, how, repeats("time")], [], True, Scale(scale))
    assert ("and Yaw" in apart) == (how.best == "time")
    assert ", most" not in apart
    assert apart.endswith("whose timing is not predictable.")


def test_little_and_nothing_are_left():
    axes = dict.fromkeys("XYN", NOTHING)
    said = [remainder.remainder_sentence(a, None, [], False) for a in (axes, axes | {"N": SLIGHT})]
    assert said == [remainder.NOTHING_LEFT, remainder.LITTLE_LEFT]
    assert [a.beyond_chance for a in (NOTHING, SLIGHT, replace(LEFT, p_value=0.01 / 6.0))] == [False, True, False]  # fmt: skip


# Coefficients alone, in place of effects that are not believed

START = Model()
OTHER = START.plus({"delta_X_u": -1.0})


@pytest.mark.parametrize(
    ("changes", "refitted"),
    [
        ({}, True),
        ({"together": 0.5}, False),  # a finding is believed
        ({"left_at_first": False}, False),  # nothing was missing
        ({"left_with": True}, False),
        ({"plausible": False}, False),
        ({"judges": False}, False),
        ({"harms": {"first"}}, False),
        ({"harms": {"found"}}, False),
        ({"effects": False}, True),
        ({"effects": False, "harms": {"first"}}, False),
        ({"refit": False}, False),
    ],
)
def test_coefficients_alone_explain_what_was_missing_and_harm_nothing(monkeypatch, changes, refitted):
    case = {
        "together": 0.49,
        "left_at_first": True,
        "left_with": False,
        "plausible": True,
        "judges": True,
    }
    case |= {"harms": set(), "effects": True, "refit": True} | changes
    alone = Findings(refitted=OTHER, model=START, moved={"X_u": 1.0 if case["plausible"] else 99.0})
    assert alone.plausible == case["plausible"]
    effects = [Finding("X_u", {}, {}, 0.3, [], 0.5, 0.5, together=case["together"])]
    found = replace(alone, effects=effects if case["effects"] else [], refit=(lambda ids: alone) if case["refit"] else None)  # fmt: skip
    names = {id(found): "found", id(START): "first"}
    monkeypatch.setattr(coefficients, "without", lambda f, ids, start: alone)
    left = {START: case["left_at_first"], OTHER: case["left_with"]}
    monkeypatch.setattr(coefficients, "remains", lambda runs, start, model: left[model])
    monkeypatch.setattr(coefficients, "harm", lambda now, each: each in case["harms"])
    data = SimpleNamespace(
        start=START,
        judges=lambda f: case["judges"],
        runs=[],
        losses=lambda now, *others: ["now", *(names[id(o)] for o in others)],
    )
    data.of_other_runs = data
    learned, is_refitted, dropped = concluded(found, data, NominalPrior.of(START))
    assert is_refitted == refitted
    if refitted:
        assert learned.model is OTHER
        assert list(dropped) == list(found.effects)
    elif case["effects"]:
        assert learned is found
        assert not dropped
    else:
        assert learned.model is START
        assert learned.suspects == []
