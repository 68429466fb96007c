"""What messages repeat of files: short, on one line, without control characters; the first fault of a file."""

import json
from typing import Annotated

import pytest
from pydantic import BaseModel, ConfigDict, Field, ValidationError

import cosim
import diagnosis
from cybership.message_text import (
    LONGEST_FAULT,
    LONGEST_VALUE,
    LONGEST_WORD,
    brief,
    counted,
    printable,
)
from cybership.model_fault import first_fault
from fmucheck.source import BadFileError
from fmus.build import BuildError


class Inner(BaseModel):
    model_config = ConfigDict(extra="forbid")

    size: Annotated[float, Field(gt=0.0)]


class Outer(BaseModel):
    model_config = ConfigDict(extra="forbid")

    parts: list[Inner] = []
    kind: str | int = ""
    shape: dict[str, Inner] | None = None


def fault(content, **options):
    with pytest.raises(ValidationError) as error:
        Outer.model_validate_json(json.dumps(content), strict=True)
    return first_fault(error.value, Outer, **options)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (
            {"parts": [{"size": 1.0}, {"size": 0}]},
            "parts[1].size: Input should be greater than 0; got 0",
        ),
        ({"parts": [{}]}, "parts[0].size: is missing"),
        (
            {"parts": [{"szie": 1.0}]},
            "parts[0].szie: unknown key; did you mean 'size'?",
        ),  # before what it leaves missing
        ({"\x1b[31mred\n": 1}, "\\x1b[31mred: unknown key; there are parts, kind, shape"),
        ({"x" * 100_000: 1}, f"{'x' * 28}...{'x' * 28}: unknown key; there are parts, kind, shape"),
        ({"shape": {"inner": {"sise": 1.0}}}, "shape.inner.sise: unknown key; did you mean 'size'?"),
        ({"shape": {"inner": 1.0}}, "shape.inner: Input should be an object; got 1.0"),
        ([1], "the content: Input should be an object"),
        ({"kind": []}, "kind: is text"),
    ],
)
def test_the_first_fault_says_where_and_what(content, says):
    def special(kind, location, value):
        return "is text" if location[0:1] == ("kind",) else ""

    assert fault(content, special=special) == says


@pytest.mark.parametrize("value", ["x" * 100_000, "x y " * 50_000, "\n\x1b[2J" * 10_000, "{0}" * 50_000])
def test_values_are_cut_and_escaped(value):
    stated = brief(f"'{value}' is no law; there are 'a', 'b'")
    quoted, _, rest = stated[1:].partition("' ")
    assert len(quoted) <= LONGEST_VALUE
    assert rest == "is no law; there are 'a', 'b'"
    assert stated.isprintable()
    unquoted = brief(f"there is no law {value}")
    assert len(unquoted) <= LONGEST_FAULT
    assert unquoted.isprintable()
    assert max(map(len, unquoted.split())) <= LONGEST_VALUE + 4


def test_what_is_short_stays():
    text = "actuator 'port': there is no law 'propeler'; did you mean 'fixed_propeller'?"
    assert brief(text) == printable(text) == text
    assert len(printable("x" * 5000)) == LONGEST_WORD - 1


@pytest.mark.parametrize("error", [cosim.InputError, cosim.SimulationError, BuildError, BadFileError])
def test_messages_of_errors_repeat_no_value_whole(error):
    """To who catches them in Python, too; a path stays whole, and what two apostrophes enclose."""
    path = "/a/folder" * 20
    text = f"'{path}': no unit '{'x y ' * 1000}\x1b[2J\n' of the ship's speed, {'which is long ' * 6}, or the hull's"
    says = str(error(text))
    assert says.isprintable()
    assert says.startswith(f"'{path}': no unit 'x y x y")
    assert says.endswith(text[text.index("of the ship's") :])
    assert len(says) == len(text) - 4000 - len("\x1b[2J\n") + LONGEST_VALUE - 1
    assert str(error(says)) == says


def test_a_missing_measurement_is_compared_with_measurements_only(tmp_path):
    (tmp_path / "here").mkdir()  # such as the folder that the command has just made
    with pytest.raises(cosim.InputError, match=r"run1\.csv'$"):
        diagnosis.read(tmp_path / "run1.csv")
    (tmp_path / "run2.csv").touch()
    with pytest.raises(cosim.InputError, match=r"did you mean 'run2\.csv'\?$"):
        diagnosis.read(tmp_path / "run1.csv")


def test_one_thing_is_no_plural():
    assert [counted(n, "row") for n in range(3)] == ["0 rows", "1 row", "2 rows"]
