"""Values as texts of other formats: XML Schema reads them to the bit."""

import math
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.formats.elements import type_name, value_text


def variable(kind):
    return SimpleNamespace(type=kind)


@given(st.floats(allow_nan=False))
def test_a_real_is_read_to_the_bit(value):
    text = value_text(variable("Real"), value)
    assert float(text) == value
    assert math.copysign(1.0, float(text)) == math.copysign(1.0, value)


def test_an_integer_for_a_real_is_written_as_a_real():
    assert value_text(variable("Real"), 3) == "3.0"


@pytest.mark.parametrize(
    ("value", "text"), [(True, "true"), (False, "false"), (1, "true"), (0, "false")]
)
def test_a_boolean_is_a_word_of_xml(value, text):
    assert value_text(variable("Boolean"), value) == text


@pytest.mark.parametrize(
    ("kind", "value", "text"),
    [("Integer", -7, "-7"), ("Enumeration", 2, "2"), ("String", "true", "true")],
)
def test_all_others_are_as_they_are(kind, value, text):
    assert value_text(variable(kind), value) == text


@pytest.mark.parametrize(
    ("kind", "other"), [("Enumeration", "Integer"), ("Real", "Real"), ("String", "String")]
)
def test_only_an_enumeration_has_another_type_elsewhere(kind, other):
    assert type_name(variable(kind)) == other
