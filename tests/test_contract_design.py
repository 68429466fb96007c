"""A planned run in parts: tracks of ships, orders of their actuators, rehearsed noise and what is written."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import InputError
from diagnosis.design import Designer, Limits, order_library, rehearsal, run_plan
from diagnosis.design.designing import FASTER
from diagnosis.design.information import Hypothesis, Knowledge
from diagnosis.design.manoeuvre_library import TEXTS, PlanStep
from diagnosis.design.order_library import ORDERS, Orders, asked_of
from diagnosis.design.planned_motion import Basin
from diagnosis.design.rehearsal import Rehearsal, RehearsedEffect, RowsOfRuns
from diagnosis.design.run_plan import Plan, PlannedRun
from diagnosis.design.spread import driven
from diagnosis.predictors import Model
from diagnosis.search.candidates import Candidate, CandidateShape
from diagnosis.search.gram import Nuisance
from fmus.declare import variables
from fmus.ship import ship

NONE = {n.name: 0.0 for n in variables(ship().vessel.params) if n.name[:2] in ("X_", "Y_", "N_")
        and not n.name.endswith("dot")}  # fmt: skip
H = 0.1


# What a plan may use


def designer(eta, nu, known, **limits):
    """Plans of the default ship, which has measured some poses and velocities, not all of them known."""
    data = [SimpleNamespace(smoothed=SimpleNamespace(eta=eta, nu=nu), known=known)]
    return Designer(data, None, Model(), Limits(60.0, **limits))


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.floats(2.0, 40.0))
def test_the_room_and_the_speeds_of_a_plan_are_those_of_its_runs(seed, longest):
    """A ship's length around the hull wherever it was; all of the length lies between the actuators."""
    rng = np.random.default_rng(seed)
    eta, nu = rng.normal(size=(300, 3)) * longest, rng.normal(size=(300, 3)) * [0.3, 0.1, 0.05]
    known = rng.random(300) < 0.8
    eta[~known], nu[~known] = 1e6, 1e6
    d = designer(eta, nu, known)
    corners = np.array(ship().description.outline)
    length = np.ptp(corners[:, 0])
    for axis, (low, high) in enumerate((d.basin.north, d.basin.east)):
        seen = eta[known, axis]
        assert (low, high) == pytest.approx((seen.min() - 1.5 * length, seen.max() + 1.5 * length))
    narrow = d.basin.size.min()
    r, half = d.reach, np.abs(corners[:, 0]).max()
    assert (r.aft, r.fore, r.time) == (-half, half, 1.0)
    assert r.room == pytest.approx(narrow - 2.0 * (0.1 * length + half))
    speeds = np.sort(np.hypot(*nu[known, :2].T))
    assert speeds[-6] * FASTER < r.speed < speeds[-1] * FASTER
    # The largest circle in the room can be turned at full speed.
    assert r.rate * max(0.5 * r.room, half) > r.speed * (1.0 - 1e-9)
    assert r.rate >= FASTER * np.sort(np.abs(nu[known, 2]))[-6]
    given = designer(eta, nu, known, size=(9.0, 7.0)).basin
    assert given.size == pytest.approx([9.0, 7.0])
    assert given.middle == pytest.approx(d.basin.middle)


def test_a_tenth_of_the_ship_is_its_margin_and_a_basin_has_room_for_both():
    still, known = np.zeros((9, 3)), np.ones(9, bool)
    length = np.ptp(np.array(ship().description.outline)[:, 0])
    least = 1.2 * length
    fits = designer(still, still, known, basin=Basin((0.0, 1.01 * least), (0.0, 3.0 * least)))
    assert fits.margin == pytest.approx(0.1 * length)
    with pytest.raises(InputError, match="is too small: ship and margin need more than"):
        designer(still, still, known, basin=Basin((0.0, 3.0 * least), (0.0, 0.99 * least)))


# Tracks by orders


def test_ships_that_orders_drive_gain_speed_by_their_mass_and_drag():
    """In surge alone u' = (X - d u) / m, from rest; each ship by its own orders, on its own heading."""
    model, n = Model({**NONE, "X_u": -2.0}), 40
    m, d = model.mass[0, 0], 2.0
    orders = np.zeros((n, 3, 2))
    orders[:, 0] = [0.5, -0.25]
    start = np.array([[0.0, 1.0], [0.0, 2.0], [0.0, 0.5 * np.pi]])
    tracks = driven([model], orders, start, H)
    assert tracks.shape == (2, n, 3)
    t = H * np.arange(n)
    way = (t - m / d * (1.0 - np.exp(-d / m * t))) / d
    assert tracks[0] == pytest.approx(np.column_stack([0.5 * way, 0.0 * t, 0.0 * t]), abs=1e-6)
    # Eastwards, astern.
    turned = np.column_stack([1.0 + 0.0 * t, 2.0 - 0.25 * way, 0.5 * np.pi + 0.0 * t])
    assert tracks[1] == pytest.approx(turned, abs=1e-6)


