"""The contract of a fingerprint: a course in units of its largest sizes, and its correlation with others."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import InputError
from diagnosis import Run
from diagnosis.runs.fingerprint import (
    POINTS,
    Fingerprint,
    _correlation,
    fingerprints,
    samples_sha256,
)
from diagnosis.runs.run_constants import IN_A_ROW, PARTS


def swings(time, seed):
    """A smooth motion (n, 3) that does not repeat."""
    rng = np.random.default_rng(seed)
    frequency, phase = rng.uniform(0.1, 1.5, (2, 3, 6)) * [[[1.0]], [[4.0]]]
    return np.sin(time[:, None, None] * frequency + phase).sum(axis=2)


def smoothed(time, nu, std=0.01, **of_run):
    columns = {"pose": np.zeros((time.size, 3)), "tau_cmd": np.zeros((time.size, 3))} | of_run
    return SimpleNamespace(
        track=SimpleNamespace(run=Run("made", time, **columns)), nu=nu, nu_std=np.full_like(nu, std)
    )


def course(time, nu, std=0.01):
    return Fingerprint("made", "", float(time[1] - time[0]), nu, np.full(3, std))


def test_a_course_has_its_largest_size_as_unit_and_its_noise_in_that():
    time = np.linspace(3.0, 80.0, 4000)
    nu = swings(time, 1) * [2.0, 0.05, 1e-3]
    found = Fingerprint.of(smoothed(time, nu, 0.01))
    assert np.abs(found.course).max(axis=0) == pytest.approx([1.0] * 3)
    sizes = np.abs(nu).max(axis=0)
    assert found.certain == pytest.approx(0.01 / sizes, rel=1e-2)
    assert found.period == pytest.approx(77.0 / POINTS)
    at = time[0] + found.period * np.arange(len(found.course))
    assert len(found.course) == POINTS
    assert found.course * sizes == pytest.approx(
        swings(at, 1) * [2.0, 0.05, 1e-3], abs=2e-3 * sizes.max()
    )


def test_a_course_is_no_finer_than_the_samples_and_leaves_out_what_is_not_known():
    time = np.arange(0.0, 100.0, 0.5)
    nu = swings(time, 2)
    nu[:40] = np.nan
    found = Fingerprint.of(smoothed(time, nu))
    assert found.period == pytest.approx(0.5)
    assert np.isfinite(found.course).all()
    assert found.seconds == pytest.approx(time[-2] - time[40])
    assert found.certain == pytest.approx(0.01 / np.nanmax(np.abs(nu), axis=0), rel=1e-2)
    still = Fingerprint.of(smoothed(time, 0.0 * swings(time, 2)))
    assert (still.course == 0.0).all()


def test_the_hash_is_of_the_file_or_of_all_that_was_sampled():
    time = np.arange(0.0, 50.0, 0.5)
    run = smoothed(time, swings(time, 3))
    assert Fingerprint.of(run).sha256 == samples_sha256(run)
    named = smoothed(time, swings(time, 3), hashes={Path("a.csv"): "abc", Path("a.json"): "def"})
    assert Fingerprint.of(named).sha256 == "abc"
    each = {samples_sha256(run)}
    one = np.zeros((time.size, 3))
    one[7, 1] = 1e-9
    each |= {samples_sha256(smoothed(time, run.nu, **{name: one})) for name in ("pose", "tau_cmd")}
    each.add(samples_sha256(smoothed(time + 1e-9, run.nu)))
    assert len(each) == 4


def test_what_json_holds_is_read_again_to_half_a_step():
    time = np.arange(0.0, 60.0, 0.25)
    before = Fingerprint.of(smoothed(time, swings(time, 4)))
    after = Fingerprint.read(before.content())
    assert np.abs(after.course - before.course).max() <= 0.5 / 127.0 + 1e-12
    assert after.certain == pytest.approx(before.certain, rel=5e-3)
    assert (after.name, after.sha256, after.period) == (before.name, before.sha256, before.period)
    assert after.course.shape == before.course.shape


@pytest.mark.parametrize(
    "damage",
    [
        {"course": "?"},
        {"certain": [1.0]},
        {"certain": "x"},
        {"period": "x"},
        {"course": "AAA="},
        {"name": ...},
    ],
)
def test_a_damaged_list_is_refused_with_its_file(damage):
    time = np.arange(0.0, 60.0, 0.25)
    stated = Fingerprint.of(smoothed(time, swings(time, 4))).content() | damage
    if damage == {"name": ...}:
        del stated["name"]
    with pytest.raises(InputError, match=r"'model\.json': its list of training runs is damaged"):
        fingerprints([stated], Path("model.json"))
    assert fingerprints([], Path("model.json")) == ()


def brute(piece, course, moving):
    """Largest mean of the absolute correlations of the columns that move, part by part."""
    m = len(piece)
    parts = [course[k : k + m] for k in range(len(course) - m + 1)]
    each = [
        [abs(np.corrcoef(piece[:, j], part[:, j])[0, 1]) for j in range(3) if moving[j]]
        for part in parts
    ]
    return max(map(np.mean, each))


@settings(max_examples=5, deadline=None)
@given(st.integers(0, 1000), st.integers(8, 16), st.lists(st.booleans(), min_size=3, max_size=3))
def test_the_correlation_is_that_of_the_columns_that_move_at_the_best_place(seed, m, moving):
    """A column moves if it varies by more than three standard deviations."""
    rng = np.random.default_rng(seed)
    piece, longer = rng.standard_normal((m, 3)), rng.standard_normal((24, 3))
    std = np.std(piece, axis=0)
    certain = np.where(moving, 0.99, 1.01) * std / 3.0
    found = _correlation(piece, longer, certain)
    if not any(moving):
        assert np.isnan(found)
    else:
        assert found == pytest.approx(brute(piece, longer, moving))


def test_size_sign_and_offset_do_not_matter_and_a_still_part_has_no_correlation():
    rng = np.random.default_rng(3)
    longer = rng.standard_normal((60, 3))
    piece = longer[20:40]
    assert _correlation([2.0, -3.0, 0.1] * piece + 4.0, longer, np.zeros(3)) == pytest.approx(1.0)
    assert _correlation(piece, np.ones((60, 3)), np.zeros(3)) == 0.0
    assert _correlation(piece, piece, np.zeros(3)) == pytest.approx(1.0), "as long as the piece"


def test_most_pieces_of_the_shorter_run_are_found_in_the_longer():
    """Also shifted by a part of a period, in either order, and where one piece of four differs."""
    time = np.arange(0.0, 100.0, 0.2)
    whole = course(time, swings(time, 5))
    late = time[:200] + 31.1
    part = course(late, swings(late, 5))
    other = course(late, swings(late, 6))
    assert without_hash(whole).alike(without_hash(part, "b"))
    assert without_hash(part).alike(without_hash(whole, "b"))
    assert not without_hash(other).alike(without_hash(whole, "b"))
    parts = np.arange(200) * PARTS // 200
    for wrong, same in ((1, True), (3, False)):
        mixed = np.where((parts < wrong)[:, None], swings(late, 7), swings(late, 5))
        assert without_hash(course(late, mixed)).alike(without_hash(whole, "b")) is same


def without_hash(f, sha256="a"):
    return Fingerprint(f.name, sha256, f.period, f.course, f.certain)


def test_runs_are_one_by_their_hash_alone_and_never_by_rest_or_too_few_points():
    time = np.arange(0.0, 100.0, 0.2)
    moving, still = course(time, swings(time, 5)), course(time, np.zeros((time.size, 3)))
    assert moving.alike(course(time, swings(time, 8))), "the same hash"
    assert not without_hash(still).alike(without_hash(still, "b"))
    for points, same in ((PARTS * (IN_A_ROW - 1), False), (PARTS * (IN_A_ROW + 2), True)):
        few = without_hash(course(time[:points], swings(time[:points], 5)))
        assert few.alike(without_hash(moving, "b")) is same
