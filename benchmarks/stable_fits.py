"""Is every constrained fit stable, and what does it cost? ``python -m benchmarks.stable_fits``.

Random data sets: a motion and forces as of a run, and a model error that is a random linear map of them
with noise. Most such maps drive the ship on, or reverse a force. Each is fitted by least squares and by
:func:`thesis.analysis.nearest_stable`.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from diagnosis.assessment import least_dissipation
from diagnosis.predictors import Model
from thesis.analysis import as_model, effective_thrust, nearest_stable

COLUMNS = ["u", "v", "r", "tau_X", "tau_Y", "tau_N"]
COLUMNS += ["|u|u", "|u|v", "|u|r", "|v|v", "|v|r", "|r|v", "|r|r"]
SAMPLES = 400
# Standard deviations of u, v, r [m/s, m/s, rad/s], and of the forces [N, N, N m].
SPREAD = (0.1, 0.03, 0.1, 0.6, 0.4, 0.3)
# Of a coefficient of a velocity, of a force, and of a product.
SIZE = np.array([3.0] * 3 + [0.5] * 3 + [5.0] * 7)
NOISE = 0.1  # N, N m


def data_set(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Columns (SAMPLES, 13) and model error (SAMPLES, 3) of a random ship."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(size=(SAMPLES, 6)) * SPREAD
    x = np.cumsum(steps, axis=0) / np.sqrt(np.arange(1, SAMPLES + 1))[:, None]
    u, v, r = x[:, :3].T
    products = [abs(u) * u, abs(u) * v, abs(u) * r, abs(v) * v, abs(v) * r, abs(r) * v, abs(r) * r]
    X = np.column_stack([x, *products])
    B = rng.normal(size=(3, len(COLUMNS))) * SIZE
    return X, X @ B.T + rng.normal(scale=NOISE, size=(SAMPLES, 3))


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stable_fits", description=__doc__)
    parser.add_argument("--sets", type=int, default=1000, help="random data sets (1000)")
    options = parser.parse_args(arguments)
    least = least_dissipation(Model())
    plain = stable = 0
    lost = []
    for seed in range(options.sets):
        X, omega = data_set(seed)
        found = nearest_stable(X, omega, COLUMNS)
        model = as_model(found.c, found.B, COLUMNS)
        thrust = effective_thrust(found.B[:, 3:6])
        stable += thrust.holds and least_dissipation(model) >= least
        plain += not found.changed
        lost.append(found.given_r2 - found.r2)
    cost = np.array(lost)
    print(
        f"{options.sets} random data sets: {plain} plain fits are stable, {stable} constrained ones; "
        f"R² lost: median {np.median(cost):.4f}, 90 % below {np.quantile(cost, 0.9):.3f}, "
        f"largest {cost.max():.3f}"
    )


if __name__ == "__main__":
    main()