def test_several_ships_follow_the_same_orders():
    models = [Model({**NONE, "X_u": -2.0}), Model({**NONE, "X_u": -8.0})]
    orders = np.zeros((30, 3, 1))
    orders[:, 0] = 0.5
    slow = driven(models, orders, np.zeros(3), H)
    t = H * np.arange(30)
    for track, model, d in zip(slow, models, (2.0, 8.0), strict=True):
        m = model.mass[0, 0]
        assert track[:, 0] == pytest.approx(0.5 * (t - m / d * (1.0 - np.exp(-d / m * t))) / d, abs=1e-6)


# Orders


def asked_ship(allocates=True, units=(), limits=()):
    """A ship of which only what orders ask for is there."""
    layout = SimpleNamespace(
        full=lambda params: (10.0, 5.0, 4.0), limits=lambda params: limits,
        commands=tuple(f"c{k}" for k in range(len(units))),
    )  # fmt: skip
    described = SimpleNamespace(allocates=allocates)
    commands = dict(zip(layout.commands, units, strict=True))
    craft = SimpleNamespace(
        description=described,
        layout=layout,
        commands=commands,
        name="it",
        scale=SimpleNamespace(time=2.0),
    )
    return SimpleNamespace(ship=craft, drive=SimpleNamespace(params=None))


def run_of(*rows, commands=True):
    rows = np.array(rows, float)
    run = SimpleNamespace(commands=rows if commands else None, tau_cmd=10.0 * rows)
    return SimpleNamespace(run=run)


def test_a_ship_that_allocates_is_asked_a_force_ahead_and_a_moment():
    """Up to so many times those of its runs, within what its actuators can do."""
    model = asked_ship()
    data = [run_of([0.1, 9.0, 0.02], [-0.3, 0.0, 0.01]), run_of([0.2, 0.0, -0.05])]
    found = Orders.of(model, data, 1.5)
    assert found.names == ("tau_X", "tau_Y", "tau_N")
    assert found.high.tolist() == [4.5, 0.0, 0.0]
    assert found.low.tolist() == [-4.5, 0.0, 0.0]
    assert found.rudder.tolist() == [0.0, 0.0, 0.75]
    share = order_library.USABLE_THRUST
    more = Orders.of(model, data, 100.0)
    assert more.high[0] == pytest.approx(share * 10.0)
    assert more.rudder[2] == pytest.approx(0.5 * share * 4.0)


def test_a_ship_with_a_rudder_is_asked_revolutions_and_angles_within_its_limits():
    units, limits = ("1/s", "rad", "rad"), [(-5.0, 8.0), (-0.4, 0.3), (-1.0, 1.0)]
    found = Orders.of(asked_ship(False, units, limits), [run_of([4.0, 0.1, 0.1])], 1.5)
    assert found.names == ("c0", "c1", "c2")
    assert found.high.tolist() == [6.0, 0.0, 0.0]
    assert found.low.tolist() == [-5.0, 0.0, 0.0]
    assert found.rudder == pytest.approx([0.0, 0.3, np.radians(35.0)])
    fast = Orders.of(asked_ship(False, units, limits), [run_of([7.0, 0.1, 0.1])], 1.5)
    assert fast.high[0] == 8.0


@pytest.mark.parametrize(("units", "used"), [(("1/s",), [4.0]), (("1/s", "rad"), [0.0, 0.1])])
def test_without_thrust_or_rudder_no_run_is_designed(units, used):
    limits = [(-5.0, 5.0), (-1.0, 1.0)][: len(units)]
    with pytest.raises(InputError, match="no run is designed for it"):
        Orders.of(asked_ship(False, units, limits), [run_of(used)], 1.5)


def test_a_run_was_asked_what_its_thrusters_take():
    given = run_of([1.0, 2.0, 3.0])
    assert asked_of(given, asked_ship(False).ship).tolist() == [[1.0, 2.0, 3.0]]
    assert asked_of(given, asked_ship(True).ship).tolist() == [[10.0, 20.0, 30.0]]
    assert asked_of(run_of([1.0], commands=False), asked_ship(False).ship).tolist() == [[10.0]]


