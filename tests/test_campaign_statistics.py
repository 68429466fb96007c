"""Comparisons within a campaign: paired intervals, the Pareto set, and the rule that stops."""

import math

import numpy as np
import pandas
import pytest

from cosim import InputError
from cosim.campaign import differences, pareto
from cosim.campaign.comparison import FEWEST_PAIRS, StopRule, check_request, interval
from cosim.campaign.design import Case
from cosim.dispatch.job import RunRow


def grid(controllers, seeds):
    pairs = [(c, s) for c in controllers for s in seeds]
    values = [{"c": c, "seed": s} for c, s in pairs]
    return [Case(k, v, v) for k, v in enumerate(values)]


def outcome(cases, value):
    """Number -> row, where ``value(case)`` is the metric W."""
    return {case.number: RunRow("done", "", 0.0, {"W": value(case)}, {}) for case in cases}


def test_interval_is_that_of_student():
    scipy_stats = pytest.importorskip("scipy.stats")
    x = np.array([1.0, 2.0, 4.0, 8.0])
    low, high = scipy_stats.t.interval(0.95, 3, x.mean(), scipy_stats.sem(x))
    assert interval(x.tolist()) == pytest.approx(((low + high) / 2, (high - low) / 2))
    assert interval([1.0]).half == math.inf


def test_rule_stops_when_the_interval_of_the_pairs_is_narrow_enough():
    cases = grid("ab", range(300))
    rng = np.random.default_rng(1)
    common, own = rng.normal(50.0, 10.0, 300), rng.normal(0.0, 1.0, 300)
    rows = outcome(
        cases,
        lambda c: common[c.values["seed"]] + (c.values["c"] == "b") * (3.0 + own[c.values["seed"]]),
    )
    rule = StopRule("c W 0.4", cases, 7)
    assert [c.values["c"] for c in rule.ordered[:4]] == ["a", "b", "a", "b"]
    assert sorted(c.number for c in rule.ordered) == list(range(600))
    ended = {}
    for case in rule.ordered:
        ended[case.number] = rows[case.number]
        if rule.satisfied(ended.get):
            break
    stated = rule.verdict(ended.get)
    # 1.96² · 1² / 0.4² = 24; unpaired it would take 10² times as many.
    assert 15 <= stated["pairs"] <= 40
    _, low, high = stated["difference"]["b"]
    assert high - low <= 0.8
    assert low < 3.0 < high
    counted = rule.counted(ended.get)
    assert len(counted) == 2 * stated["pairs"]
    # It is decided by the order of the pairs, not by which of them ended first.
    assert StopRule("c W 0.4", cases, 7).counted(rows.get) == counted


def test_interval_of_the_rule_holds_the_difference_as_often_as_it_says():
    """Normal differences, 1.5 and 2.5 times as spread as the width: the level within 2 %."""
    seeds = range(60)
    cases = grid("ab", seeds)
    for spread in (1.5, 2.5):
        rng = np.random.default_rng(int(10 * spread))
        inside = []
        for _ in range(150):
            drawn = rng.normal(0.0, spread, len(seeds))
            rows = outcome(cases, lambda c, d=drawn: d[c.values["seed"]] * (c.values["c"] == "b"))
            stated = StopRule("c W 1.0", cases, 0).verdict(rows.get)
            assert stated["known"]
            _, low, high = stated["difference"]["b"]
            inside.append(low <= 0.0 <= high)
        assert np.mean(inside) > 0.93 - 2.0 * math.sqrt(0.05 * 0.95 / 150)


def test_shares_are_of_the_ratio_and_failed_pairs_are_left_out():
    cases = grid("ab", range(12))
    rows = outcome(cases, lambda c: 2.0 * (1.1 if c.values["c"] == "b" else 1.0))
    rows[3] = RunRow("failed", "broke", 0.0, {}, {})
    stated = StopRule("c W 1%", cases, 0).verdict(rows.get)
    assert stated["ratio_less_one"]["b"] == pytest.approx([0.1] * 3)
    assert FEWEST_PAIRS <= stated["pairs"] <= 11


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("c W", "is not a rule"),
        ("d W 1", "no axis 'd'"),
        ("c w 1", "no metric 'w'"),
        ("c W x", "is not a width"),
        ("c W -1%", "is not a width"),
    ],
)
def test_a_rule_that_is_none_is_refused(text, message):
    with pytest.raises(InputError, match=message):
        StopRule(text, grid("ab", [0, 1]), 0)


def test_a_rule_needs_partners():
    with pytest.raises(InputError, match="no pairs to compare"):
        StopRule("c W 1", grid("ab", [0, 1])[:3], 0)


