"""What the search for effects gained over calibration alone: paired errors, both ways."""

import itertools
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from support.measured import sail, smoothed

from benchmarks.ship_effects import causes
from benchmarks.ship_effects import sail as sail_of
from diagnosis import Finding, Findings, Model, load, weak_windows
from diagnosis.predictors import ship_with
from diagnosis.predictors.weak_form import SMALL
from diagnosis.search.candidates import model_error
from diagnosis.search.prior import NominalPrior
from diagnosis.search.significance import Losses, predicts_worse
from diagnosis.verdict import coefficients
from diagnosis.verdict import prediction_gain as gain_module
from diagnosis.verdict.coefficients import any_sure, better_calibration, needless, sufficient
from diagnosis.verdict.confidence import Doubts
from diagnosis.verdict.judging import with_confidence
from diagnosis.verdict.prediction_gain import (
    PairedChange,
    PredictionGain,
    _spanned,
    columns_of,
    gain_of_search,
    prediction_gain,
    without_gain,
)

START, BETTER = Model(), Model().plus({"delta_X_u": -1.0})
WINDOWS = 40


class Data:
    """Data that decide, with errors by model: mean squares of ``sizes``, paired noise on top."""

    def __init__(self, sizes, known=True, validate=(), windows=WINDOWS, omega=None):
        self.omega = omega or {}  # model error, 1 of all others
        self.sizes, self.known, self.validate, self.where = sizes, known, validate, "validation runs"
        self.windows, self.start = windows, START

    def judges(self, found):
        return self.known

    def losses(self, *models):
        common = np.random.default_rng(0).exponential(1.0, self.windows)
        own = np.random.default_rng(1)
        return [
            Losses(
                np.full(4, self.omega.get(id(m), 1.0)),
                *(self.sizes[id(m)] * common + 0.05 * own.uniform(size=self.windows) for _ in "ph"),
            )
            for m in models
        ]


def found(effects):
    """The end of a search."""
    each = [Finding("X_u", {"delta_X_u": -1.0}, {}, 0.9, [], 1.0, 1.0, BETTER)] * effects
    return Findings(each, model=BETTER)


@pytest.mark.parametrize(
    ("start", "calibrated", "learned", "effects", "gained", "over"),
    [
        (9.0, 4.0, 1.0, 1, True, "calibrated"),
        (9.0, 4.0, 4.0, 1, False, "calibrated"),
        (9.0, 1.0, 4.0, 1, False, "calibrated"),
        (4.0, 9.0, 4.0, 0, False, "initial"),  # calibration that harms is not used
        (4.0, 9.0, 1.0, 1, True, "initial"),
        (9.0, 4.0, 1.0, 0, False, "calibrated"),  # without an effect the search gained nothing
    ],
)
def test_the_search_gains_what_calibration_does_not(start, calibrated, learned, effects, gained, over):
    calibration, end = Findings(model=BETTER), found(effects)
    model = end.model if effects else START
    sizes = {id(START): start, id(calibration): calibrated, id(end): learned, id(model): learned}
    gain = gain_of_search(Data(sizes | {id(START): start}), calibration, end, model)
    assert (gain.gained, gain.over, gain.windows) == (gained, over, WINDOWS)
    for change in (gain.position, gain.heading):
        assert change.difference == pytest.approx(change.before**2 - change.after**2)
        assert change.standard_error > 0.0 or start == learned


@pytest.mark.parametrize(
    ("start", "calibrated", "learned", "taken"),
    [
        (9.0, 1.0, 9.0, True),
        (9.0, 1.0, 4.0, True),
        (9.0, 4.0, 4.0, False),
        (9.0, 4.0, 1.0, False),
        (1.0, 4.0, 9.0, False),  # the initial model is better
    ],
)
def test_without_a_finding_the_coefficients_stay_calibrated_where_that_predicts_better(
    start, calibrated, learned, taken
):
    fit, end = SimpleNamespace(findings=Findings(model=BETTER)), found(0)
    sizes = {id(START): start, id(fit.findings): calibrated, id(end): learned}
    data = Data(sizes, omega={id(fit.findings): 2.0})  # predictions decide: it is fitted to these
    assert better_calibration(fit, end, data, lambda *_: False) is (fit if taken else None)
    assert better_calibration(fit, end, data, lambda a, b: (a, b) == (BETTER, START)) is None
    assert better_calibration(None, end, data, lambda *_: False) is None


