"""Values on their way into an FMU: units, start values, their types and limits, and bindings of SSP."""

import math
from itertools import product
from pathlib import PurePosixPath
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from cosim import InputError, Unit
from cosim.conversion import SAME, Conversion, conversion
from cosim.dispatch.places import check_address, check_workers
from cosim.export.portable import _is_start
from cosim.fmu.fmu_model import INT_LIMIT, FmuModel, FmuVariable
from cosim.formats.bindings import Bindings, file_inside, is_unit_kept, linear
from cosim.formats.documents import start_value
from cosim.formats.namespaces import SSM, SSP_SPACES
from cosim.system.start_values import check_value

LENGTH, ANGLE = (0, 1, 0, 0, 0, 0, 0), (0,) * 7
TINY = 1e-300  # products of smaller numbers have fewer digits
factors = st.floats(1e-6, 1e6)
offsets = st.floats(-1e3, 1e3)
units = st.builds(lambda f, o, n: Unit(n, LENGTH, f, o), factors, offsets, st.sampled_from("abc"))


# Units


@given(units, units, st.floats(-1e3, 1e3))
def test_a_converted_value_is_the_same_quantity(a, b, x):
    """In SI it is factor * value + offset, whichever of the two units it is stated in."""
    found = conversion(a, b, "x")
    in_si = a.factor * x + a.offset
    size = abs(a.factor * x) + abs(a.offset) + abs(b.offset)
    assert b.factor * (found.factor * x + found.offset) + b.offset == pytest.approx(
        in_si, abs=1e-9 * size + TINY
    )
    there, back = found, conversion(b, a, "x")
    again = back.factor * (there.factor * x + there.offset) + back.offset
    assert again == pytest.approx(x, abs=1e-9 * size / a.factor + TINY)


def test_what_is_not_known_of_units_is_not_converted():
    metre, foot = Unit("m", LENGTH), Unit("ft", LENGTH, 0.3048)
    assert conversion(None, foot, "x") is SAME
    assert conversion(foot, None, "x") is SAME
    assert conversion(foot, Unit("ft", LENGTH, 0.3048), "x") is SAME
    assert conversion(foot, metre, "x") == Conversion(0.3048, 0.0)
    for a, b in ((Unit("ell"), metre), (metre, Unit("ell")), (Unit("ft", LENGTH, math.nan), metre)):
        assert conversion(a, b, "x") is None
        assert (
            conversion(a, Unit(a.name, LENGTH, 7.0) if a.exponents is None else Unit(a.name), "x")
            is SAME
        )
    with pytest.raises(InputError, match="a to b: unit 'm' cannot be converted to 'deg'"):
        conversion(metre, Unit("deg", ANGLE, 0.0175), "a to b")


# Types and limits


def variable(kind="Real", start=None, low=None, high=None):
    return FmuVariable("v", kind, 0, "parameter", "tunable", None, "", low, high, start)


VALUES = ["text", "", True, False, 0, 1, 2, -INT_LIMIT, INT_LIMIT, INT_LIMIT - 1, 0.0, 0.5, 1.0, None]
# Whether a value is one of a type, by the type of Python that FMI's types become.
FITS = {
    "String": lambda x: type(x) is str,
    "Boolean": lambda x: type(x) is bool or x in (0, 1),
    "Real": lambda x: type(x) in (int, float),
    "Integer": lambda x: type(x) is int and -INT_LIMIT < x < INT_LIMIT,
    "Enumeration": lambda x: type(x) is int and -INT_LIMIT < x < INT_LIMIT,
}


@pytest.mark.parametrize("kind", FITS)
def test_a_value_is_of_the_type_of_its_variable(kind):
    for value in VALUES:
        if FITS[kind](value):
            check_value(variable(kind), value, "a.v")
        else:
            with pytest.raises(InputError, match=f"needs a value of type {kind}"):
                check_value(variable(kind), value, "a.v")


@given(st.floats(-10.0, 10.0), st.none() | st.floats(-10.0, 10.0), st.none() | st.floats(-10.0, 10.0))
def test_a_value_lies_within_its_limits_ends_included(value, low, high):
    v = variable(low=low, high=high)
    if low is not None and value < low:
        with pytest.raises(InputError, match="below its minimum"):
            check_value(v, value, "a.v")
    elif high is not None and value > high:
        with pytest.raises(InputError, match="above its maximum"):
            check_value(v, value, "a.v")
    else:
        check_value(v, value, "a.v")
    for end in (low, high):
        if end is not None and (low is None or high is None or low <= high):
            check_value(v, end, "a.v")
    check_value(variable("Boolean", low=2.0), True, "a.v")  # a flag has no size


