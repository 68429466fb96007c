"""What is kept of the past: stores against brute force, eigenvalues, smoothing and the gate."""

import itertools
import random

import numpy as np
import pytest
from support.loops import unlimited
from support.project import COMPONENTS
from support.traced import evaluated

from fmus.controller.blocker import Blocker, BlockerOptions, blocked, exceeds
from fmus.controller.eigen import exceed, smallest, tridiagonal
from fmus.controller.models import ROTATIONAL
from fmus.controller.smoothing import TAPS, Register, Tap, shifted
from fmus.controller.store import SIZE, StoredSample, StoreOptions, empty_store, offer, singular, window
from fmus.declare import flatten, packer, variables
from fmus.fmi.trace import trace_step, variable
from fmus.ops import choose, put, when


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 9, 20])
def test_smallest_eigenvalue_is_numpys(n):
    rng = np.random.default_rng(n)
    for rank in (n, n, n + 5, max(1, n - 1)):
        a = rng.normal(size=(rank, n)) * 10.0 ** rng.uniform(-3, 1, n)
        matrix = a.T @ a
        got = smallest([tridiagonal(matrix.tolist())])
        assert got == pytest.approx(
            np.linalg.eigvalsh(matrix)[0], abs=1e-13 * np.trace(matrix), rel=1e-9
        )


def test_diagonal_and_zero_matrices():
    assert smallest([tridiagonal(np.diag([3.0, 1.0, 2.0, 5.0]).tolist())]) == pytest.approx(1.0)
    assert smallest([tridiagonal(np.zeros((4, 4)).tolist())]) == 0.0
    assert smallest([tridiagonal([[2.0]]), tridiagonal([[4.0, 1.0], [1.0, 1.0]])]) == pytest.approx(
        0.69722436
    )


def test_bound_is_exceeded_below_the_smallest_eigenvalue_only():
    a = np.random.default_rng(0).normal(size=(9, 4))
    matrices = [tridiagonal((a.T @ a).tolist())]
    least = np.linalg.eigvalsh(a.T @ a)[0]
    assert exceed(matrices, least * (1 - 1e-9))
    assert not exceed(matrices, least * (1 + 1e-9))


def singular_value(samples):
    """Of the stacked Phi."""
    stacked = np.zeros((3 * len(samples), 8))
    for k, f in enumerate(samples):
        stacked[3 * k + 1, :4] = stacked[3 * k + 2, 4:] = f
    return np.linalg.svd(stacked, compute_uv=False).min() if len(samples) >= 4 else 0.0


class Reference:
    """Algorithms 1 and 2, corrected, written out with lists and numpy."""

    def __init__(self, change, age_limit):
        self.change, self.age_limit = change, age_limit
        self.rows, self.last = [None] * SIZE, np.zeros(4)

    def offer(self, time, f, queue):
        if self.age_limit:
            self.rows = [r if r and time - r[0] <= self.age_limit else None for r in self.rows]
        if np.sqrt(2) * np.linalg.norm(f - self.last) < self.change:
            return
        self.last = f
        if queue:
            self.rows = [(time, f), *self.rows[:-1]]
        elif None in self.rows:
            self.rows[self.rows.index(None)] = (time, f)
        else:
            best, place = self.sigma(), None
            for k in range(SIZE):
                value = singular_value([r[1] for r in (*self.rows[:k], (time, f), *self.rows[k + 1 :])])
                if value > best * (1 + 1e-12):
                    best, place = value, k
            if place is not None:
                self.rows[place] = (time, f)

    def sigma(self):
        return singular_value([r[1] for r in self.rows if r])


