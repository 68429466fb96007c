"""The table of channels: what was recorded is found again, and a noise that is given wrongly is doubted."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from support.measured import sail

from cosim import InputError
from diagnosis import Model, Run
from diagnosis.assessment.gathering import gather
from diagnosis.interactive import compare, load
from diagnosis.report.content import file_content
from diagnosis.report.report_data import ReportData
from diagnosis.runs import channels_of, prepare, table_of
from diagnosis.runs.smoothing.likelihood import equal_variances, excess_kurtosis
from diagnosis.search.findings import Finding
from diagnosis.session import begin
from diagnosis.verdict.confidence import Doubts, confidence_of, doubt_of_data

H, SECONDS, NOISE = 0.1, 120.0, np.array([4e-3, 4e-3, 2e-3])


def sailed(seed=0):
    """A smooth motion at 10 Hz with white noise, its yaw rate measured in addition."""
    t = np.arange(0.0, SECONDS, H)
    r = 0.1 * np.sin(0.25 * t)
    psi = np.cumsum(r) * H
    u = 0.3 + 0.05 * np.sin(0.1 * t)
    x, y = np.cumsum(u * np.cos(psi)) * H, np.cumsum(u * np.sin(psi)) * H
    rng = np.random.default_rng(seed)
    pose = np.column_stack([x, y, psi]) + NOISE * rng.standard_normal((t.size, 3))
    tau = np.column_stack([1.0 + 0.2 * np.sin(0.1 * t), 0.0 * t, 0.1 * np.cos(0.25 * t)])
    return Run("sailed", t, pose, tau, measured={"r": r + 1e-3 * rng.standard_normal(t.size)})


def table(run):
    return {c.name: c for c in channels_of(prepare(run).smoothed)}


def test_each_channel_has_its_own_rate_and_noise():
    run = sailed()
    place = run.pose.copy()
    rows = np.arange(run.time.size) // 5 * 5
    place[:, :2] = run.pose[rows, :2]
    found = table(replace(run, pose=place))
    assert [found[n].rate for n in ("x", "y", "psi", "r")] == pytest.approx([2.0, 2.0, 10.0, 10.0])
    assert [found[n].held for n in ("x", "psi")] == pytest.approx([0.8, 0.0], abs=0.01)
    assert [found[n].noise for n in ("x", "y", "psi")] == pytest.approx(NOISE, rel=0.3)
    assert found["r"].noise == pytest.approx(1e-3, rel=0.2)
    assert {c.noise_from for c in found.values()} == {"estimated"}
    assert {c.why for c in found.values()} == {""}
    assert [found[n].unit for n in ("x", "psi", "r")] == ["m", "rad", "rad/s"]


def test_outliers_of_a_channel_are_counted_with_their_times():
    run = sailed()
    pose = run.pose.copy()
    hit = [200, 500, 800, 1000]
    pose[hit, 2] += 0.3
    found = table(replace(run, pose=pose))
    assert found["psi"].outliers == len(hit)
    assert found["psi"].outlier_times == pytest.approx(run.time[hit])
    assert found["x"].outliers == 0


def test_residuals_of_white_noise_are_white_and_those_behind_a_filter_are_not():
    run, rng = sailed(), np.random.default_rng(1)
    assert [c.correlation for c in table(run).values()] == [0.0] * 4
    slow = np.convolve(rng.standard_normal(run.time.size), np.exp(-np.arange(40) / 4.0), "same")
    pose = run.pose + np.column_stack([0.02 * slow, 0.0 * slow, 0.0 * slow])
    given = replace(run, pose=pose, noise={"x": 0.1})
    assert table(given)["x"].correlation == pytest.approx(0.4, rel=0.5)


@pytest.mark.parametrize(("factor", "doubted"), [(0.1, True), (1.0, False), (10.0, True)])
def test_a_noise_that_the_samples_contradict_is_doubted(factor, doubted):
    given = {"x": float(factor * NOISE[0]), "psi": float(NOISE[2])}
    s = prepare(replace(sailed(), noise=given)).smoothed
    lines = [note for note in s.notes if "is given as" in note]
    assert [line.split()[3] for line in lines] == ["x"] * doubted
    assert all("remove the noise of the side-car" in line for line in lines)
    found = {c.name: c for c in channels_of(s)}
    assert (found["x"].noise, found["x"].noise_from) == (given["x"], "given")
    assert found["y"].noise_from == "estimated"


@pytest.mark.parametrize(("every", "sure"), [(4, True), (10, False)])
def test_of_rare_samples_nothing_is_sure(every, sure):
    rare = sailed().rows(np.arange(0, round(SECONDS / H), every))
    (windows,) = gather([rare], anyway=True)
    assert np.diff(windows.smoothed.time).max() <= 0.5 + 1e-9
    f = Finding("mass", {"mass": 30.0}, {"mass": (20.0, 40.0)}, 0.99, [], 0.9, 0.9, together=0.99)
    seen = confidence_of(f, Model(), Doubts(of_data=doubt_of_data([windows])))
    assert seen.own == (0.99 if sure else 0.5)
    assert ("too rare" in seen.doubt) != sure


def held(run, times=2):
    """The same run in a file that is as many times quicker, its rows held."""
    rows = np.repeat(np.arange(run.time.size), times)
    later = np.tile(np.arange(times), run.time.size) / times * H
    return replace(run.rows(rows), time=run.time[rows] + later, measured={})


def test_held_rows_add_no_information():
    run = replace(sailed(), measured={})
    whole, slow = prepare(held(run)).smoothed, prepare(run).smoothed
    assert whole.noise == pytest.approx(slow.noise, rel=1e-6)
    assert whole.noise_rel_std == pytest.approx(slow.noise_rel_std, rel=0.01)
    assert whole.counts.used == slow.counts.used
    off = whole.eta[::2] - slow.eta
    assert np.nanmax(np.abs(off) / slow.eta_std) < 0.01


def test_start_of_time_and_scale_of_the_place_do_not_matter():
    run = replace(sailed(), measured={})
    first = prepare(run).smoothed
    later = prepare(replace(run, time=run.time + 2.0**17)).smoothed
    assert later.noise == pytest.approx(first.noise, rel=1e-4)
    assert later.eta == pytest.approx(first.eta, abs=1e-4 * NOISE.min(), nan_ok=True)
    larger = prepare(replace(run, pose=run.pose * [2.0, 2.0, 1.0])).smoothed
    # Twice the way by the same commands is not that of the described ship: their gains are fitted.
    assert larger.noise == pytest.approx(first.noise * [2.0, 2.0, 1.0], rel=5e-3)
    assert larger.noise_rel_std == pytest.approx(first.noise_rel_std, rel=0.2)


def test_added_noise_is_found_beside_that_which_is_there():
    run, more = replace(sailed(), measured={}), 0.02
    rng = np.random.default_rng(3)
    rows = np.arange(run.time.size) // 2 * 2
    pose = run.pose + more * rng.standard_normal(run.pose.shape) * [1.0, 1.0, 0.0]
    s = prepare(replace(run, pose=pose[rows])).smoothed
    assert s.noise[:2] == pytest.approx(np.hypot(NOISE[:2], more), rel=0.1)
    assert s.noise[2] == pytest.approx(NOISE[2], rel=0.1)
    assert s.spikes.sum() == 0


@pytest.mark.parametrize("every", [1, 4])
def test_the_noise_is_as_far_off_as_it_is_said_to_be(every):
    rows = np.arange(0, round(SECONDS / H), every)
    off = []
    for seed in range(3):
        s = prepare(replace(sailed(seed).rows(rows), measured={})).smoothed
        off.append(np.log(s.noise / NOISE) / s.noise_rel_std)
    assert 0.3 < np.sqrt(np.mean(np.square(off))) < 2.0


def test_a_noise_is_hardly_known_where_motions_are_quicker_than_samples():
    run, rng = sailed(), np.random.default_rng(4)
    jerks = 0.2 * rng.standard_normal(run.time.size) * (np.sin(0.1 * run.time) > 0.0)
    quick = np.convolve(jerks, np.sin(np.arange(20) * 0.3), "same")
    pose = run.pose + np.outer(quick, [1.0, 1.0, 0.0])
    rows = np.arange(0, run.time.size, 5)
    found = table(replace(run, pose=pose, measured={}).rows(rows))
    assert (found["x"].known, found["x"].noise_at_most) == (False, True)
    assert (found["psi"].known, found["psi"].noise_at_most) == (True, False)


@pytest.mark.parametrize("kurtosis", [0.0, 1.5])
def test_the_chance_of_equal_variances_is_that_of_bartletts_test(kurtosis):
    """By scipy, whose statistic Box divides by 1 + kurtosis / 2."""
    rng = np.random.default_rng(7)
    parts = [s * rng.normal(size=n) for s, n in ((1.0, 5), (1.6, 9), (0.8, 14), (1.2, 4))]
    squares = np.array([np.sum((x - x.mean()) ** 2) for x in parts])
    free = np.array([len(x) - 1.0 for x in parts])
    statistic = stats.bartlett(*parts).statistic / (1.0 + 0.5 * kurtosis)
    expected = stats.chi2.sf(statistic, len(parts) - 1)
    assert 0.05 < expected < 0.9
    assert equal_variances(squares, free, kurtosis) == pytest.approx(expected)


def test_parts_of_one_noise_have_one_variance_by_chance():
    rng = np.random.default_rng(5)
    free = rng.uniform(1.5, 30.0, (400, 25))
    chances = [equal_variances(rng.chisquare(row), row) for row in free]
    assert np.mean(np.array(chances) < 0.05) == pytest.approx(0.05, abs=0.03)
    quick = np.where(np.arange(25) < 5, 3.0, 1.0)
    assert max(equal_variances(quick * rng.chisquare(row), row) for row in free + 30.0) < 0.05
    assert equal_variances(np.ones(1), np.ones(1)) == 1.0


def test_rare_large_errors_in_all_parts_are_one_noise():
    rng, part = np.random.default_rng(6), np.arange(1000) // 40
    found = []
    for _ in range(200):
        squares = rng.logistic(size=part.size) ** 2
        sums, free = np.bincount(part, squares), np.full(25, 40.0)
        found.append(
            (equal_variances(sums, free), equal_variances(sums, free, excess_kurtosis(squares, part)))
        )
    normal, corrected = np.mean(np.array(found) < 0.05, axis=0)
    assert normal > 0.3
    assert corrected < 0.15


def test_files_hold_each_channel_by_its_name():
    run = sailed()
    compared = compare(load([table_of(run), table_of(sailed(1))], anyway=True))  # forces of no ship
    data = file_content(ReportData.of(compared))["data"]
    keys = {
        "rate",
        "held",
        "noise",
        "noise_from",
        "noise_at_most",
        "correlation",
        "latency",
        "outliers",
        "used",
        "why",
    }
    assert set(data["channels"]) == {"x", "y", "psi", "r"}
    for channels in (data["channels"], *(of["channels"] for of in data["runs"])):
        assert all(keys <= set(c) for c in channels.values())
    assert data["channels"]["r"]["used"] is True


@pytest.mark.parametrize(
    ("coordinate", "until", "rounded"), [(0, 400, None), (1, 400, 3), (1, None, None)]
)
def test_a_coordinate_that_is_frozen_alone_is_no_measurement_of_the_place(coordinate, until, rounded):
    run = replace(sailed(), measured={})
    if rounded:
        run = replace(run, pose=np.round(run.pose, rounded), resolution=np.full_like(run.pose, 1e-3))
    pose = np.array(run.pose)
    pose[200:until, coordinate] = pose[200, coordinate]
    whole, part = prepare(run).smoothed, prepare(replace(run, pose=pose)).smoothed
    last = run.time.size if until is None else until
    assert not part.track.fresh[201:last, :2].any()
    assert part.track.fresh[201:last, 2].any()
    name, seconds = "xy"[coordinate], (last - 1 - 200) * H
    assert any(f"{name} is frozen for {seconds:.3g} s" in note for note in part.track.notes)
    assert not any("frozen" in note for note in whole.track.notes)
    used = np.arange(run.time.size) < 200
    assert part.eta[used] == pytest.approx(whole.eta[used], abs=5.0 * NOISE.max())


def test_a_coordinate_that_is_constant_by_the_motion_or_by_rounding_is_measured():
    """A straight leg to the north without noise, then a turn; and steps as large as the ship's motion."""
    run = replace(sailed(), measured={})
    t = run.time
    turned = np.cumsum(np.where(t < 20.0, 0.0, 0.02 * (t - 20.0))) * H
    leg = np.column_stack([0.2 * t, 0.1 * turned, np.arctan2(turned, 20.0)])
    coarse = np.round(leg * 10.0) / 10.0
    for pose, step in ((leg, 0.0), (coarse, 0.1)):
        smoothed = prepare(replace(run, pose=pose, resolution=np.full_like(pose, step))).smoothed
        assert not any("frozen" in note for note in smoothed.track.notes)