@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(-1e9, 1e9))
def test_a_value_is_the_start_value_that_the_fmu_states(start, other):
    assume(start != other)
    real = variable(start=repr(start))
    assert _is_start(real, start)
    assert not _is_start(real, other)
    assert not _is_start(variable(), start)


def test_states_that_can_be_set_are_locals_and_outputs_with_an_exact_start_that_may_change():
    """FMI 2.0, 2.2.7."""
    kinds = product(
        ("exact", "approx", "calculated", None),
        ("constant", "fixed", "discrete", "continuous", None),
        ("local", "output", "input", "parameter", None),
    )
    names = ("initial", "variability", "causality")
    listed = [SimpleNamespace(name=str(kind), **dict(zip(names, kind, strict=True))) for kind in kinds]
    model = SimpleNamespace(description=SimpleNamespace(modelVariables=listed))
    expected = {
        str(("exact", variability, causality))
        for variability in ("fixed", "discrete", "continuous", None)
        for causality in ("local", "output", None)
    }
    assert FmuModel.exact.func(model) == expected


@pytest.mark.parametrize(
    ("kind", "start", "value", "same"),
    [
        ("String", "a", "a", True),
        ("String", "1", "a", False),
        ("Boolean", "true", True, True),
        ("Boolean", "1", 1, True),
        ("Boolean", "false", 0, True),
        ("Boolean", "0", True, False),
        ("Integer", "3", 3, True),
        ("Integer", "3", 4, False),
    ],
)
def test_start_values_of_every_type_are_compared_as_that_type(kind, start, value, same):
    assert _is_start(variable(kind, start), value) == same


def test_a_start_value_of_a_document_is_of_the_type_of_its_element():
    def of(kind, text):
        return start_value(ElementTree.fromstring(f'<x:{kind} xmlns:x="y" value="{text}"/>'), "p")

    found = [
        of("Real", "1.5e1"),
        of("Integer", "7"),
        of("Boolean", "1"),
        of("Boolean", "false"),
        of("String", "1"),
    ]
    assert found == [15.0, 7, True, False, "1"]
    assert [type(x) for x in found] == [float, int, bool, bool, str]
    for kind, text, stated in (
        ("Real", "one", "p = 'one' is not a number"),
        ("Real", "1e999", "is not a number"),
        ("Integer", "1.5", "p = '1.5' is not a whole number"),
        ("Boolean", "yes", "is neither true nor false"),
        ("Binary", "00", "values of type Binary are not supported"),
    ):
        with pytest.raises(InputError, match=stated):
            of(kind, text)


# Bindings


class Archive(dict):
    def read(self, name):
        return self[name].encode()


SPACES = " ".join(f'xmlns:{k}="{v}"' for k, v in (SSP_SPACES | {"ssm": SSM}).items())
SET = f"""<ssv:ParameterSet {SPACES} version="1.0" name="s"><ssv:Parameters>%s</ssv:Parameters></ssv:ParameterSet>"""


def real(name, value, unit=""):
    return f'<ssv:Parameter name="{name}"><ssv:Real value="{value}"{unit}/></ssv:Parameter>'


def read(bindings, files=(), notes=None):
    owner = f"<ssd:Component {SPACES}><ssd:ParameterBindings>{bindings}</ssd:ParameterBindings></ssd:Component>"
    reader = Bindings(Archive(files), [] if notes is None else notes)
    return reader.read(ElementTree.fromstring(owner), "ship")


def inline(values, mapping="", attributes=""):
    return (
        f"<ssd:ParameterBinding {attributes}><ssd:ParameterValues>{SET % values}</ssd:ParameterValues>"
        f"{mapping}</ssd:ParameterBinding>"
    )


def mapped(*entries):
    return f"<ssd:ParameterMapping><ssm:ParameterMapping>{''.join(entries)}</ssm:ParameterMapping></ssd:ParameterMapping>"