@settings(max_examples=20)
@given(st.sampled_from([*ORDERS]), st.lists(st.floats(0.0, 1.0), min_size=5, max_size=5))
def test_shares_of_a_course_are_at_most_one_and_begin_ahead(name, x):
    t = np.linspace(0.0, 119.9, 240)
    shares = ORDERS[name](t, 120.0, x, 1.0)
    assert shares.shape == (240, 2)
    assert np.abs(shares).max() <= 1.0
    assert shares[0, 0] >= 0.3 - 1e-12


def orders():
    return Orders(("n", "delta"), np.array([-2.0, 0.0]), np.array([4.0, 0.0]), np.array([0.0, 0.5]))


def test_orders_of_a_plan_are_shares_of_the_largest_thrust_and_rudder():
    """Ahead and astern by their own limits; each course begins anew, with the time scale of its ship."""
    plan = [
        PlanStep("stop", (0.0, 1.0, 0.5, 0.0, 0.0), 10.0, 0.0),
        PlanStep("turn", (0.0, 1.0, 1.0), 20.0, 0.0),
    ]
    t = np.arange(0.0, 30.5, 0.5)
    found = orders()._asked(plan, t, 0.5, asked_ship())
    astern = (t >= 4.0) & (t < 10.0)
    assert found[t < 4.0, 0] == pytest.approx(0.5 * 4.0)
    assert found[astern, 0] == pytest.approx(-0.5 * 0.65 * 2.0)
    assert found[t >= 10.0, 0] == pytest.approx(0.5 * 0.3 * 4.0)
    assert found[t < 10.0, 1] == pytest.approx(0.0)
    assert found[t >= 10.0, 1] == pytest.approx(-0.5 * 0.5)
    swing = orders()._asked([PlanStep("swing", (1.0, 1.0, 0.0), 100.0, 0.0)], t, 1.0, asked_ship())
    # Half a period of 5 s at the ship's scale of 2: to the other side after 5 s, and back 10 s later.
    assert swing[:, 1] == pytest.approx(np.where((t < 5.0) | ((t >= 15.0) & (t < 25.0)), 0.5, -0.5))


def test_motions_of_plans_begin_on_their_headings_about_the_middle_of_the_basin(monkeypatch):
    seen = []

    def driven(models, asked, start, h):
        seen.append((asked, start, h))
        way = h * np.arange(len(asked))
        return np.stack([np.column_stack([way, k * way, start[2, k] + 0.0 * way]) for k in range(2)])

    monkeypatch.setattr(order_library, "driven", driven)
    plans = [[PlanStep("turn", (0.0, 0.0, 0.0), 4.0, heading)] for heading in (0.5, 1.5)]
    basin = Basin((0.0, 10.0), (0.0, 20.0))
    first, second = orders().motions(plans, 4.0, 0.5, 1.0, asked_ship(), basin)
    ((asked, start, h),) = seen
    assert (asked.shape, h) == ((9, 2, 2), 0.5)
    assert start.tolist() == [[0.0, 0.0], [0.0, 0.0], [0.5, 1.5]]
    assert first.time.tolist() == [0.5 * k for k in range(9)]
    assert first.orders == pytest.approx(asked[:, :, 0])
    for motion, east in ((first, 0.0), (second, 2.0)):
        assert motion.eta[[0, -1], :2] == pytest.approx(
            np.array([[3.0, 10.0 - east], [7.0, 10.0 + east]])
        )
    assert second.eta[0, 2] == 1.5


# Rehearsal


def test_noise_lasts_as_many_windows_as_count_for_one():
    """A moving mean of white noise; as many windows as it has count as one, in the mean of all."""
    rehearsed = SimpleNamespace(space=SimpleNamespace(lasting=np.array([1.0, 3.2, 8.0])))
    noise = Rehearsal._noise(rehearsed, 20000, np.random.default_rng(0))
    assert noise.shape == (20000, 3)
    for axis, n in enumerate((1, 3, 8)):
        x = noise[:, axis]
        assert x.var() == pytest.approx(1.0 / n, rel=0.1)
        rho = [np.mean(x[k:] * x[: len(x) - k]) / x.var() for k in (1, 2, n)]
        assert rho == pytest.approx([max(0.0, 1.0 - k / n) for k in (1, 2, n)], abs=0.05)