@pytest.mark.parametrize("age_limit", [0.0, 3.0])
@pytest.mark.parametrize("storage", [window, singular])
def test_store_is_that_of_brute_force(storage, age_limit):
    rng = np.random.default_rng(7)
    p = StoreOptions(store_change=0.4, age_limit=age_limit)
    store, reference = empty_store(ROTATIONAL), Reference(0.4, age_limit)
    kept = 0
    for k in range(300):
        f, time = rng.normal(size=4) * [0.1, 0.3, 0.1, 0.2], 0.1 * (k + 1)
        row = StoredSample(1.0, time, 0.0, (0.0, 1.0, 2.0), ((), tuple(f.tolist()), tuple(f.tolist())))
        store = offer(ROTATIONAL, storage, store, row, True, time, p, False)
        reference.offer(time, f, storage is window)
        times = [r.time if r.filled else None for r in store.rows]
        assert times == [r[0] if r else None for r in reference.rows]
        assert store.sums.count == sum(r is not None for r in reference.rows)
        assert np.sqrt(store.sums.least) == pytest.approx(reference.sigma(), rel=1e-6, abs=1e-7)
        kept += time in times
    assert kept > 20


def test_sums_are_those_of_the_rows():
    rng = np.random.default_rng(8)
    store, p = empty_store(ROTATIONAL), StoreOptions(store_change=0.0)
    for k in range(30):
        f = tuple(rng.normal(size=4).tolist())
        row = StoredSample(
            1.0, float(k), float(rng.uniform(-3, 3)), tuple(rng.normal(size=3).tolist()), ((), f, f)
        )
        store = offer(ROTATIONAL, window, store, row, True, float(k), p, True)
    f = np.array([r.F[1] for r in store.rows])
    y = np.array([r.target for r in store.rows])
    psi = np.array([r.psi for r in store.rows])
    assert store.sums.projected == pytest.approx([*(f.T @ y[:, 1]), *(f.T @ y[:, 2])])
    assert np.array(store.sums.grams[1]) == pytest.approx(f.T @ f)
    north = np.cos(psi) * y[:, 0] - np.sin(psi) * y[:, 1]
    assert store.sums.turned[0] == pytest.approx(north.sum())
    assert [row[0] for row in store.sums.cross[:4]] == pytest.approx(list(f.T @ -np.sin(psi)))
    assert [row[2] for row in store.sums.cross[4:]] == pytest.approx(list(f.sum(axis=0)))


@pytest.mark.parametrize("name", ["controller_cl_svd_eps", "controller_cl_win_z2"])
def test_full_store_traced_does_what_the_plain_one_does(name):
    component = COMPONENTS[name]
    rng = random.Random(1)
    trace, p = trace_step(component), unlimited(component.params())
    i = component.inputs()
    state, changed, points, expected = component.init(i, p), 0, [], []
    for k in range(40):
        values = [rng.uniform(-0.5, 0.5) for _ in variables(component.inputs)]
        i = packer(component.inputs)([*values[:9], 0.0, *values[10:]])
        new, out = component.step(state, i, p, 0.01)
        if k > 25:
            named = {f"params[{j}]": x for j, x in enumerate(flatten(p))}
            named |= {f"inputs[{j}]": x for j, x in enumerate(flatten(i))}
            named |= {f"state[{j}]": x for j, x in enumerate(flatten(state))}
            points.append(named | {"h": 0.01})
            expected.append(flatten(new) + flatten(out))
            changed += new.store.rows != state.store.rows
        state = new
    assert list(evaluated(trace.state + trace.outputs, points)) == expected
    assert changed > 2


def test_smoothed_sample_is_exact_for_a_parabola():
    """Mean of a line and slope of a parabola at the middle, half a span ago."""
    register, span, h = Register(), 1.0, 0.02
    fresh_at = []
    for k in range(100):
        t = k * h
        nu = (0.1 + 0.3 * t - 0.2 * t * t, 0.5 * t, -t * t)
        tap = Tap(t, 2.0 * t, nu, (1.0, t, -3.0 * t))
        register, full, fresh = shifted(register, tap, span, True)
        fresh_at += [t] * fresh
        assert full == (t >= span - 1e-9)
    s = register.sample
    assert s.time == pytest.approx(fresh_at[-1] - span / 2)
    assert s.nu_dot == pytest.approx((0.3 - 0.4 * s.time, 0.5, -2.0 * s.time))
    assert (s.psi, *s.tau) == pytest.approx((2.0 * s.time, 1.0, s.time, -3.0 * s.time))
    assert np.diff(fresh_at) == pytest.approx(span / (TAPS - 1))
    register, full, _ = shifted(register, tap, span, False)
    assert (register.count, full) == (0.0, False)


