"""A constrained fit of the model error is stable by construction, and as near as that allows."""

import numpy as np
import pytest

from benchmarks.stable_fits import COLUMNS, data_set
from cosim import InputError
from diagnosis.assessment import (
    OPERATING,
    dissipation,
    least_dissipation,
    mass,
    sampled_motions,
)
from diagnosis.predictors import Model
from thesis.analysis import as_model, effective_thrust, nearest_stable
from thesis.analysis.constrained_fit import MARGIN, dissipation_conditions, thrust_cuts
from thesis.analysis.into_the_plant import EPSILON, force_columns

OTHERS = [c for c in COLUMNS if not c.startswith("tau")]


def is_stable(c, B, columns):
    braked = least_dissipation(as_model(c, B, columns)) >= least_dissipation(Model()) - 1e-9
    return braked and effective_thrust(force_columns(B, columns)).least >= EPSILON - 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_every_fit_is_stable_though_the_plain_one_is_not(seed):
    X, omega = data_set(seed)
    found = nearest_stable(X, omega, COLUMNS)
    assert is_stable(found.c, found.B, COLUMNS)
    assert (found.r2 <= found.given_r2 + 1e-9).all()


def test_data_of_a_stable_ship_are_fitted_as_by_least_squares():
    """The nominal hull itself, with thrusters that lose a tenth: inside of all conditions but one."""
    X, _ = data_set(3)
    B = np.zeros((3, len(COLUMNS)))
    hull = {"r": (-7.25, -1.9), "|r|v": (-0.805, 0.13), "|v|r": (-0.845, 0.08), "|r|r": (-3.45, -0.75)}
    for name, (Y, N) in hull.items():
        B[1:, COLUMNS.index(name)] = Y, N
    for k, name in enumerate(("u", "v", "r")):
        B[k, COLUMNS.index(name)] -= 1.0  # braked a little more than that hull
        B[k, COLUMNS.index(f"tau_{'XYN'[k]}")] = -0.1
    noise = np.random.default_rng(0).normal(scale=1e-3, size=(len(X), 3))
    found = nearest_stable(X, X @ B.T + noise, COLUMNS, B)
    assert not found.changed
    assert pytest.approx(B, abs=0.05) == found.B


def test_result_is_nearest_among_stable_models():
    """Of all mixtures with models that are stable, none predicts more like the plain fit."""
    X, omega = data_set(1)
    found = nearest_stable(X, omega, COLUMNS)
    Z, Y = X - X.mean(axis=0), omega - omega.mean(axis=0)
    weights = 1.0 / np.sum(Y**2, axis=0)

    def cost(B):
        return float(np.sum((Y - Z @ B.T) ** 2, axis=0) @ weights)

    rng = np.random.default_rng(0)
    for k in range(3):
        other = nearest_stable(X, rng.normal(size=omega.shape) if k else 0.5 * omega, COLUMNS)
        mixed = found.B + 0.1 * (other.B - found.B)
        assert is_stable(found.c, mixed, COLUMNS)  # both conditions are convex
        assert cost(mixed) >= cost(found.B) * (1.0 - 1e-9)


def test_without_forces_only_the_hull_counts():
    X, omega = data_set(5)
    rows = [COLUMNS.index(c) for c in OTHERS]
    found = nearest_stable(X[:, rows], omega, OTHERS)
    assert is_stable(found.c, found.B, OTHERS)


def test_columns_that_the_plant_lacks_are_refused():
    X, omega = data_set(2)
    with pytest.raises(InputError, match="no such columns"):
        nearest_stable(X[:, :2], omega, ["u", "|u|tau_X"])


@pytest.mark.parametrize("seed", range(5))
def test_a_cut_is_a_direction_in_which_a_force_acts_too_little_to_its_side(seed):
    """Of each one row . vec(B) is v . B_tau v, by which 1 must be no less than EPSILON."""
    B = 0.8 * np.random.default_rng(seed).standard_normal((3, len(COLUMNS)))
    cuts = thrust_cuts(B, COLUMNS)
    B_tau = force_columns(B, COLUMNS)
    values = np.linalg.eigvalsh(np.eye(3) + 0.5 * (B_tau + B_tau.T))
    assert 1.0 + cuts.G @ B.ravel() == pytest.approx(values[values < EPSILON])
    assert 1.0 + cuts.h == pytest.approx(np.full(cuts.h.size, EPSILON + MARGIN))
    other = B + 0.1 * np.eye(3, len(COLUMNS))
    off = force_columns(other - B, COLUMNS)
    for row, v in zip(cuts.G, np.linalg.eigh(0.5 * (B_tau + B_tau.T))[1].T, strict=False):
        assert row @ (other - B).ravel() == pytest.approx(v @ off @ v)
    assert thrust_cuts(np.zeros_like(B), COLUMNS).G.shape == (0, B.size)


@pytest.mark.quick
def test_the_conditions_of_the_hull_are_its_dissipation():
    """G vec(B) is what a map adds to it at each motion, and h what is lacking without the map."""
    columns = COLUMNS
    B = 0.3 * np.random.default_rng(1).standard_normal((3, len(columns)))
    B[:, [k for k, c in enumerate(columns) if c.startswith("tau")]] = 0.0
    found = dissipation_conditions(tuple(columns), OPERATING)
    nu, metric = sampled_motions(OPERATING), mass(Model())
    base, with_map = (dissipation(as_model(np.zeros(3), x, columns), nu, metric) for x in (0.0 * B, B))
    assert found.G @ B.ravel() == pytest.approx(with_map - base, abs=1e-9)
    assert found.h == pytest.approx(least_dissipation(Model()) - base + MARGIN)