def test_a_run_that_is_too_short_by_a_frozen_coordinate_says_so():
    run = sail(120.0, 0.1)[0]
    pose = np.array(run.pose)
    pose[300:, 1] = pose[300, 1]
    with pytest.raises(InputError, match=r"too little data .* y is frozen for 89\.9 s, 30 s from"):
        begin(gather([replace(run, pose=pose)]))


def test_a_speed_that_rises_by_its_rounding_has_the_noise_of_that():
    """The values that are new are on a line, so that their differences show no noise."""
    run, step = sailed(), 0.1 * 1852.0 / 3600.0
    rising = np.round(run.time * 0.05 / step) * step
    found = table(replace(run, measured={**run.measured, "speed": rising}))
    assert found["speed"].noise == pytest.approx(step / 12.0**0.5)
    assert found["r"].noise == pytest.approx(1e-3, rel=0.2)


def over_ground(run):
    """The run with its speed and course as a receiver states them, rounded."""
    vx, vy = (np.gradient(run.pose[:, k], run.time) for k in range(2))
    knot = 1852.0 / 3600.0
    course = np.round(np.degrees(np.arctan2(vy, vx)) % 360.0, 1)
    speed = np.round(np.hypot(vx, vy) / knot, 2) * knot
    return replace(run, measured={"speed": speed, "course": np.radians(course)})


