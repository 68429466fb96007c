"""What a terminal and a notebook show of results: tables and sentences, and never an array."""

from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from support.measured import sail, smoothed

import cosim
import diagnosis
from diagnosis.execution.short_text import ShortRepr
from diagnosis.predictors import weak_windows

HIDDEN = {"delta_X_u": -2.0}
LONGEST = 2000  # letters of any result in a terminal: what a screen holds


@pytest.fixture(scope="module")
def runs():
    return [weak_windows(smoothed(replace(sail(90.0, ship=HIDDEN)[0], name="a")))]


@pytest.fixture(scope="module")
def compared(runs):
    return diagnosis.compare(runs)


def test_a_comparison_prints_the_table_of_the_command(compared, runs):
    text = str(compared)
    assert max(map(len, text.splitlines())) <= 80
    for title in ("Data", "Location of the model error", "Prediction error over 8 s", "Model error"):
        assert f"\n{title}\n" in f"\n{text}"
    error = compared.evaluations[0].before.position
    assert f"{1e3 * error:.0f}" in text.partition("Prediction error")[2]
    assert " in \n" not in text, "no files were written"
    assert repr(diagnosis.evaluate(runs)) == text


def test_a_notebook_shows_a_comparison_with_pictures(compared):
    page = compared._repr_html_()
    assert page.count("<svg") == 2
    assert "Surge" in page
    assert "→" not in page, "there is one model"
    assert "<svg" in compared.plot.track()._repr_svg_()


@pytest.mark.slow
def test_a_calibrated_model_prints_what_the_command_shows(runs):
    quick = diagnosis.calibrate(runs)
    text = str(quick)
    assert text.startswith("Gain of the calibration\n")
    assert "before -> after" in text
    assert "→" in quick._repr_html_()
    assert max(map(len, text.splitlines())) <= 80


def parts(value, seen=()):
    """A result, and all results that it has."""
    yield value
    if is_dataclass(value) and len(seen) < 4:
        for f in fields(value):
            inner = getattr(value, f.name)
            for each in inner if isinstance(inner, list | tuple) else [inner]:
                if is_dataclass(each) and type(each).__module__.startswith("diagnosis"):
                    yield from parts(each, (*seen, value))


@pytest.mark.slow
def test_no_result_prints_an_array(compared, runs, tmp_path):
    found = [*parts(compared), *parts(runs[0]), compared.before, runs[0].run, runs[0].smoothed]
    assert len({type(each) for each in found}) > 8
    result = cosim.simulate("cse1_circle", tmp_path, stop=30.0)
    found += [result, result.trial, cosim.read_log(tmp_path), compared.predictor.model.ship]
    for each in found:
        assert "array(" not in repr(each), type(each)
        assert len(repr(each)) <= LONGEST, type(each)


def test_a_short_text_has_small_values_and_the_size_of_others():
    class Measured(ShortRepr):
        __dataclass_fields__ = diagnosis.WindowErrors.__dataclass_fields__
        run, start, samples = np.zeros((2, 3)), 0.5, ("a", "b")
        position, heading = [np.zeros(2)] * 4, "long" * 100

    shown = "run=<ndarray of 2 x 3>, start=0.5, samples=('a', 'b'), position=<list of 4>, heading=<str of 400>"
    assert repr(Measured()) == f"Measured({shown})"
