"""Inputs that files give: rows that hold, cells that are empty, and what is refused."""

import math

import pytest

import cosim
from cosim.system import prepare
from cosim.system.recordings import Recorded, read_recording

TABLE = "time,a,b\n0.0,1.5,\n0.02,nan,2.0\n0.05,-3.0,\n"


def played(recorded, times, start=7.0):
    effect, found = recorded.bind([0, 1]), []
    for t in times:
        values = [start, start]
        effect(values, t)
        found.append(tuple(values))
    return found


def test_rows_hold_and_empty_cells_leave_what_is_there(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text(TABLE)
    time, columns = read_recording(path, {"b": None, "a": None})
    assert list(columns) == ["b", "a"]
    found = played(Recorded(["i.b", "i.a"], time, list(zip(*columns.values(), strict=True))), TIMES)
    assert found[0] == found[1] == (7.0, 1.5)
    assert found[2][0] == 2.0
    assert math.isnan(found[2][1])
    assert found[3:] == [(7.0, -3.0), (7.0, -3.0)]


# Rounding of a time does not move it to the row before.
TIMES = (0.0, 0.01, 0.02 - 1e-12, 0.05, 9.0)


def recording(chain, tmp_path, **inputs):
    """The ramp and the gain, with the gain's input from a file."""
    (tmp_path / "run.csv").write_text(TABLE)
    entry = {"path": str(tmp_path / "run.csv"), "inputs": inputs}
    return chain | {"recordings": [entry]}


def gain_of(chain):
    """Instance and input of the connection of the chain."""
    return chain["connections"][0][1]


def test_recorded_input_beats_its_connection_where_there_is_a_value(chain, tmp_path):
    name, chain = gain_of(chain), chain | {"step": 0.01, "stop": 0.1}
    plain = cosim.read_log(cosim.simulate(cosim.load_scenario(dict(chain)), tmp_path / "a").folder)
    content = recording(chain, tmp_path, **{name: "b"})
    found = cosim.read_log(cosim.simulate(cosim.load_scenario(content), tmp_path / "b").folder)
    inside = (found["time"] > 0.0201) & (found["time"] < 0.0501)  # a row has the inputs of its last step
    assert found[name][inside].tolist() == [2.0, 2.0, 2.0]
    assert (found[name][~inside] == plain[name][~inside]).all()


@pytest.mark.parametrize(
    ("inputs", "stated"),
    [
        ({"nobody.x": "a"}, "no instance 'nobody'"),
        ({"INPUT": "c"}, "no column 'c'"),
        ({"OUTPUT": "a"}, "not an input"),
    ],
)
def test_bad_recordings_are_refused(chain, tmp_path, inputs, stated):
    source, target = chain["connections"][0]
    named = {k.replace("INPUT", target).replace("OUTPUT", source): c for k, c in inputs.items()}
    with pytest.raises(cosim.InputError, match=stated):
        prepare(cosim.load_scenario(recording(chain, tmp_path, **named)))


def test_columns_of_one_name_are_refused(tmp_path):
    path = tmp_path / "run.csv"
    path.write_text("time,a,a\n0,1,2\n1,1,2\n")
    with pytest.raises(cosim.InputError, match="has 2 columns 'a'"):
        read_recording(path, {"a": None})


@pytest.mark.parametrize(
    "text", ["", "time,a\n", "time,a\n0,1\n0,2\n", "time,a\n0,x\n", "time,a\n0\n", "time,a\nnan,1\n"]
)
def test_files_that_are_no_recordings_are_refused(tmp_path, text):
    path = tmp_path / "run.csv"
    path.write_text(text)
    with pytest.raises(cosim.InputError):
        read_recording(path, {"a": None})