@pytest.mark.parametrize(
    ("interval", "unshown", "taken"),
    [((-2.0, 0.5), {"X_u"}, True), ((-2.0, -0.5), {"X_u"}, False), ((-2.0, 0.5), set(), False)],
)
def test_an_effect_that_may_be_none_and_is_not_shown_gives_way_to_coefficients(interval, unshown, taken):
    fit, end = SimpleNamespace(findings=Findings(model=BETTER)), found(1)
    end = replace(end, effects=[replace(f, ci95={"delta_X_u": interval}) for f in end.effects])
    data = Data({id(START): 9.0, id(fit.findings): 4.0, id(end): 4.0})
    given = better_calibration(fit, end, data, lambda *_: False, unshown)
    assert given is (fit if taken else None)
    assert needless(end, unshown) is taken
    assert not needless(found(0), unshown)
    assert not needless(START, unshown)


@pytest.mark.parametrize("learned", [4.0, 3.9, 9.0])
def test_effects_none_of_which_is_a_finding_give_way_where_they_gain_nothing(learned, monkeypatch):
    """The simpler model stays, even where its errors are a little larger, as chance alone makes them."""
    monkeypatch.setattr(coefficients, "sufficient", lambda *_: False)
    fit, end = SimpleNamespace(findings=Findings(model=BETTER)), found(1)
    data = Data({id(START): 9.0, id(fit.findings): 4.0, id(end): learned})
    for believed, gained in itertools.product((True, False), repeat=2):
        given = better_calibration(fit, end, data, lambda *_: False, believed=believed, gained=gained)
        taken = learned > 4.0 or not (believed or gained)
        assert given is (fit if taken else None)


@pytest.mark.parametrize(("other", "taken"), [(1.5, True), (2.5, False)])
def test_coefficients_that_predict_worse_than_the_initial_model_by_chance_are_not_taken(other, taken):
    """Where runs contradict each other a fit to one of them is worse in the other one."""
    fit, end = SimpleNamespace(findings=Findings(model=BETTER)), found(1)
    same, apart = np.ones(40), np.repeat([0.1, other], 20)
    losses = {id(fit.findings): Losses(same, apart, apart)}
    data = SimpleNamespace(
        start=START,
        validate=(),
        judges=lambda _: True,
        losses=lambda *models: [losses.get(id(m), Losses(same, same, same)) for m in models],
    )
    assert not predicts_worse(*data.losses(fit.findings, START))
    given = better_calibration(fit, end, data, lambda *_: False, believed=False, gained=False)
    assert given is (fit if taken else None)


@pytest.mark.parametrize(("learned", "taken"), [(4.0, True), (1.0, False)])
def test_findings_that_gain_nothing_give_way_to_coefficients_that_suffice(learned, taken, monkeypatch):
    """Within their priors, and with nothing left, other coefficients are no missing effect."""
    fit, end = SimpleNamespace(findings=Findings(model=BETTER)), found(1)
    data = Data({id(START): 9.0, id(fit.findings): 4.0, id(end): learned})
    for suffices, gained in itertools.product((True, False), repeat=2):
        monkeypatch.setattr(coefficients, "sufficient", lambda *_, is_so=suffices: is_so)
        given = better_calibration(fit, end, data, lambda *_: False, gained=gained)
        assert given is (fit if taken and suffices and not gained else None)


@pytest.mark.parametrize(
    ("effect", "z", "left", "suffices"),
    [
        ("X_u", 2.9, False, True),
        ("X_u", 3.1, False, False),
        ("X_u", 2.9, True, False),
        ("bow_failure", 2.9, False, False),
        ("waves", 2.9, False, False),
    ],
)
def test_coefficients_suffice_within_their_priors_where_nothing_is_left(
    effect, z, left, suffices, monkeypatch
):
    monkeypatch.setattr(coefficients, "remains", lambda *_: left)
    its = Findings(model=BETTER, moved={"X_u": z})
    end = Findings([Finding(effect, {}, {}, 0.5, [], 1.0, 1.0)], model=BETTER)
    assert sufficient(its, end, SimpleNamespace(start=START, runs=[], validate=())) is suffices


