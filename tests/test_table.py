"""Tables: way points in a CSV file beside the scenario."""

import json

import pytest
from support.project import ROOT

import cosim
from cosim.errors import InputError
from cosim.system import prepare
from cosim.system.parameter_table import read_table

GOOD = "x, y, u\n5.0, 2.0, 0.06\n\n6.5, 2.0, 0.1\n6.5, -1.0, 0.06\n"


@pytest.fixture
def routed(tmp_path):
    """A function that prepares the shipped scenario with another table and other parameters."""

    def make(table, instance="guidance", stop=2.0, **parameters):
        content = json.loads((ROOT / "scenarios" / "waypoints.json").read_text()) | {"stop": stop}
        content["metrics"] = {}
        content["fmus"]["guidance"]["parameters"] = parameters
        del content["fmus"]["guidance"]["table"]
        content["fmus"][instance]["table"] = "mine.csv"
        if table is not None:
            (tmp_path / "mine.csv").write_bytes(table if isinstance(table, bytes) else table.encode())
        (tmp_path / "waypoints.json").write_text(json.dumps(content))
        return cosim.load_scenario(tmp_path / "waypoints.json")

    return make


def test_columns_become_numbered_parameters(routed):
    system = prepare(routed(GOOD, loop=0.0))
    assert system.warnings == []
    assert {v.name: value for v, value in system.parameters["guidance"]} == {
        "loop": 0.0, "count": 3.0, "u_given": 1.0,
        "x_1": 5.0, "x_2": 6.5, "x_3": 6.5, "y_1": 2.0, "y_2": 2.0, "y_3": -1.0,
        "u_1": 0.06, "u_2": 0.1, "u_3": 0.06,
    }  # fmt: skip


def test_run_goes_to_the_way_points_and_tells_them(routed, tmp_path):
    out = tmp_path / "out"
    cosim.simulate(routed(GOOD, loop=0.0, stop=90.0), out)
    log = cosim.read_log(out, ["guidance.x_t", "guidance.y_t"])
    assert (log["guidance.x_t"][0], log["guidance.y_t"][0]) == pytest.approx((5.0, 2.0))
    assert (log["guidance.x_t"][-1], log["guidance.y_t"][-1]) == pytest.approx((6.5, -1.0))
    # The scenario as it ran needs no table.
    ran = json.loads((out / "log.json").read_text())["scenario"]
    assert ran["fmus"]["guidance"]["table"] is None
    assert ran["fmus"]["guidance"]["parameters"]["y_3"] == -1.0
    assert prepare(cosim.load_scenario(ran)).parameters.keys() == {*ran["fmus"]}


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (None, "no such table: "),
        ("", "needs a line of names and lines of numbers"),
        ("x,y\n", "needs a line of names and lines of numbers"),
        ("x,y\n1,2\n3,\n", "line 3: 'y' = '' is not a number"),
        ("x,y\n1,2\n\n3,north\n", "line 4: 'y' = 'north' is not a number"),
        ("x,y\n1,2\n3,nan\n", "line 3: 'y' = 'nan' is not a number"),
        ("x,y\n1,2\n3,1_0\n", "line 3: 'y' = '1_0' is not a number"),
        ("x,y\n1,2\n3\n", "line 3 has 1 cells, not 2"),
        ("x,y,x\n1,2,3\n", "the column 'x' occurs twice"),
        ("x;y\n1;2\n3;4\n", "line 2: 'x;y' = '1;2' is not a number"),
        ('x,"y\nz"\n1,2\n', r"the FMU takes no column 'y\nz'"),
        ("x,y,ps\n1,2,0\n3,4,0\n", "the FMU takes no column 'ps'; did you mean 'psi'?"),
        ("x,u\n1,0.1\n3,0.1\n", "the column 'y' is missing"),
        ("x,y\n" + "".join(f"{k},2\n" for k in range(21)), "has 21 rows; allowed are 2 to 20"),
        ("x,y\n1,2\n\n1,2\n3,4\n", "line 4 repeats line 2"),
        ("x,y\n1,2\n", "has 1 row; allowed are 2 to 20"),
        ("x,y,u\n1,2,0.1\n3,4,-0.1\n", "guidance.u_2 = -0.1 is below its minimum"),
        (b"\xff\xfex,y", "cannot be read as a table"),
    ],
)
def test_wrong_table_is_refused_with_one_line(routed, table, message):
    with pytest.raises(InputError) as error:
        prepare(routed(table))
    assert message in str(error.value)
    assert "mine.csv" in str(error.value)
    assert "\n" not in str(error.value)


def test_table_has_the_name_of_a_csv_file(routed):
    content = routed(GOOD).model_dump(mode="json", by_alias=True)
    content["fmus"]["guidance"]["table"] = "mine\n.txt"
    with pytest.raises(InputError, match=r"fmus\.guidance\.table: .* is not the name of a \.csv file"):
        cosim.load_scenario(content)


def test_value_given_twice_is_refused(routed):
    with pytest.raises(InputError, match="guidance: y_2 is given twice"):
        prepare(routed(GOOD, y_2=1.0))


def test_fmu_that_takes_no_table_is_refused(routed):
    with pytest.raises(InputError, match=r"fmus\.vessel\.table .* takes no table"):
        prepare(routed(GOOD, "vessel"))


def test_missing_table_suggests_the_nearest_file(tmp_path):
    (tmp_path / "route.csv").write_text(GOOD)
    with pytest.raises(InputError, match=r"did you mean 'route\.csv'"):
        read_table(tmp_path / "rout.csv")


def test_byte_order_mark_and_windows_line_ends_are_read(tmp_path):
    path = tmp_path / "windows.csv"
    path.write_bytes("\ufeffx,y\r\n1,2\r\n3,4e-1\r\n".encode())
    assert read_table(path) == {"x": [1.0, 3.0], "y": [2.0, 0.4]}