def effects(*names, axis="X"):
    return {n: SimpleNamespace(id=n, axis=axis) for n in names}


def rows_of(seed=0, K=24, p=4):
    rng = np.random.default_rng(seed)
    X = rng.standard_normal((K, 3, p))
    blocks = np.column_stack([np.zeros(K, int), np.arange(K) // 4])
    return RowsOfRuns(rng.standard_normal((K, 3)), X, np.full((K, 3), 1e-3), blocks)


def space_of(rows, given=None):
    """One nuisance parameter, and effects a, b and c with one parameter each, in steps of 0.5."""
    block = SimpleNamespace(given=given or {}, names=("k",), steps=(0.5,), precision=None)
    start = SimpleNamespace(ship=SimpleNamespace(effects=effects("a", "b", "c")), unit=lambda n: 2.0)
    blocks = dict.fromkeys("abc", block)
    return SimpleNamespace(
        nuisance=["m"], offset=np.array([0.5]), blocks=blocks, start=start,
        places=lambda: {n: np.array([1 + 2 * k, 2 + 2 * k]) for k, n in enumerate("abc")},
    )  # fmt: skip


def test_a_shape_has_the_columns_of_its_effect():
    rows = rows_of(p=7)
    s = space_of(rows)
    found = rehearsal._shape(s, "b", rows.X[..., [3, 4]])
    assert found.offset is None
    assert found.columns == pytest.approx(rows.X[..., [4]])
    assert found.unit == pytest.approx([4.0])
    assert rehearsal._shape(
        space_of(rows, {"t": 1.0}), "b", rows.X[..., [3, 4]]
    ).offset == pytest.approx(rows.X[..., 3])


def test_rivals_of_an_effect_are_those_that_explain_what_is_expected():
    rows = rows_of(p=7)
    like = 2.0 * rows.X[..., 2] + 1.9 * rows.X[..., 6] + 0.5 * rows.X[..., 3]
    s = space_of(rows)
    h = Hypothesis(("a",), np.array([0, 1, 2]), np.array([1, 2]))
    alone = RehearsedEffect.of(s, rows, like, h, "a")
    assert [c.effect.id for c in alone.rivals] == ["a", "c", "b"]
    assert alone.nuisance.columns.shape == (24, 3, 1)
    assert alone.nuisance.precision.tolist() == [[1.0]]
    assert not alone.known.any()
    assert alone.steps == (0.5,)
    two = Hypothesis(("a", "b"), np.arange(5), np.arange(1, 5))
    both = RehearsedEffect.of(s, rows, like, two, "a")
    assert [c.effect.id for c in both.rivals] == ["a", "c"]
    assert both.nuisance.columns == pytest.approx(rows.X[..., [0, 4]])
    assert both.nuisance.precision.tolist() == [[1.0, 0.0], [0.0, 0.0]]
    assert both.nuisance.unit.tolist() == [1.0, 4.0]
    assert both.nuisance.offset.tolist() == [0.5, 0.0]
    assert both.known == pytest.approx(rows.X[..., 3])


def rehearsed(offset=None, given=None):
    """An effect of one parameter, with one nuisance parameter, and a rival."""
    rows = rows_of(p=4)
    shape = CandidateShape(given or {}, ["k"], offset, rows.X[..., [1]], np.ones(1))
    other = CandidateShape({}, ["j"], None, rows.X[..., [2]], np.ones(1))
    candidates = [
        Candidate(e, [s]) for e, s in zip(effects("a", "b").values(), (shape, other), strict=True)
    ]
    nuisance = Nuisance(rows.X[..., [0]], np.eye(1), np.zeros(1), np.ones(1))
    known = 0.3 * rows.X[..., 3]
    return RehearsedEffect(candidates, nuisance, known, rows, (0.5,)), rows


@pytest.mark.parametrize("with_offset", [False, True])
def test_values_are_those_of_least_squares_beside_the_nuisance_parameters(with_offset):
    """In units of the noise of a window that counts; the nuisance parameter has a prior."""
    drawn = np.random.default_rng(5).standard_normal((24, 3))
    offset = drawn if with_offset else None
    trial, rows = rehearsed(offset, {"k": 7.0} if with_offset else None)
    y = 4.0 * rows.X[..., 1] + 0.5 * rows.X[..., 0] + rows.y
    _, values, std = trial.judged(y)
    A = np.column_stack([rows.X[..., 0].ravel(), rows.X[..., 1].ravel()])
    A = np.vstack([A, [1.0, 0.0]])  # the prior of the nuisance parameter
    left = y - trial.known - (drawn if with_offset else 0.0)
    b = np.append(left.ravel(), 0.0)
    wanted = np.linalg.solve(A.T @ A, A.T @ b)[1]
    deviation = np.sqrt(np.linalg.inv(A.T @ A)[1, 1])
    assert values["k"] == pytest.approx((7.0 if with_offset else 0.0) + 0.5 * wanted, rel=1e-6)
    assert std == {"k": pytest.approx(0.5 * deviation, rel=1e-6)}


def test_a_finding_is_the_effect_with_its_interval_and_evidence():
    trial, rows = rehearsed()
    found = trial.finding(6.0 * rows.X[..., 1] + trial.known + 0.1 * rows.y, np.random.default_rng(0))
    _, values, std = trial.judged(6.0 * rows.X[..., 1] + trial.known + 0.1 * rows.y)
    assert (found.id, found.values) == ("a", values)
    low, high = found.ci95["k"]
    assert (0.5 * (low + high), 0.5 * (high - low)) == pytest.approx(
        (values["k"], 1.96 * std["k"]), rel=1e-4
    )
    assert found.confidence == found.evidence.bagged == found.set_evidence.bagged > 0.95
    other = trial.finding(6.0 * rows.X[..., 2] + trial.known + 0.1 * rows.y, np.random.default_rng(0))
    assert other.confidence < 0.05, "its rival is the cause"


class Rehearsed(Rehearsal):
    """A rehearsal whose parts are given."""

    listed, residual, confidences = 0.5, ({"Y"}, {"X"}), None

    def __init__(self, listed=0.5):
        h = [Hypothesis((n,), np.arange(1), np.arange(1)) for n in "ab"]
        every = effects("a", "b")
        start = SimpleNamespace(ship=SimpleNamespace(effects=every))
        self.__dict__.update(
            data=[], space=SimpleNamespace(start=start), listed=listed,
            k=SimpleNamespace(hypotheses=h, weights=np.array([0.2, 0.8])),
            confidences=lambda planned, seed, draws: np.array([0.94, 0.95, 1.0, 0.2]),
        )  # fmt: skip


def test_probability_to_be_sure_is_that_of_the_list_and_of_the_outcomes():
    assert Rehearsed(0.5).sure([], 0) == pytest.approx(0.5 * 0.5)


@pytest.mark.parametrize(
    ("listed", "text", "count"), [(0.5, "", 2), (0.96, "", 1), (0.96, "two clocks", 2)]
)
def test_doubts_are_of_the_data_the_residual_and_the_list(monkeypatch, listed, text, count):
    monkeypatch.setattr(rehearsal, "doubt_of_data", lambda data: text)
    found = Rehearsed(listed).doubts
    assert len(found) == count
    left = [d for d in found if "leaves a significant residual" in d]
    assert left == [
        "b leaves a significant residual in X in the runs so far, which limits its confidence."
    ]
    assert any("probability of 50%" in d for d in found) == (listed == 0.5)


# The plan


def planned(count=1, orders=None, inseparable=()):
    """A plan of equal runs: a candidate with the steps 0.5 of its parameter, and none."""
    h = [
        Hypothesis(("a",), np.array([0, 1, 2]), np.array([1, 2])),
        Hypothesis((), np.array([0]), np.zeros(0, int)),
    ]
    G = np.diag([3.0, 1.0, 8.0])
    k = Knowledge(h, np.array([0.75, 0.25]), G, np.array([1.0, 0.0, 16.0]), np.eye(3), np.zeros(3), 1.0)
    start = SimpleNamespace(declared=lambda n: SimpleNamespace(unit="kg"))
    block = SimpleNamespace(names=("k",), steps=(0.5,))
    space = SimpleNamespace(start=start, blocks={"a": block}, places=lambda: {"a": np.array([1, 2])})
    like = SimpleNamespace(smoothed=SimpleNamespace(track=SimpleNamespace(period=0.05)))
    designer = SimpleNamespace(
        limits=SimpleNamespace(seconds=240.0), orders=orders, space=space, data=[like],
        usual_runs={"circle": (), "eight": ()}, basin=Basin((0.0, 6.0), (-2.0, 2.0)),
    )  # fmt: skip
    steps = [PlanStep("legs", (0.12345,), 120.0, 0.1), PlanStep("circle", (0.5,), 120.0, 0.2)]
    scored = SimpleNamespace(steps=steps, gram=np.diag([1.0, 1.0, 27.0]))
    usual = {"circle": (0.4, SimpleNamespace(gram=np.diag([0.0, 0.0, 7.0])))}
    spread = SimpleNamespace(ids=[0], margin=np.array([0.345]))
    runs = [PlannedRun(designer, scored, k, spread, 0.9, usual)] * count
    return Plan(runs, k, inseparable, ["advice"], 3, "certainty")


def test_intervals_are_those_of_the_posterior_before_and_after():
    (row,) = planned().runs[0].intervals()
    assert (row["hypothesis"], row["name"], row["unit"]) == ("a", "k", "kg")
    half = {
        n: 1.959964 * 0.5 / np.sqrt(x) for n, x in (("before", 9.0), ("after", 36.0), ("circle", 16.0))
    }
    assert row["half_width"] == pytest.approx(half, rel=1e-5)


def test_the_least_distance_is_over_pairs_and_draws(monkeypatch):
    """Of the candidate from nothing: what its force at its values weighs in old and new data."""
    run = planned().runs[0]
    seen = []
    monkeypatch.setattr(
        run_plan, "projected", lambda k, i, j, z, G: seen.append((i, j, z, G)) or float(z[2])
    )
    worst = run.worst
    assert worst == min(z[2] for *_, z, _ in seen)
    for i, _, z, G in seen:
        assert np.diag(G).tolist() == [4.0, 2.0, 35.0]
        if i == 1:
            assert not z[1:].any(), "what it has alone"
    values = np.array([z[2] for i, _, z, _ in seen if i == 0])
    assert values.size == 8
    # Mean 16 / 9, standard deviation 1 / 3.
    assert abs(values.mean() - 16.0 / 9.0) < 0.5
    assert 0.1 < values.std() < 0.8


def test_a_plan_has_its_candidates_runs_and_what_they_compare_with():
    shown = planned(2, inseparable=[(("a",), ())]).lines()
    assert shown[:3] == ["Candidates", "   75.0%  a", "   25.0%  coefficients alone"]
    assert shown[3:6] == ["No run within the limits discriminates", "  a and no effect", "advice"]
    assert shown[6:9] == ["Run 1: 4 min", f"    120 s  {TEXTS['legs']}", f"    120 s  {TEXTS['circle']}"]
    assert "0.34 m" in shown[9] or "0.35 m" in shown[9]
    assert shown[11:14] == [
        "     90%  this run",
        "     40%  circle",
        "       -  eight, which exceeds the limits",
    ]
    assert shown[14] == "Run 2: 4 min"
    assert "No run within the limits discriminates" not in planned().lines()


def test_the_content_of_a_plan_has_numbers_for_programs():
    stated = planned(2, inseparable=[(("b", "a"), ("a", "c"))]).content()
    assert stated["inseparable"] == [["a", "b", "c"]]
    assert stated["hypotheses"] == [{"ids": ["a"], "weight": 0.75}, {"ids": [], "weight": 0.25}]
    assert [r["commands"] for r in stated["runs"]] == ["commands_1.csv", "commands_2.csv"]
    first = stated["runs"][0]
    assert (first["minutes"], first["sure"], first["usual"]) == (4.0, 0.9, {"circle": 0.4})
    assert first["manoeuvres"][0]["numbers"] == [0.1235]
    assert first["margin"] == {"a": 0.345}
    assert (stated["seed"], stated["criterion"], stated["advice"]) == (3, "certainty", ["advice"])


def test_a_page_says_how_to_carry_a_run_out():
    text = run_plan.page(planned(2))
    assert "## Run 2" in text
    assert "`cybership run scenario_2.json`" in text
    assert "at 20 Hz" in text
    assert "north 0.00 to 6.00 m, east -2.00 to 2.00 m" in text
    half = [1.959964 * 0.5 / np.sqrt(x) for x in (9.0, 36.0, 16.0)]
    assert f"| k [kg] of a | {' | '.join(f'{x:.3g}' for x in half)} |" in text
    assert "| circle |\n|---|--:|--:|--:|\n" in text
    assert "the set points for the controller" in text
    assert "the orders for the actuators" in run_plan.page(planned(orders=1))
    assert run_plan.files(2) == [
        "next.json", "plan.md", "scenario_1.json", "commands_1.csv", "track_1.png",
        "scenario_2.json", "commands_2.csv", "track_2.png",
    ]  # fmt: skip