def test_the_standard_error_is_paired_and_covers_the_difference():
    """Over repeated noise the difference scatters by as much as its standard error says."""
    rng, sizes, found = np.random.default_rng(2), {id(START): 1.0, id(BETTER): 1.0}, []
    for _ in range(300):
        data = Data(sizes)
        common = 100.0 * rng.exponential(1.0, WINDOWS)
        data.losses = lambda *models, common=common: [
            Losses(np.ones(4), *(common + rng.normal(0.0, 1.0, WINDOWS) for _ in "ph")) for _ in models
        ]
        gain = prediction_gain(data, START, BETTER)
        found.append((gain.position.difference, gain.position.standard_error, gain.gained))
    difference, error, gained = np.array(found).T
    assert np.std(difference) == pytest.approx(np.mean(error), rel=0.15)
    assert np.mean(gained) < 0.1


@pytest.mark.parametrize(("better", "gained"), [(9, True), (4, False)])
def test_predictions_that_are_better_in_most_windows_are_better(better, gained):
    """One window with nearly all of the error makes the standard error as large as the mean."""
    before = np.append(1.0, np.full(9, 0.01))
    after = np.where(np.arange(10) <= better, 0.1, 1.1) * before
    data = Data({})
    data.losses = lambda *_: [Losses(np.ones(4), x, x) for x in (after, before)]
    gain = prediction_gain(data, START, BETTER)
    assert gain.position.difference < 2.0 * gain.position.standard_error
    assert gain.gained == gained


def test_it_is_not_known_without_folds_or_windows():
    sizes = {id(START): 1.0, id(BETTER): 1.0}
    nothing = Findings()
    assert prediction_gain(Data(sizes | {id(nothing): 1.0}, known=False), START, nothing) is None
    assert prediction_gain(Data(sizes, windows=0), START, BETTER) is None


def test_a_model_that_runs_away_gains_nothing():
    data = Data({})
    finite = Losses(np.ones(4), np.ones(9), np.ones(9))
    away = Losses(np.ones(4), np.append(np.ones(8), np.inf), np.ones(9))
    data.losses = lambda *_: [away, finite]
    gain = prediction_gain(data, START, BETTER)
    assert not gain.gained
    assert gain.position.difference == 0.0


@cache
def run():
    return [weak_windows(smoothed(sail(64.0, 0.1)[0]))]


UNSHOWN = {"marker_offset", "N_uv", "clock_offset", "lag"}  # no coefficient of this ship


@pytest.mark.parametrize(
    ("over", "gained", "unshown"),
    [
        ("calibrated", False, UNSHOWN),
        ("calibrated", True, set()),
        ("initial", False, UNSHOWN | {"X_u", "added_mass_Y", "mass", "loss_bow"}),
        ("initial", True, set()),
    ],
)
def test_what_calibration_predicts_as_well_is_not_shown_but_for_changes_of_coefficients(
    over, gained, unshown
):
    values = {
        "marker_offset": {"marker_offset_dx": 0.05, "marker_offset_dy": 0.0},
        "N_uv": {"delta_N_uv": -3.0},
        "clock_offset": {"clock_offset": 0.2},
        "X_u": {"delta_X_u": -2.0},
        "added_mass_Y": {"added_mass_Y": 3.0},
        "mass": {"mass": 1.0},
        "loss_bow": {"loss_bow": 0.2},
        "lag": {"lag": 0.5},
        "waves": {"wave_peak": 3.0},
    }
    start = Model()
    each = [Finding(i, v, {}, 0.9, [], 1.0, 1.0, start) for i, v in values.items()]
    findings = Findings(each, model=start, sigma=np.array([1e-3, 1e-3, 1e-3]))
    change = PairedChange(1.0, 1.0, 0.0, 1.0)
    gain = PredictionGain("validation runs", 9, change, change, gained, over)
    prior = NominalPrior.of(start)
    assert without_gain(gain, findings, start, run(), prior) == unshown
    assert not without_gain(None, findings, start, run(), prior)


@pytest.mark.parametrize(
    ("effect", "is_coefficient"),
    [("rate_azimuth", True), ("lag_azimuth", True), ("play_azimuth", False)],
)
def test_a_further_lag_or_rate_limit_of_an_actuator_is_one_of_its_coefficients(
    effect, is_coefficient, monkeypatch
):
    """R/V Gunnerus states both of her azimuths, and no play: calibration knows nothing like that."""
    monkeypatch.setattr(gain_module, "model_error", lambda *_: np.zeros((1, 3)))
    monkeypatch.setattr(gain_module, "columns_of", lambda *a: np.zeros((3, len(a[3]))))
    start = Model(ship=ship_with([], "gunnerus"))
    found = Findings([Finding(effect, {effect: 0.1}, {}, 0.9, [], 1.0, 1.0, start)], model=start)
    change = PairedChange(1.0, 1.0, 0.0, 1.0)
    gain = PredictionGain("validation runs", 9, change, change, False, "calibrated")
    unshown = without_gain(gain, found, start, [], NominalPrior.of(start), plausible=True)
    assert unshown == (set() if is_coefficient else {effect})