def test_values_have_their_prefix_unit_and_place_and_the_last_one_counts():
    first = inline(real("m", 2.0, ' unit="kg"') + real("c", 1.0), attributes='prefix="hull."')
    found = read(first + inline(real("hull.c", 3.0)))
    assert {n: (b.value, b.unit) for n, b in found.items()} == {
        "hull.m": (2.0, "kg"),
        "hull.c": (3.0, None),
    }
    assert {b.where for b in found.values()} == {"ship"}
    by_file = read('<ssd:ParameterBinding source="values.ssv"/>', {"values.ssv": SET % real("m", 4.0)})
    assert by_file["m"].value == 4.0


def test_a_mapping_renames_scales_and_may_keep_the_unit():
    linear_entry = '<ssm:MappingEntry source="a" target="x"><ssc:LinearTransformation factor="2" offset="-1"/></ssm:MappingEntry>'
    plain = '<ssm:MappingEntry source="b" target="y" suppressUnitConversion="true"/>'
    lost = '<ssm:MappingEntry source="bb" target="z"/>'
    notes = []
    values = real("a", 5.0, ' unit="m"') + real("b", 7.0, ' unit="m"')
    found = read(inline(values, mapped(linear_entry, plain, lost)), notes=notes)
    assert {n: (b.value, b.unit) for n, b in found.items()} == {"x": (9.0, "m"), "y": (7.0, None)}
    assert len(notes) == 1
    assert notes[0].startswith("ship: no parameter 'bb' exists to map to 'z'; did you mean 'b'")
    text = '<ssv:Parameter name="a"><ssv:String value="s"/></ssv:Parameter>'
    with pytest.raises(InputError, match="a LinearTransformation needs a number, not 's'"):
        read(inline(text, mapped(linear_entry)))


@pytest.mark.parametrize(
    ("bindings", "stated"),
    [
        ('<ssd:ParameterBinding type="text/csv"/>', "this kind of parameter binding is not supported"),
        (
            '<ssd:ParameterBinding sourceBase="component"/>',
            "this kind of parameter binding is not supported",
        ),
        ("<ssd:ParameterBinding/>", "ship: a parameter binding without values"),
        (inline('<ssv:Parameter name="m"/>'), "the parameter 'm' has no value"),
    ],
)
def test_bindings_that_cannot_be_read_are_refused(bindings, stated):
    with pytest.raises(InputError, match=stated):
        read(bindings)


def test_a_transformation_is_linear_or_none():
    def of(inner):
        return linear(
            ElementTree.fromstring(f"<ssd:Connection {SPACES}>{inner}</ssd:Connection>"), "a to b"
        )

    assert of("") is None
    assert of('<ssc:LinearTransformation factor="3"/>') == Conversion(3.0, 0.0)
    assert of('<ssc:LinearTransformation offset="3"/>') == Conversion(1.0, 3.0)
    with pytest.raises(InputError, match="a to b: BooleanMappingTransformation is not supported"):
        of("<ssc:BooleanMappingTransformation/>")
    with pytest.raises(InputError, match="a to b: factor = 'x' is not a number"):
        of('<ssc:LinearTransformation factor="x"/>')
    kept = [
        is_unit_kept(ElementTree.fromstring(f'<c suppressUnitConversion="{x}"/>'))
        for x in ("true", "1", "0", "false")
    ]
    assert kept == [True, True, False, False]
    assert not is_unit_kept(ElementTree.fromstring("<c/>"))
    assert PurePosixPath(file_inside("a%20b/c.ssv", "x")) == PurePosixPath("a b/c.ssv")


# Where runs are made


@pytest.mark.parametrize(
    "address", ["tcp://localhost:8786", "tls://10.0.0.1:1", "ucx://[::1]:12345", None]
)
def test_addresses_of_schedulers(address):
    check_address(address)


@pytest.mark.parametrize(
    "address",
    ["localhost:8786", "tcp://localhost", "tcp://a:123456", "http://a:80", "tcp://a:8786/x", ""],
)
def test_what_is_no_address_of_a_scheduler(address):
    with pytest.raises(InputError, match="tcp://HOST:PORT"):
        check_address(address)


def test_a_number_of_workers_is_zero_or_more():
    for workers in (None, 0, 1, 64):
        check_workers(workers)
    with pytest.raises(InputError, match="workers = -1"):
        check_workers(-1)
