"""Parts of searches on numbers that are given: plans, profiles of rough parameters, starts, trials."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from cosim import InputError
from cosim.trials import Passage
from diagnosis.assessment import trial_errors
from diagnosis.design import designing
from diagnosis.design.designing import Designer, ScoredPlan
from diagnosis.design.manoeuvre_library import LIBRARY, USUAL_MANOEUVRES, PlanStep
from diagnosis.design.order_library import ORDERS, USUAL_ORDERS
from diagnosis.search import candidates
from diagnosis.search.nonlinear import profile
from diagnosis.search.refinement import RefinedModel
from fmus.ops import wrap

# Plans


class Designs(Designer):
    """A designer whose plans are scored by their numbers alone."""

    def __init__(self, score, orders=None, seconds=120.0, fast=2):
        self.__dict__.update(
            limits=SimpleNamespace(seconds=seconds), advance=lambda text: self.said.append(text), said=[], orders=orders,
            model=SimpleNamespace(ship=SimpleNamespace(scale=SimpleNamespace(time=1.0))), score=score, asked=[], tried=[],
        )  # fmt: skip

    def scored(self, k, plans, sizes=((1.0, 1.0),)):
        self.asked.append(len(plans))
        found = [replace(self.score(plan), size=sizes[0]) for plan in plans]
        self.tried += found
        return found


def by_first(plan):
    """Best where the first number of the first manoeuvre is 0.3."""
    x = plan[0].numbers[0]
    return ScoredPlan(plan, (1.0, 1.0), None, None, 0.0, -((x - 0.3) ** 2))


def test_a_search_takes_the_best_of_points_and_of_what_evolves_from_them():
    d = Designs(by_first)
    best = d.search(None, 3, points=16, evolved=60)
    first = max(s.score for s in d.tried[:16])
    assert best.score == max(s.score for s in d.tried) > first
    assert len(d.tried) == 76
    assert set(d.asked) == {1}, "targets need no simulation"
    assert d.said[:2] == ["searching a plan: 0 of 76", "searching a plan: 1 of 76"]
    assert len(best.steps) == 2, "a manoeuvre for each minute"
    assert all(s.name in LIBRARY and s.seconds == 60.0 for s in best.steps)
    again = Designs(by_first).search(None, 3, points=16, evolved=60)
    assert again.score == best.score
    assert Designs(by_first, seconds=20.0).search(None, 3, points=8, evolved=0).steps[0].seconds == 20.0
    long = Designs(by_first, seconds=6000.0).search(None, 3, points=8, evolved=0)
    assert len(long.steps) == designing.MOST_PIECES


def test_simulated_tracks_are_searched_many_at_once():
    d = Designs(by_first, orders="orders")
    best = d.search(None, 3, points=16, evolved=20)
    assert d.asked[0] == 16
    assert all(n > 1 for n in d.asked)
    assert best.steps[0].name in ORDERS
    assert [*d.library] == [*ORDERS]
    assert d.usual_runs is USUAL_ORDERS
    assert Designs(by_first).usual_runs is USUAL_MANOEUVRES


def test_a_search_ends_with_its_time(monkeypatch):
    clock = iter([0.0] + [designing.SECONDS - 1.0] * 5 + [designing.SECONDS + 1.0] * 999)
    monkeypatch.setattr(designing, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    d = Designs(by_first)
    best = d.search(None, 3, points=16, evolved=60)
    assert len(d.tried) == 5
    assert best.score == max(s.score for s in d.tried)


def test_where_no_plan_keeps_the_limits_it_is_refused():
    d = Designs(lambda plan: replace(by_first(plan), excess=0.1, score=-1.1))
    with pytest.raises(InputError, match="no manoeuvre of the library keeps the limits"):
        d.search(None, 3, points=8, evolved=0)


class Sized(Designs):
    """Plans that keep the limits at some sizes; of a grade each."""

    def __init__(self, keeps):
        super().__init__(None)
        self.keeps = keeps
        self.space = SimpleNamespace(gram=lambda windows: np.array([[len(windows)]]))
        self.criterion = "certainty"

    scored = Designer.scored

    def motions(self, plans, size, h):
        self.asked.append((size, [p[0].name for p in plans]))
        return [(p[0].name, size) for p in plans]

    def excess(self, motion):
        name, size = motion
        return 0.0 if designing.SMALLER.index(size) >= self.keeps[name] else 0.25

    def windows(self, motion):
        return motion


def test_a_plan_has_the_first_size_at_which_it_keeps_the_limits(monkeypatch):
    monkeypatch.setitem(designing.CRITERIA, "certainty", lambda k, gram: 0.5)
    d = Sized({"a": 0, "b": 2, "c": 99})
    plans = [[PlanStep(n, (), 1.0, 0.0)] for n in "abc"]
    a, b, c = d.scored(SimpleNamespace(G=np.ones((1, 1))), plans)
    assert (a.size, b.size, c.size) == (
        designing.SMALLER[0],
        designing.SMALLER[2],
        designing.SMALLER[-1],
    )
    assert (a.score, b.score, c.score) == (0.5, 0.5, -1.25)
    assert (c.excess, c.gram.tolist(), a.gram.tolist()) == (0.25, [[0.0]], [[1]])
    assert [names for _, names in d.asked] == [["a", "b", "c"], ["b", "c"], ["b", "c"], ["c"], ["c"]]
    assert d.tried == [a, b, c]
    assert d.scored(SimpleNamespace(G=np.ones((1, 1))), plans[:1])[0].size == designing.SMALLER[0]


def test_the_first_plan_whose_spread_keeps_the_basin_is_taken():
    """Each is tried slower and in less room before the next one; the usual runs come last."""
    d = Designs(by_first)
    plan = [PlanStep("legs", (0.3,), 1.0, 0.0)]
    plans = [replace(by_first(plan), score=s) for s in (0.9, 0.8, 0.7, 0.6, 0.5)]
    plans[2] = replace(plans[2], excess=0.1)
    d.tried = plans[::-1]
    of_names = {"eight": 0.1, "circle": 0.2, "zig-zag": 0.3}
    usual = [replace(by_first(plan), score=score) for score in of_names.values()]
    best = d.best(plans[0], usual)
    assert [s.score for s in best[: designing.REFINED]] == [0.9, 0.8, 0.6]
    assert [s.score for s in best[designing.REFINED :]][:3] == [0.3, 0.2, 0.1]
    d.tried += usual  # they were scored, and are no better than others then
    assert d.best(plans[0], usual) == best
    assert d.best(plans[0], plans[:2]) == best[:3], "none is checked twice"

    asked, kept = [], set()

    def spread(k, s, seed):
        asked.append((s.score, s.size))
        return SimpleNamespace(margin=np.array([0.2, 0.1 if asked[-1] in kept else 0.0]))

    d.__dict__["spread"] = spread
    first, *smaller = designing.SMALLER
    for size in designing.SMALLER:
        kept.clear()
        kept.add((0.9 if size == first else 0.0, size))
        asked.clear()
        found, tracks = d.checked(None, [plans[0]], 0)
        assert (found.size, tracks.margin[1]) == (size, 0.1)
        assert [s for _, s in asked] == [*designing.SMALLER[: designing.SMALLER.index(size) + 1]]
    kept.clear()
    asked.clear()
    with pytest.raises(InputError, match="leaves the basin"):
        d.checked(None, best[:2], 0)
    assert asked == [
        (0.9, first),
        *((0.0, s) for s in smaller),
        (0.8, first),
        *((0.0, s) for s in smaller),
    ]


# Profiles


@dataclass
class Estimate:
    """A model: cost (value - best)^2 / size^2 in one parameter about a start."""

    values: dict
    start: SimpleNamespace
    precision: np.ndarray = field(default_factory=lambda: np.array([[2.0]]))
    fitted: tuple = ("other", "radius")
    held: frozenset = frozenset({"kept"})
    fitting = RefinedModel.fitting

    def holding(self, names):
        return ("holding", names)


def profiled(monkeypatch, best, size, present, start=1.0, rough=("radius",)):
    monkeypatch.setattr(profile, "is_rough", lambda t, at, n: n in rough)
    of = SimpleNamespace(value=lambda n: start, unit=lambda n: 1.0)
    at = Estimate({"radius": present - start, "other": 0.0}, of, np.diag([3.0, 5.0]))
    tried = []

    def trial(value):
        tried.append(value)
        cost = 7.0 + ((value - best) / size) ** 2
        return SimpleNamespace(cost=cost, estimate=Estimate({"radius": value - start}, of))

    monkeypatch.setattr(profile, "_profile", lambda *_: trial)
    p = SimpleNamespace(names=("radius", "other"))
    return (*profile.profiled(None, at, p), tried)


def test_a_profile_has_the_best_value_and_where_the_cost_rises(monkeypatch):
    model, intervals, _tried = profiled(monkeypatch, 2.2, 0.1, 2.0)
    assert model.values["radius"] + 1.0 == pytest.approx(2.2, abs=1e-3)
    half = 0.1 * profile.Z95
    low, high = intervals["radius"]
    assert (low + 1.0, high + 1.0) == (
        pytest.approx(2.2 - half, abs=2e-3),
        pytest.approx(2.2 + half, abs=2e-3),
    )
    assert model.precision.tolist() == [[2.0, 0.0], [0.0, 3.0]]
    assert model.held == {"kept", "radius"}
    # Of a negative value the ends are the other way round.
    model, _, _ = profiled(monkeypatch, -2.2, 0.1, -2.0)
    assert model.values["radius"] + 1.0 == pytest.approx(-2.2, abs=1e-3)


def test_a_profile_that_does_not_rise_ends_where_it_was_looked_for(monkeypatch):
    _, intervals, _ = profiled(monkeypatch, 2.0, 1e6, 2.0)
    low, high = intervals["radius"]
    assert high - low == pytest.approx(2.0 * profile.REACH * 2.0, rel=0.5)
    assert low + 1.0 == pytest.approx(0.5 * (low + high) + 1.0 - 0.5 * (high - low))


def test_several_rough_parameters_have_no_interval(monkeypatch):
    model, intervals, tried = profiled(monkeypatch, 2.0, 1.0, 2.0, rough=("radius", "other"))
    assert model == ("holding", ["radius", "other"])
    assert np.isnan([*intervals["radius"], *intervals["other"]]).all()
    assert tried == []
    assert profiled(monkeypatch, 2.0, 1.0, 2.0, rough=())[0] == ("holding", [])


def test_a_value_is_held_and_all_else_is_fitted_anew(monkeypatch):
    asked = []
    start = SimpleNamespace(value=lambda n: 1.0)
    beside = SimpleNamespace()
    at = SimpleNamespace(start=start, values={"radius": 0.5, "other": 0.2}, without=lambda names: beside)
    t = SimpleNamespace(error=lambda of: "error")
    monkeypatch.setattr(profile, "nuisance_of", lambda t, of, error: (of, error))
    monkeypatch.setattr(profile, "bounded", lambda start, name, x: min(x, 3.0))
    monkeypatch.setattr(profile, "refine", lambda *of: asked.append(of) or "refined")
    trial = profile._profile(t, at, SimpleNamespace(names=("radius", "other")), "radius")
    assert [trial(2.5), trial(2.5), trial(9.0)] == ["refined"] * 3
    (_, where, nuisance, begin), (*_, last) = asked
    assert (where, nuisance) == (beside, (beside, "error"))
    assert begin.values == {"radius": 1.5, "other": 0.2}
    assert last.values["radius"] == 3.0, "within its range"
    assert begin.fitted == ["other"]
    assert begin.precision.tolist() == [[0.0]]


# Starts of effects that are not linear in their parameters


def test_shapes_by_starts_are_those_at_the_best_values(monkeypatch):
    """The landscape has forces and the error over noise and floor, and the extent of the runs."""
    base = np.array([[3.0, 0.0, 0.0], [1.0, 2.0, 0.0]])
    force = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])

    class Model:
        ship = SimpleNamespace(scale=SimpleNamespace(forces=np.array([1.0, 2.0, 3.0])))

        def __init__(self, k=0.5):
            self.k = k

        def value(self, name):
            return self.k

        def unit(self, name):
            return 4.0

        def plus(self, changes):
            return Model(self.k + changes["k"])

    parameter = SimpleNamespace(name="k")
    e = SimpleNamespace(parameters=[parameter], coefficients=["k"])
    eta = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [99.0, 99.0, 0.0]])
    data = [SimpleNamespace(smoothed=SimpleNamespace(eta=eta), known=np.array([True, True, False]))]
    seen = []

    def best_values(of, tried):
        seen.append((of, tried({"k": 0.75})))
        return [{"k": 1.0}, {"k": 2.0}], ["k"]

    monkeypatch.setattr(candidates, "model_error", lambda data, model: base - model.k * force)
    monkeypatch.setattr(candidates, "best_values", best_values)
    monkeypatch.setattr(candidates, "scaled", lambda data, at, base, e, name: [{name: at.k}])
    monkeypatch.setattr(
        candidates, "shape", lambda data, model, base, given, fitted, step: (given, fitted, step)
    )
    found = candidates.by_starts(data, Model(), base, e, 0.1)
    assert found == [({"k": 1.0}, ["k"], 0.1), ({"k": 2.0}, ["k"], 0.1)], "of a coefficient an addition"
    ((of, tried),) = seen
    sigma = np.sqrt(np.mean(base**2, axis=0)) + candidates.FLOOR * [1.0, 2.0, 3.0]
    _, law, target, extent, present, units = of.__dict__.values() if hasattr(of, "__dict__") else of
    assert target == pytest.approx((base / sigma).ravel())
    assert law({"k": 2.0}) == pytest.approx((2.0 * force / sigma).ravel())
    assert (extent, present, units) == (5.0, {"k": 0.5}, {"k": 4.0})
    assert tried == [{"k": 0.75}]


# Trials


def test_measures_of_measured_and_predicted_trials_stand_side_by_side(monkeypatch):
    """From a second of the ship's scale before the first execute, as far as the predictions go."""
    time = np.arange(0.0, 50.0)
    heading = 0.2 * time  # turns through south
    order = np.where(time < 10.0, 0.0, 1.0)
    whole = Passage(time, time, 2.0 * time, heading, order)
    asked, seen = [], []

    def free_runs(begin):
        asked.append(begin)
        at = np.arange(8.0, 40.5, 0.5)
        poses = np.column_stack([at, 2.0 * at, wrap(0.2 * at)])
        away = poses.copy()
        away[-1, 0] = np.inf
        return at, [poses, away]

    def measure(trial, p, length):
        seen.append(p)
        return {
            "advance": float(p.psi[-1]),
            "overshoot_1": 1.0,
            "overshoot_2": 2.0,
            "overshoot_time_1": 3.0,
        }

    run = SimpleNamespace(trial="zigzag")
    ship = SimpleNamespace(vessel=SimpleNamespace(outline=SimpleNamespace(length=7.0)))
    e = SimpleNamespace(
        weak_windows=SimpleNamespace(run=run), model=SimpleNamespace(ship=ship),
        smoothed=SimpleNamespace(scale=SimpleNamespace(time=2.0)), free_runs=free_runs,
    )  # fmt: skip
    monkeypatch.setattr(trial_errors, "measured_passage", lambda s, ship: whole)
    monkeypatch.setattr(trial_errors, "measure", measure)
    found = trial_errors.trial_errors(e)
    assert asked == [8.0]
    assert seen[0].time.tolist() == np.arange(8.0, 41.0).tolist()
    assert seen[1].psi == pytest.approx(
        seen[0].psi - 2.0 * np.pi * np.round(seen[0].psi[0] / (2.0 * np.pi))
    )
    assert seen[1].x == pytest.approx(seen[0].x)
    assert seen[1].order.tolist() == seen[0].order.tolist()
    assert len(seen) == 2, "a track that runs away has no measures"
    assert found["advance"] == [pytest.approx(8.0), pytest.approx(8.0), None]
    assert found["overshoot"] == [[1.0, 1.0, None], [2.0, 2.0, None]]
    assert found["overshoot_time"] == [[3.0, 3.0, None]]
    run.trial = None
    assert trial_errors.trial_errors(e) is None


@pytest.mark.parametrize(
    ("trial", "units", "commands", "order"),
    [
        ("stop", ("rad",), True, [1.0, 4.0]), ("circle", ("1/s", "rad", "rad"), True, [7.5, 10.5]),
        ("circle", ("1/s", "1/s", "1/s"), True, [3.0, 6.0]), ("circle", ("rad",), False, [3.0, 6.0]),
    ],
)  # fmt: skip
def test_the_order_under_trial_is_an_angle_or_a_moment(trial, units, commands, order):
    run = SimpleNamespace(
        trial=trial, tau_cmd=np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]), commands=None
    )
    if commands:
        run.commands = np.array([[0.0, 7.0, 8.0], [0.0, 10.0, 11.0]])[:, : len(units)]
    ship = SimpleNamespace(commands=dict(zip("abc", units, strict=False)))
    assert trial_errors.order_under_trial(run, ship).tolist() == order