BOAT = """
name = "boat"
title = "a boat"
source = "made"
length = 2.0
beam = 0.8
thrust_allocation = false
[inertia]
m = { value = 50, rel_std = 0.03 }
I_z = { value = 12, rel_std = 0.2 }
X_udot = { value = -4, rel_std = 0.5 }
Y_vdot = { value = -30, rel_std = 0.3 }
N_rdot = { value = -8, rel_std = 0.3 }
[hull]
terms = [
    { axis = "X", product = "|u|u", value = -15, rel_std = 0.2 },
    { axis = "Y", product = "|u|v", value = -90, rel_std = 0.3 },
    { axis = "N", product = "|u|r", value = -30, rel_std = 0.3 },
    { axis = "N", product = "uv", value = 20, rel_std = 0.3 },
]
[[actuators]]
name = "pod"
law = "azimuth"
x = { value = -1.0, rel_std = 0.0 }
y = { value = 0.0, rel_std = 0.0 }
k_ahead = { value = 0.1, rel_std = 0.1 }
k_astern = { value = 0.1, rel_std = 0.1 }
n_max = 20.0
n_min = -20.0
alpha_max = 0.6
"""


def test_what_only_all_coefficients_together_make_up_is_no_change_of_coefficients(tmp_path):
    """Of surge and sway each equation may have a factor, and with it m - X_udot in both another value."""
    path = tmp_path / "boat.toml"
    path.write_text(BOAT)
    boat = ship_with((), str(path))
    start = Model(ship=boat)
    runs = load(
        sail_of(boat, causes(boat)["none"], np.random.default_rng(1), None, seconds=120.0), ship=path
    )
    values = {"Y_ur": {"delta_Y_ur": 20.0}, "added_mass_Y": {"added_mass_Y": 9.0}}
    each = [Finding(i, v, {}, 0.9, [], 1.0, 1.0, start) for i, v in values.items()]
    findings = Findings(each, model=start, sigma=np.ones(3))
    change = PairedChange(1.0, 1.0, 0.0, 1.0)
    gain = PredictionGain("validation runs", 9, change, change, False, "calibrated")
    prior = NominalPrior.of(start)
    names = [*prior.std]
    columns = [
        columns_of(runs, start, model_error(runs, start), x, np.ones(3)) for x in (["delta_Y_ur"], names)
    ]
    assert _spanned(*columns)
    assert without_gain(gain, findings, start, runs, prior) == {"Y_ur"}
    # Y_vdot is -30 kg, known to 9 kg: beyond three of these it is no other value of the coefficient.
    for more, plausible, beyond in ((24.0, True, False), (32.0, True, True), (32.0, False, False)):
        each[1] = replace(each[1], values={"added_mass_Y": more})
        unshown = without_gain(gain, replace(findings, effects=each), start, runs, prior, plausible)
        assert ("added_mass_Y" in unshown, more) == (beyond, more)
    for unshown, sure in ((set(), True), ({"Y_ur"}, False)):
        doubts = Doubts(without_gain=unshown)
        assert any_sure(with_confidence(Findings(each[:1], model=start), start, doubts)) == sure


@pytest.mark.parametrize("off", [0.0, 0.9, 1.1, 30.0])
def test_columns_are_made_up_of_others_to_the_error_of_a_small_step(off):
    """Each one of them, whatever its size; a column of zeros changes nothing and is not."""
    rng = np.random.default_rng(3)
    base = np.linalg.qr(rng.normal(size=(50, 5)))[0]
    others, beyond = base[:, :3] @ rng.normal(size=(3, 3)), base[:, 3]
    within = (others @ rng.normal(size=(3, 2))) * [1.0, 1e6]
    error = off * SMALL * beyond[:, None] * np.linalg.norm(within, axis=0)
    assert _spanned(within + error * [0.0, 1.0], others) == (off < 1.0)
    assert _spanned(within + error * [1.0, 0.0], others) == (off < 1.0)
    assert not _spanned(within * [1.0, 0.0], others)