def test_noise_of_a_smoothed_acceleration_is_that_of_a_fit():
    rng = np.random.default_rng(9)
    register = Register()
    found = []
    for k in range(4000):
        nu = tuple(rng.normal(size=3).tolist())
        register, full, fresh = shifted(register, Tap(0.1 * k, 0.0, nu, nu), 1.0, True)
        if full and fresh:
            found.append(register.sample.nu_dot[0])
    assert np.std(found) < 0.2 * np.sqrt(2.0) / 0.1  # a fifth of a plain difference's


# state (beta, timer), spike -> state after 0.5 s, with a block time of 1 s.
GATE = [
    ((1.0, 0.0), False, (1.0, 0.0)),
    ((1.0, 0.0), True, (0.0, 0.0)),
    ((1.0, 1.5), False, (1.0, 1.5)),
    ((1.0, 1.5), True, (0.0, 0.0)),
    ((0.0, 0.0), False, (0.0, 0.5)),
    ((0.0, 0.0), True, (0.0, 0.0)),
    ((0.0, 1.0), False, (0.0, 1.5)),
    ((0.0, 1.0), True, (0.0, 0.0)),
    ((0.0, 1.5), False, (1.0, 1.5)),
    ((0.0, 1.5), True, (0.0, 0.0)),
]


@pytest.mark.parametrize(("before", "spike", "after"), GATE)
def test_gate_goes_from_state_to_state(before, spike, after):
    assert blocked(Blocker(*before), spike, 1.0, 0.5) == after
    assert blocked(Blocker(*before), spike, 1.0, 0.0) == before


@pytest.mark.parametrize("above", list(itertools.product([False, True], repeat=3)))
def test_each_norm_alone_is_a_spike(above):
    p = BlockerOptions(nu_dot_max=0.5, nu_max=1.0, tau_max=3.0)
    factors = [1.001 if a else 0.999 for a in above]
    direction = (2 / 3, -2 / 3, 1 / 3)
    nu_dot, nu, tau = (
        tuple(limit * f * d for d in direction)
        for limit, f in zip((0.5, 1.0, 3.0), factors, strict=True)
    )
    assert exceeds(nu, nu_dot, tau, p) == any(above)


def test_only_the_chosen_function_is_called_unless_nobody_knows():
    called = []

    def give(name, value):
        return lambda: called.append(name) or value

    assert when(True, give("a", 1.0), give("b", 2.0)) == 1.0
    assert called == ["a"]
    x = variable("x")
    (got,) = when(x > 0.0, give("c", (x,)), give("d", (2.0,)))
    assert called == ["a", "c", "d"]
    assert list(evaluated([got], [{"x": 3.0}, {"x": -1.0}])) == [[3.0], [2.0]]


def test_rows_are_put_at_an_index_that_may_be_a_number():
    rows = ((0.0, (1.0,)), (2.0, (3.0,)))
    assert put(rows, 1.0, (8.0, (9.0,))) == ((0.0, (1.0,)), (8.0, (9.0,)))
    assert put(rows, -1.0, (8.0, (9.0,))) == rows
    several = put(rows, np.array([0.0, 1.0]), (8.0, (9.0,)))
    assert [x.tolist() for x in flatten(several)] == [[8.0, 0.0], [9.0, 1.0], [2.0, 8.0], [3.0, 9.0]]
    assert choose(np.array([True, False]), Tap(), Tap(time=1.0)).time.tolist() == [0.0, 1.0]
