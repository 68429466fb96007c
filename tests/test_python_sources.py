"""What the functions in Python take: runs as files, results and tables; settings of a run."""

import json

import numpy as np
import pandas as pd
import pytest
from support.measured import sail

import cosim
import diagnosis


@pytest.fixture(scope="module")
def run():
    return sail()[0]


def table(run, **renamed):
    """The run as a table in SI."""
    columns = dict(zip(("x", "y", "psi"), run.pose.T, strict=True)) | {"time": run.time}
    columns |= dict(zip(("tau_X", "tau_Y", "tau_N"), run.tau_cmd.T, strict=True))
    return pd.DataFrame(columns).rename(columns=renamed)


def test_a_table_is_the_measurement_that_its_file_is(run, tmp_path):
    frame = table(run)
    frame.to_csv(tmp_path / "run.csv", index=False)
    (from_file,) = diagnosis.load(tmp_path / "run.csv")
    (from_table,) = diagnosis.load(frame)
    assert np.array_equal(from_file.run.pose, from_table.run.pose)
    assert np.array_equal(from_file.run.tau_cmd, from_table.run.tau_cmd)


def test_units_stand_in_the_names_of_columns_or_in_attrs(run, tmp_path):
    named = table(run, x="x [mm]", psi="psi (°)").assign(
        **{"x [mm]": 1e3 * run.pose[:, 0], "psi (°)": np.degrees(run.pose[:, 2])}
    )
    given = table(run).assign(x=1e2 * run.pose[:, 0])
    given.attrs["units"] = {"x": "cm", "y": "m", "of_nothing": "furlong"}
    named.to_csv(tmp_path / "named.csv", index=False)
    for source in (named, given, tmp_path / "named.csv"):
        (found,) = diagnosis.load(source)
        np.testing.assert_allclose(found.run.pose, run.pose, rtol=1e-9, atol=1e-12)
    with pytest.raises(diagnosis.InputError, match="'furlong' is not a unit of y; there are m, mm"):
        diagnosis.load(table(run, y="y [furlong]"))


def test_units_in_the_names_of_columns_count_beside_a_side_car_that_has_others(run, tmp_path):
    named = table(run, x="x [mm]", psi="heading").assign(**{"x [mm]": 1e3 * run.pose[:, 0]})
    named.to_csv(tmp_path / "run.csv", index=False)
    (tmp_path / "run.csv.json").write_text('{"columns": {"psi": "heading"}}')
    (found,) = diagnosis.load(tmp_path / "run.csv")
    np.testing.assert_allclose(found.run.pose, run.pose, rtol=1e-9, atol=1e-12)
    # What the side-car says of a column itself stands.
    stated = '{"columns": {"psi": "heading", "x": {"name": "x [mm]", "factor": 0.002}}}'
    (tmp_path / "run.csv.json").write_text(stated)
    (found,) = diagnosis.load(tmp_path / "run.csv")
    np.testing.assert_allclose(found.run.pose[:, 0], 2.0 * run.pose[:, 0], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("sources", "said"),
    [([], "there is no run"), (3, "not of type int"), ([None], "not of type NoneType")],
)
def test_what_is_no_run_is_told_in_one_line(sources, said):
    with pytest.raises(diagnosis.InputError, match=said):
        diagnosis.load(sources)


def test_what_is_shown_is_a_line(run):
    (loaded,) = diagnosis.load(table(run))
    assert repr([loaded]) == f"[{loaded}]"
    assert str(loaded).startswith(f"<run table 1: {run.time.size} samples in 63.98 s, ")
    model = diagnosis.Model().plus({"delta_X_u": -2.0, "bow_outage_start_1@a": 3.0})
    assert str(model) == "<model: vessel.delta_X_u = -2; values of a>"
    assert str(diagnosis.Model()) == "<model: nominal>"


def test_options_of_the_command_are_those_of_the_function(tmp_path):
    notes = []
    out = tmp_path / "out"
    short = cosim.simulate("ellipse", stop=3.0, log="compact", out=out, show=notes.append)
    assert (short.metrics["from"], short.metrics["to"]) == (0.0, 3.0)
    assert str(short).startswith(f"<run done: 301 rows in '{out}', e_pos_rms = ")
    assert any("metrics are from 0 s on" in note for note in notes)
    with pytest.raises(cosim.InputError, match=r"vessel\.m cannot be nan"):
        cosim.simulate("ellipse", set={"vessel.m": float("nan")})
    with pytest.raises(cosim.InputError, match=r"no such parameter set: '/nowhere/model\.ssv'"):
        cosim.simulate("ellipse", parameters="/nowhere/model.ssv")


def test_shipped_parameter_sets_are_known_by_name(tmp_path):
    for name in ("sysid4", "sysid4.ssv"):
        run = cosim.simulate("ellipse", stop=0.5, parameters=name, out=tmp_path / "out")
        stated = json.loads((run.folder / "log.json").read_text())["scenario"]["fmus"]["vessel"][
            "parameters"
        ]
        assert any(name.startswith("delta_") for name in stated)
    with pytest.raises(cosim.InputError, match="did you mean 'sysid4'"):
        cosim.simulate("ellipse", parameters="sysid_4.ssv")


def test_misspelt_key_is_told_before_the_one_that_is_missing():
    with pytest.raises(cosim.InputError, match="axis: unknown key; did you mean 'axes'"):
        cosim.run_campaign({"scenario": "ellipse", "axis": {}})
    with pytest.raises(cosim.InputError, match="stopp: unknown key; did you mean 'stop'"):
        cosim.load_scenario({"name": "s", "step": 0.1, "stopp": 1.0, "fmus": {"a": {"path": "b.fmu"}}})