def test_a_course_is_used_with_its_speed():
    found = table(over_ground(sailed()))
    assert found["speed"].used
    assert found["course"].used
    assert not found["course"].why


@pytest.mark.parametrize(("channel", "until"), [("course", None), ("speed", None), ("speed", 800)])
def test_a_channel_that_is_frozen_is_not_used_there_and_shows_no_fault_of_the_others(channel, until):
    """A course that stays for half of a run was taken as a clock that ran at a tenth of its rate."""
    run = over_ground(sailed())
    values = np.array(run.measured[channel])
    values[600:until] = values[600]
    frozen = replace(run, measured={**run.measured, channel: values})
    before, after = (prepare(r).smoothed for r in (run, frozen))
    length = (len(values) if until is None else until) - 601
    line = f"{channel} is constant for {length * H:.3g} s, 60 s from the start"
    assert any(note.startswith(line) for note in after.track.notes)
    assert not any("constant" in note for note in before.track.notes)
    assert [f.channel for f in after.sensors.findings] == [f.channel for f in before.sensors.findings]
    assert after.eta == pytest.approx(before.eta, abs=3.0 * NOISE.max(), nan_ok=True)


def test_a_speed_at_the_quay_is_constant_and_no_fault():
    run = over_ground(sailed())
    pose, speed = np.array(run.pose), np.array(run.measured["speed"])
    noise = NOISE * np.random.default_rng(5).standard_normal((600, 3))
    pose[600:] = pose[600] + noise
    speed[600:] = 0.0
    at_rest = replace(run, pose=pose, measured={"speed": speed})
    assert not any("constant" in note for note in prepare(at_rest).smoothed.track.notes)


def test_positions_without_a_heading_are_reported():
    run = replace(sailed(), measured={})
    pose = np.array(run.pose)
    pose[600:, 2] = pose[600, 2]
    notes = prepare(replace(run, pose=pose)).smoothed.track.notes
    assert any(n.startswith("594 positions have no heading near them, the first 60.6 s") for n in notes)
    assert not any("heading near" in n for n in prepare(run).smoothed.track.notes)
