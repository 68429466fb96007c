"""The regressions of other methods on small arrays: features, least squares, cross-validation, findings."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.search.candidates import Candidate, CandidateShape

SIGMA = np.array([1.0, 2.0, 0.5])  # of the axes, over that of the first
WINDOWS = 16
RNG = np.random.default_rng(3)
TARGET = RNG.standard_normal((WINDOWS, 3))


@pytest.fixture(scope="module")
def peers():
    pytest.importorskip("sklearn")
    from diagnosis.search import peers

    return peers


def shape(seed, *fitted, given=None, unit=1.0, columns=None):
    """A shape with random columns, and with an offset if a value is given."""
    rng = np.random.default_rng(seed)
    made = rng.standard_normal((WINDOWS, 3, len(fitted))) if columns is None else columns
    offset = rng.standard_normal((WINDOWS, 3)) if given else None
    return CandidateShape(given or {}, list(fitted), offset, made, np.full(len(fitted), unit))


def candidate(name, *shapes):
    return Candidate(SimpleNamespace(id=name), shapes)


def features_of(peers, monkeypatch, every, target=TARGET, blocks=4):
    """Features of some candidates in as many blocks, the model error being given."""
    numbers = np.column_stack([np.zeros(WINDOWS, int), np.arange(WINDOWS) * blocks // WINDOWS])
    monkeypatch.setattr(peers, "candidates", lambda *_: every)
    monkeypatch.setattr(peers, "model_error", lambda *_: target)
    monkeypatch.setattr(peers, "block_numbers", lambda _: numbers)
    runs = [SimpleNamespace(smoothed=SimpleNamespace(noise=np.array(n))) for n in ([1, 2, 3], [3, 2, 1])]
    # The mean noise of both runs is 2 in each axis.
    return peers.features(runs, SimpleNamespace(reference_mass=np.diag([4.0, 8.0, 2.0])))


def two(given=None):
    """A candidate of one coefficient, or of a value as well, and one of two coefficients."""
    return [
        candidate("a", shape(1, "p", given=given)),
        candidate("b", shape(2, "p_1", "p_2")),
    ]


def rows(columns):
    """(3 K, p), columns (K, 3, p) in units of the noise."""
    return (columns / SIGMA[:, None]).reshape(3 * WINDOWS, -1)


def solved(A, y):
    return np.linalg.solve(A.T @ A, A.T @ y)


def test_features_are_columns_over_noise_and_spread(peers, monkeypatch):
    every = two({"d": 0.4})
    f = features_of(peers, monkeypatch, every)
    assert f.sigma == pytest.approx(SIGMA)
    raw = np.column_stack(
        [rows(every[0].shapes[0].offset[:, :, None]), *(rows(c.shapes[0].columns) for c in every)]
    )
    assert f.scale == pytest.approx(raw.std(axis=0))
    assert f.columns == pytest.approx(raw / raw.std(axis=0))
    target = (TARGET / SIGMA).ravel()
    assert f.target_scale == pytest.approx(target.std())
    assert f.target == pytest.approx(target / target.std())
    assert f.owner.tolist() == [0, 0, 1, 1]
    assert list(f.parameters) == ["", "p", "p_1", "p_2"]
    assert f.blocks.tolist() == np.repeat(np.arange(4), 3 * WINDOWS // 4).tolist()


def test_the_shape_that_explains_most_stands_for_a_candidate(peers, monkeypatch):
    like = TARGET[:, :, None] + 0.1 * RNG.standard_normal((WINDOWS, 3, 1))
    # Its sign and its size do not matter.
    shapes = [shape(4, "p"), shape(0, "p", columns=-0.01 * like), shape(5, "p")]
    f = features_of(peers, monkeypatch, [candidate("a", *shapes), *two()[1:]])
    assert f.chosen[0][1] is shapes[1]
    assert f.chosen[1][0].effect.id == "b"


def test_a_column_without_effect_in_its_unit_is_left_out(peers, monkeypatch):
    nothing = np.zeros((WINDOWS, 3, 1))
    rounding = shape(7, "r", unit=1e-16)
    every = [candidate("z", shape(0, "z", columns=nothing)), candidate("r", rounding), *two()]
    f = features_of(peers, monkeypatch, every)
    assert list(f.parameters) == ["p", "p_1", "p_2"]
    assert f.owner.tolist() == [2, 3, 3]


def test_parameters_are_those_of_least_squares_in_si(peers, monkeypatch):
    every = two({"d": 0.4})
    f = features_of(peers, monkeypatch, every)
    target = (TARGET / SIGMA).ravel()
    first, second = every[0].shapes[0], every[1].shapes[0]
    everything = np.ones(4, bool)
    own = solved(rows(first.columns), target - (first.offset / SIGMA).ravel())
    assert peers.parameters(f, [0], everything) == {0: pytest.approx({"d": 0.4, "p": own[0]})}
    both = np.column_stack([rows(first.columns), rows(second.columns)])
    p, p_1, p_2 = solved(both, target - (first.offset / SIGMA).ravel())
    assert peers.parameters(f, [0, 1], everything) == {
        0: pytest.approx({"d": 0.4, "p": p}),
        1: pytest.approx({"p_1": p_1, "p_2": p_2}),
    }
    alone = solved(rows(second.columns)[:, 1:], target)  # one that is not used stays as it was
    used = np.array([True, True, False, True])
    assert peers.parameters(f, [1], used) == {1: pytest.approx({"p_2": alone[0]})}


def test_q2_is_the_share_explained_of_rows_held_out(peers, monkeypatch):
    every = two({"d": 0.4})
    truth = every[0].shapes[0].offset + 3.0 * every[0].shapes[0].columns[:, :, 0]
    f = features_of(peers, monkeypatch, every, truth + 0.5 * TARGET)
    target = ((truth + 0.5 * TARGET) / SIGMA).ravel()
    for effects, columns, y in (
        ([0], [every[0].shapes[0].columns], target - (every[0].shapes[0].offset / SIGMA).ravel()),
        ([1], [every[1].shapes[0].columns], target),
    ):
        A, left = np.column_stack([rows(c) for c in columns]), 0.0
        for block in range(4):
            out = f.blocks == block
            left += np.sum((y[out] - A[out] @ solved(A[~out], y[~out])) ** 2)
        wanted = 1.0 - left / np.sum(target**2)
        assert peers.q2(f, effects, np.ones(4, bool)) == pytest.approx(wanted)


@pytest.mark.parametrize(("blocks", "count"), [(4, 4), (16, 8)])
def test_folds_hold_out_whole_blocks_at_most_eight(peers, monkeypatch, blocks, count):
    f = features_of(peers, monkeypatch, two(), blocks=blocks)
    parts = peers.folds(f)
    assert len(parts) == count
    assert sorted(np.concatenate([held for _, held in parts])) == [*range(3 * WINDOWS)]
    for fitted, held in parts:
        assert not {*f.blocks[fitted]} & {*f.blocks[held]}
        assert fitted.size + held.size == 3 * WINDOWS


def ridge_of(peers, settings, first=True):
    """A peer that shrinks its coefficients by its setting."""

    class Ridge(peers.Peer):
        name = "ridge"
        only_first = first

        def coefficients(self, A, y, setting):
            found = np.linalg.solve(A.T @ A + setting * np.eye(A.shape[1]), A.T @ y)
            return np.where(np.abs(found) > 0.02, found, 0.0)

    Ridge.settings = settings
    return Ridge()


@pytest.mark.parametrize("noise", [0.0, 30.0])
def test_the_setting_is_the_one_that_predicts_rows_held_out(peers, monkeypatch, noise):
    every = two()
    drawn = np.random.default_rng(12).standard_normal((WINDOWS, 3))
    target = every[0].shapes[0].columns[:, :, 0] + noise * drawn
    f = features_of(peers, monkeypatch, every, target)
    settings = (0.0, 10.0, 1e3)
    method = ridge_of(peers, settings)
    losses = np.zeros(3)
    for block in range(4):
        out = f.blocks == block
        for k, s in enumerate(settings):
            x = method.coefficients(f.columns[~out], f.target[~out], s)
            losses[k] += np.sum((f.target[out] - f.columns[out] @ x) ** 2)
    best = settings[int(np.argmin(losses))]
    assert (best == 0.0) == (noise == 0.0), "both cases are tested"
    wanted = method.coefficients(f.columns, f.target, best)
    assert method._cross_validated(f) == pytest.approx(wanted)


class Stub:
    """A model that is only asked for additions."""

    def __init__(self, added=()):
        self.added = added

    def plus(self, values):
        return Stub((*self.added, values))


@pytest.mark.parametrize("first", [True, False])
def test_findings_are_in_the_order_of_their_largest_coefficient(peers, monkeypatch, first):
    every = [candidate("c", shape(9, "q")), *two()]
    target = 0.5 * every[1].shapes[0].columns[:, :, 0] + every[2].shapes[0].columns[:, :, 1]
    f = features_of(peers, monkeypatch, every, target)
    monkeypatch.setattr(peers, "features", lambda *_: f)
    found = ridge_of(peers, (0.0,), first).fit([], Stub(), None, lambda _: None, 0)
    assert [r.id for r in found.ranking] == ["b", "a", "c"]
    beta = np.abs(solved(f.columns, f.target))
    assert [r.score for r in found.ranking] == pytest.approx([-beta[3], -beta[1], 0.0], abs=1e-9)
    everything = np.ones(4, bool)
    assert [r.q2 for r in found.ranking] == [peers.q2(f, [k], everything) for k in (2, 1, 0)]
    assert [e.id for e in found.effects] == (["b"] if first else ["b", "a"])
    if first:
        assert found.effects[0].values.keys() == {"p_1", "p_2"}
        assert found.model.added == (found.effects[0].values,)
        return
    # What has no coefficient is not fitted again.
    b, a = found.effects
    assert (b.values, a.values) == (pytest.approx({"p_2": 1.0}), pytest.approx({"p": 0.5}))
    assert found.model.added == (b.values, a.values)
    assert b.model.added == (b.values,)
    alone = peers.q2(f, [2], beta > 0.02)
    assert (b.q2, b.share) == (pytest.approx(alone), pytest.approx(alone))
    assert (a.q2, a.share) == (pytest.approx(1.0), pytest.approx(1.0 - alone))


def test_partial_least_squares_of_one_and_of_all_latent_variables(peers):
    A, y = RNG.standard_normal((30, 3)), RNG.standard_normal(30)
    A, y = A - A.mean(axis=0), y - y.mean()
    method = peers.PartialLeastSquares()
    assert method.coefficients(A, y, 3) == pytest.approx(solved(A, y))
    w = A.T @ y
    t = A @ w
    assert method.coefficients(A, y, 1) == pytest.approx(w * (t @ y) / (t @ t))


def test_sparse_regression_gives_its_optimizer_the_same_least_squares_in_fewer_rows(peers):
    A, y = RNG.standard_normal((30, 3)), RNG.standard_normal(30)
    asked = []

    class Optimizer:
        def __init__(self, threshold):
            self.threshold = threshold

        def fit(self, r, z):
            asked.append((self.threshold, r.shape))
            return SimpleNamespace(coef_=solved(r, z).T)

    method = object.__new__(peers.SparseRegression)
    method.optimizer = Optimizer
    assert method.coefficients(A, y, 0.3) == pytest.approx(solved(A, y))
    assert asked == [(0.3, (3, 3))]