@pytest.mark.parametrize(
    ("axis", "metrics", "message"),
    [
        ("d", [], "no axis 'd'"),
        ("c", ["w"], "no metric 'w'.*W"),
        (None, ["e_pos"], "no metric 'e_pos'.*e_pos_rms"),
    ],
)
def test_what_the_table_cannot_answer_is_refused_before(axis, metrics, message):
    with pytest.raises(InputError, match=message):
        check_request(grid("ab", [0, 1]), axis, metrics)


def test_only_runs_that_differ_in_the_axis_alone_are_a_pair():
    every = grid("ab", [0, 1])
    check_request(every, "c", ["W"])
    with pytest.raises(InputError, match="no two runs differ"):
        check_request([every[0], every[-1]], "c", ["W"])


@pytest.fixture
def table():
    rows = [
        ("a", 0, 1.0, 4.0),
        ("a", 1, 2.0, 4.0),
        ("b", 0, 1.5, 3.0),
        ("b", 1, 2.5, 3.0),
        ("c", 0, 3.0, 5.0),
    ]
    made = pandas.DataFrame(rows, columns=["c", "seed", "e_pos_rms", "W"])
    return made.assign(status="done", message="", wall_s=1.0, hash="x")


def test_differences_are_those_of_the_same_seeds(table):
    found = differences(table, ["c", "seed"], "c", ["e_pos_rms"]).set_index("value")
    assert found.loc["b", "difference"] == 0.5
    assert found.loc["b", "half"] == 0.0
    assert found.loc["b", "pairs"] == 2
    assert found.loc["b", "percent"] == pytest.approx(100.0 * (math.sqrt(1.5 * 1.25) - 1.0))
    assert found.loc["c", "pairs"] == 1


def test_pareto_set_is_what_nothing_beats(table):
    found = pareto(table, ["c", "seed"], ["e_pos_rms", "W"], ["seed"])
    assert list(found["c"]) == ["a", "b"]
    assert list(found["e_pos_rms"]) == [1.5, 2.0]
    table.loc[0, "status"] = "failed"
    assert list(pareto(table, ["c", "seed"], ["e_pos_rms", "W"], ["seed"])["c"]) == ["b"]


@pytest.fixture
def kept(monkeypatch):
    """Figures that a campaign draws, by name."""
    pytest.importorskip("pandas")
    from cosim.campaign import charts

    found = {}
    monkeypatch.setattr(charts, "save", lambda figure, path: found.update({len(found): figure}))
    return found


def test_categories_have_boxes_and_numbers_a_median_where_several_runs_share_a_value(kept, tmp_path):
    import pandas as pd

    from cosim.campaign.charts import draw_campaign
    from cosim.results import drawing

    made = pd.DataFrame(
        [
            {"K": k, "c": c, "seed": s, "W": 10.0 * k + s + (c == "b"), "status": "done" if s < 3 else "failed"}
            for k in (1.0, 2.0) for c in "ba" for s in range(4)
        ]
    )  # fmt: skip
    made.loc[0, "W"] = np.nan
    names = draw_campaign(made, ["K", "c", "seed"], ["seed"], ["W"], tmp_path, "c")
    assert [path.name for path in names] == ["metrics.png", "differences_c.png"], (
        "one axis of numbers has no map"
    )
    over_k, over_c = kept[0].axes
    points, median = over_k.get_lines()
    assert points.get_color() == median.get_color() == drawing.LINES[0][0], "as the pictures of runs"
    for each in (over_k, over_c, *kept[1].axes):
        assert not each.spines["top"].get_visible()
        assert each.get_axisbelow()
    assert points.get_xdata().size == 12, "runs that are done"
    assert median.get_xdata().tolist() == [1.0, 2.0]
    assert median.get_ydata().tolist() == [12.0, 21.5]
    assert [text.get_text() for text in over_c.get_xticklabels()] == ["b", "a"], "in their order"
    heights = [line.get_ydata().tolist() for line in over_c.get_lines()]
    assert [21.0, 21.0] in heights, "median of b"
    assert [16.0, 16.0] in heights, "median of a"
    assert (over_c.get_xlabel(), over_c.get_ylabel()) == ("c", "W [J]")
    (panel,) = kept[1].axes
    assert panel.get_title() == "c: less b"
    assert panel.get_xlabel() == "mean difference of W [J]"
    (bars,) = panel.containers
    assert bars[0].get_xdata() == pytest.approx([-1.0])
    assert panel.get_ylim() == (-0.5, 0.5)
    with pytest.raises(InputError, match="no metric 'V'"):
        draw_campaign(made, ["K"], [], ["V"], tmp_path)


def test_points_stand_where_values_form_no_grid_and_a_name_is_no_path(kept, tmp_path):
    import pandas as pd

    from cosim.campaign.charts import draw_campaign

    rows = [(0.1, 1, 5.0), (0.2, 2, 6.0), (0.3, 1, 7.0)]
    made = pd.DataFrame([{"a/b": x, "n": n, "W": w, "status": "done"} for x, n, w in rows])
    paths = draw_campaign(made, ["a/b", "n"], [], ["W"], tmp_path)
    assert [path.name for path in paths] == ["metrics.png", "map_a_b_n.png"]
    assert all(len(panel.get_lines()) == 1 for panel in kept[0].axes[:1]), "no median of single runs"
    panel, _ = kept[1].axes
    (points,) = panel.collections
    assert points.get_offsets().tolist() == [[x, n] for x, n, _ in rows]
    assert points.get_array().tolist() == [5.0, 6.0, 7.0]
    assert (panel.get_xlabel(), panel.get_ylabel(), panel.get_title()) == ("a/b", "n", "W")
    kept.clear()
    four = pd.DataFrame([{**dict.fromkeys("pqrs", float(k)), "W": k, "status": "done"} for k in (1, 2)])
    assert len(draw_campaign(four, [*"pqrs"], [], ["W"], tmp_path)) == 4, "three maps at most"


@pytest.mark.parametrize(("seeds", "title"), [((0, 1, 2), "W, median"), ((0,), "W")])
def test_pictures_tell_units_and_what_a_cell_is(kept, tmp_path, seeds, title):
    """Axes with their units; on a grid cell (i, j) is around the i-th and j-th value, however far apart."""
    import pandas as pd

    from cosim.campaign import charts

    gains, stops = (0.1, 0.2, 0.8), (10.0, 20.0)
    made = pd.DataFrame(
        [
            {"K": k, "end": t, "seed": s, "W": 10.0 * k + t + s, "status": "done"}
            for k in gains for t in stops for s in seeds
        ]
    )  # fmt: skip
    charts.draw_campaign(
        made, ["K", "end", "seed"], ["seed"], ["W"], tmp_path, units={"K": "1/s", "end": "s"}
    )
    against, maps = kept.values()
    assert [panel.get_xlabel() for panel in against.axes] == ["K [1/s]", "end [s]"]
    panel, bar = maps.axes
    assert (panel.get_xlabel(), panel.get_ylabel(), panel.get_title()) == ("K [1/s]", "end [s]", title)
    assert bar.get_ylabel() == "W [J]"
    (image,) = panel.images
    assert image.get_extent() == [-0.5, 2.5, -0.5, 1.5]
    assert [t.get_text() for t in panel.get_xticklabels()] == ["0.1", "0.2", "0.8"]
    assert image.get_array()[1, 2] == pytest.approx(8.0 + 20.0 + np.median(seeds))


def test_bands_of_an_ensemble_are_about_the_mean_and_headings_in_degrees():
    pd = pytest.importorskip("pandas")
    from cosim.campaign.charts import draw_bands

    t = np.linspace(0.0, 10.0, 11)
    poses = np.array([[0.1 * t + k, 0.2 * t, 0.01 * k * t] for k in (-1.0, 0.0, 1.0)])
    found = pd.DataFrame({"time": t})
    for name, mean in (("x", 0.1 * t), ("y", 0.2 * t), ("psi", 0.0 * t)):
        for q in ("mean", 5, 25, 75, 95):
            found[f"{name}_{q}"] = mean + (0.0 if q == "mean" else (q - 50) / 100.0)
    track, *channels = draw_bands(found, poses).axes
    assert track.get_title() == "3 members"
    *members, mean = track.lines
    assert [m.get_ydata().tolist() for m in members] == poses[:, 0].tolist(), "north is up"
    assert [m.get_xdata().tolist() for m in members] == poses[:, 1].tolist()
    assert mean.get_xdata().tolist() == (0.2 * t).tolist()
    assert [p.get_ylabel() for p in channels] == ["north [m]", "east [m]", "heading [°]"]
    for panel, scale in zip(channels, (1.0, 1.0, 180.0 / np.pi), strict=True):
        widths = [np.ptp(c.get_paths()[0].vertices[:, 1]) for c in panel.collections]
        assert widths == pytest.approx([0.9 * scale, 0.5 * scale])
    assert [t.get_text() for t in channels[0].get_legend().get_texts()] == ["90 %", "50 %", "mean"]
    assert channels[2].get_xlabel() == "time [s]"


def test_units_of_axes_are_those_of_the_parameters(tmp_path):
    from cosim.campaign.campaign_file import LoadedCampaign
    from cosim.campaign.charts import axis_units

    axes = {
        "K": {"set": "fmus.controller.parameters.K_p_x", "values": [0.1, 0.2]},
        "m": {"set": "vessel.m", "values": [14.0, 15.0]},
        "end": {"set": "stop", "values": [10.0, 20.0]},
        "seed": {"set": "seed", "values": [0, 1]},
    }
    loaded = LoadedCampaign({"scenario": "ellipse", "axes": axes, "design": "grid"})
    assert axis_units(loaded) == {"K": "1/s", "m": "kg", "end": "s"}
