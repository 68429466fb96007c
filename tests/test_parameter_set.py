"""A model as a parameter set: written, read, run with, and baked into FMUs."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssv
from fmpy.validation import validate_fmu
from hypothesis import given, settings
from hypothesis import strategies as st
from support.command import command as in_this_process
from support.cosim_run import SSV, command, parameter
from support.opened import Opened
from support.own_effects import GOOD, OWN
from support.project import ROOT

import cosim
from cosim import InputError, Parameter, ParameterSet, read_parameters, write_parameters
from diagnosis.predictors import Model, read_model, write_model
from diagnosis.runs import Fingerprint
from fmus.build import build
from fmus.build.__main__ import main as build_main
from fmus.build.start_values_file import read_starts

LEARNED = Model({"delta_X_u": -4.123456789012345, "V_n": 0.05}, {"loss_bow": 0.3}, {"clock_offset": 0.2})


@pytest.fixture
def learned(tmp_path):
    """The file of a model with effects in vessel and thrusters."""
    write_model(tmp_path / "model.ssv", LEARNED)
    return tmp_path / "model.ssv"


finite = st.floats(-1e300, 1e300)


@settings(max_examples=30)
@given(st.dictionaries(st.sampled_from(["delta_X_u", "F_n", "curve_X_u_7", "X_uuu"]), finite), finite)
def test_a_model_comes_back_to_the_last_digit(tmp_path_factory, vessel, clock):
    path = tmp_path_factory.mktemp("ssv") / "model.ssv"
    write_model(path, Model(vessel, {"lag": 0.1 + 0.2}, {"clock_offset": clock}))
    found = read_model(path)
    nominal = {"delta_X_u": 0.0, "F_n": 0.0, "curve_X_u_7": 0.0, "X_uuu": -3.787}
    assert found.vessel == {k: v for k, v in vessel.items() if v != nominal[k]}
    assert (found.thrusters, found.clock) == ({"lag": 0.1 + 0.2}, clock)


def test_a_path_may_be_a_text_and_its_folder_is_made(tmp_path):
    name = f"{tmp_path}/new/folder/model.ssv"
    write_model(name, LEARNED)
    assert read_model(name).vessel == LEARNED.vessel
    assert read_parameters(name).values["vessel"].keys() == LEARNED.vessel.keys()


RUN = Fingerprint("a", 64 * "0", 0.1, np.eye(3), np.ones(3))


@pytest.mark.parametrize(
    "model",
    [Model(), LEARNED, Model(measurement={"clock_offset": -0.1}), replace(LEARNED, learned_from=(RUN,))],
)
def test_the_file_is_valid_by_the_schema_of_the_standard(model, tmp_path):
    write_model(tmp_path / "model.ssv", model)
    found = read_ssv(str(tmp_path / "model.ssv"))  # checks against the schema
    assert [p.name.partition(".")[0] for p in found.parameters] == [
        *("vessel" for _ in model.vessel),
        *("thrusters" for _ in model.thrusters),
    ]
    units = read_parameters(tmp_path / "model.ssv").units
    assert all(p.unit in units for p in found.parameters)
    assert (files("fmpy.ssp") / "schema" / "SystemStructureParameterValues.xsd").is_file()


FAILS = {
    "a": {"bow_outage_start_1": 8.0, "bow_outage_end_1": 14.5},
    "of b": {"bow_outage_start_1": 3.0, "bow_outage_end_1": 5.0, "bow_outage_start_2": 7.0},
}


@pytest.mark.parametrize("always", [{}, {"lag": 0.3}, {"lag": 0.3, "bow_outage_end_1": 60.0}])
def test_values_of_one_run_come_back_as_its_own(always, tmp_path):
    write_model(tmp_path / "model.ssv", Model(thrusters=always, runs=FAILS))
    found = read_model(tmp_path / "model.ssv")
    assert (found.thrusters, found.runs) == (always, FAILS)
    assert found.during("of b").thrusters == {**always, **FAILS["of b"]}
    assert found.during("c") is found
    names = {p.name: float(p.value) for p in read_ssv(str(tmp_path / "model.ssv")).parameters}
    first = {f"thrusters.{name}": value for name, value in {**FAILS["a"], **always}.items()}
    assert names == first, "what a tool that knows no runs can apply"


def test_whose_times_are_used_is_told_in_one_line(ellipse, tmp_path):
    path = tmp_path / "model.ssv"
    for runs, stated in (
        (
            {"a": {"bow_failure_time": 40.0}},
            "bow_failure_time was found in run 'a' and holds for that run only",
        ),
        (
            FAILS,
            "bow_outage_start_1 … bow_outage_end_1 were found in run 'a' and hold for that run only; "
            "values that were found in 'of b' are not used",
        ),
        ({}, ""),
    ):
        write_model(path, Model(thrusters={"lag": 0.3}, runs=runs))
        short = cosim.load_scenario({**ellipse, "stop": 0.1})
        warnings = cosim.simulate(short, tmp_path / "out", [path], overwrite=True).warnings
        alone = [text for text in warnings if "for that run only" in text]
        assert alone == [f"'{path}': thrusters.{stated}"] * bool(stated)
        assert read_starts(path).runs == [*runs], "which fmus.build tells"


def test_values_of_a_run_without_a_name_are_refused(tmp_path):
    path = tmp_path / "model.ssv"
    write_model(path, Model(thrusters={"lag": 0.3}, runs={"a": {"bow_failure_time": 40.0}}))
    text = path.read_text(encoding="utf-8")
    assert text.count('name="a"') == 1
    for name in ("", 'name=""'):
        path.write_text(text.replace('name="a"', name), encoding="utf-8")
        with pytest.raises(InputError, match="has values of a run without a name"):
            read_parameters(path)


def test_what_is_nominal_is_left_out(tmp_path):
    write_model(tmp_path / "a.ssv", Model({"delta_X_u": 0.0, "m": 14.79}, {"lag": 0.0}))
    write_model(tmp_path / "b.ssv", Model())
    assert (tmp_path / "a.ssv").read_text() == (tmp_path / "b.ssv").read_text()
    assert read_model(tmp_path / "b.ssv").vessel == {}


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (Model({"delta_X_uu_": 1.0}), "did you mean 'delta_X_uu'"),
        (Model({}, {"loss_bow": 1.5}), "is not a number from -1 to 1"),
        (Model({"delta_X_u": np.nan}), "is not a number"),
    ],
)
def test_what_no_fmu_would_take_is_not_written(model, message, tmp_path):
    with pytest.raises(InputError, match=message):
        write_model(tmp_path / "model.ssv", model)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("vesel.m", 1.0, "did you mean 'vessel'"),
        ("vessel.delta_X_uu_", 1.0, "did you mean 'delta_X_uu'"),
        ("thrusters.lag", -1.0, "is not a number from 0 to 60"),
        ("vessel.m", '1.0" unit="m', "not defined"),
    ],
)
def test_a_set_that_is_no_model_is_refused(name, value, message, tmp_path):
    (tmp_path / "wrong.ssv").write_text(SSV.format(parameter(name, value)))
    with pytest.raises(InputError, match=message):
        read_model(tmp_path / "wrong.ssv")


def test_units_that_the_set_defines_are_converted(tmp_path):
    units = {"deg": {"rad": 1, "factor": np.pi / 180}, "g": {"kg": 1, "factor": 1e-3}}
    values = {"vessel": {"heading_offset": Parameter(90.0, "deg"), "mass": Parameter(500.0, "g")}}
    write_parameters(tmp_path / "a.ssv", ParameterSet(values, units))
    found = read_model(tmp_path / "a.ssv").vessel
    assert found == pytest.approx({"heading_offset": np.pi / 2, "mass": 0.5})
    write_parameters(
        tmp_path / "b.ssv", ParameterSet({"vessel": {"mass": Parameter(1.0, "deg")}}, units)
    )
    with pytest.raises(InputError, match="unit 'deg' cannot be converted to 'kg'"):
        read_model(tmp_path / "b.ssv")
    with pytest.raises(Exception, match="is in 'deg', but the FMU's unit is 'kg'"):
        build(["vessel"], None, read_starts(tmp_path / "b.ssv"))


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (14.0, "'vessel.m' is 14.0, and no Parameter"),
        (Parameter(float("nan"), "kg"), "'vessel.m' is nan"),
    ],
)
def test_what_is_no_finite_parameter_is_not_written(tmp_path, value, message):
    with pytest.raises(InputError, match=re.escape(message)):
        write_parameters(tmp_path / "new" / "a.ssv", ParameterSet({"vessel": {"m": value}}))
    assert not (tmp_path / "new").exists()


def run(content, folder, *parameters):
    """The log of a scenario as bytes, and the warnings."""
    path = folder.with_suffix(".json")
    path.write_text(json.dumps(content))
    result = cosim.simulate(cosim.load_scenario(path), folder, parameters)
    assert result.status == "done"
    return (folder / "log.csv").read_bytes(), result.warnings


@pytest.mark.slow
def test_a_baked_fmu_runs_as_a_plain_one_with_the_set(ellipse, learned, tmp_path):
    plain, _ = run(ellipse, tmp_path / "plain")
    bound, warnings = run(ellipse, tmp_path / "bound", learned)
    assert any("clock_offset = 0.2 s is not a parameter of an FMU" in text for text in warnings)
    fmus = build([], tmp_path / "fmu", read_starts(learned))
    assert [fmu.name for fmu in fmus] == ["vessel.fmu", "thrusters.fmu"]
    for name in ("vessel", "thrusters"):
        ellipse["fmus"][name]["path"] = f"./fmu/{name}.fmu"
    baked, _ = run(ellipse, tmp_path / "baked")
    assert baked == bound != plain
    ellipse["fmus"]["vessel"]["path"] = "vessel.fmu"  # the cache keeps plain and baked apart
    ellipse["fmus"]["thrusters"]["path"] = "thrusters.fmu"
    assert run(ellipse, tmp_path / "again")[0] == plain


def test_baked_fmus_are_valid_repeatable_and_reset_to_their_values(learned, fmus, tmp_path, monkeypatch):
    (first,) = build(["vessel"], tmp_path / "a", read_starts(learned))
    monkeypatch.setenv("CYBERSHIP_CACHE", str(tmp_path / "another"))
    (second,) = build(["vessel"], tmp_path / "b", read_starts(learned))
    assert first.read_bytes() == second.read_bytes()
    assert validate_fmu(str(first)) == []
    plain, baked = (fmpy.read_model_description(str(p)) for p in (fmus["vessel"], first))
    assert plain.guid != baked.guid
    changed = {
        v.name: (float(v.start), float(w.start))
        for v, w in zip(plain.modelVariables, baked.modelVariables, strict=True)
        if v.start != w.start
    }
    assert changed == {"delta_X_u": (0.0, LEARNED.vessel["delta_X_u"]), "V_n": (0.0, 0.05)}
    opened = Opened(first, tmp_path)
    assert opened.initialise().get("delta_X_u", "V_n") == [LEARNED.vessel["delta_X_u"], 0.05]
    opened.set(delta_X_u=1.0)
    opened.fmu.reset()
    assert opened.initialise().get("delta_X_u") == [LEARNED.vessel["delta_X_u"]]
    opened.close()


def test_a_set_that_changes_nothing_gives_the_plain_fmu(fmus, tmp_path):
    (tmp_path / "same.ssv").write_text(SSV.format(parameter("vessel.delta_X_u", 0.0)))
    (path,) = build([], None, read_starts(tmp_path / "same.ssv"))
    assert path.read_bytes() == fmus["vessel"].read_bytes()


def test_names_choose_and_what_is_not_used_is_told(learned, tmp_path):
    done = in_this_process(
        build_main, "vessel", "observer_mdf", "--parameters", learned, "--out", tmp_path / "fmu"
    )
    assert done.returncode == 0
    assert [Path(p).name for p in done.stdout.split()] == ["vessel.fmu", "observer_mdf.fmu"]
    assert "has values for thrusters, which is not built" in done.stderr
    assert "clock_offset" in done.stderr
    write_model(tmp_path / "empty.ssv", Model())
    done = in_this_process(
        build_main, "--parameters", tmp_path / "empty.ssv", "--out", tmp_path / "none"
    )
    assert (done.returncode, done.stdout) == (0, "")
    assert "holds no values" in done.stderr


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "no such parameter set"),
        ("<a", "is not an SSP 1.0 parameter set"),
        ("<a/>", "is not an SSP 1.0 parameter set"),
        (SSV.format(parameter("vessel.m", "much")), "'much' is not a valid value"),
        (SSV.format(parameter("vessel.m", "NaN")), "the value of vessel.m is not a number"),
        (SSV.format('<ssv:Parameter name="vessel.m"><ssv:Boolean value="true"/></ssv:Parameter>'), "the value of vessel.m is not a number"),
        (SSV.format(2 * parameter("vessel.m", 1.0)), "occurs twice"),
        (SSV.format(parameter("m", 1.0)), "is not of the form model.parameter"),
        (SSV.format(parameter("vesel.m", 1.0)), "did you mean 'vessel'"),
        (SSV.format(parameter("vessel.delta_X_uu_", 1.0)), "did you mean 'delta_X_uu'"),
        (SSV.format(parameter("vessel.x", 1.0)), "vessel.x is not a parameter"),
        (SSV.format(parameter("vessel.m", -1.0)), "below its minimum 0"),
        (SSV.format(parameter("thrusters.loss_bow", 2.0)), "above its maximum 1"),
    ],
)  # fmt: skip
def test_a_set_that_cannot_be_baked_is_one_message(text, message, tmp_path):
    if text is not None:
        (tmp_path / "wrong.ssv").write_text(text)
    done = in_this_process(build_main, "--parameters", tmp_path / "wrong.ssv", "--out", tmp_path / "fmu")
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert list((tmp_path / "fmu").glob("*")) == []


@pytest.mark.slow
def test_parameters_of_own_effects_need_the_fmu_that_has_them(scenario, ellipse, tmp_path):
    (tmp_path / "mine.py").write_text(OWN.format(body=GOOD))
    (tmp_path / "model.ssv").write_text(SSV.format(parameter("vessel.N_uuv", 100.0)))
    arguments = ("--out", tmp_path / "out", "--no-plots", "--parameters", tmp_path / "model.ssv")
    done = command(scenario(), *arguments)
    assert done.returncode == 2
    assert "python -m fmus.build vessel --effects FILE.py" in done.stderr
    for extra in ([], ["--parameters", tmp_path / "model.ssv"]):
        built = (
            "vessel",
            "--effects",
            tmp_path / "mine.py",
            *extra,
            "--overwrite",
            "--out",
            tmp_path / "fmu",
        )
        assert in_this_process(build_main, *built).returncode == 0
        ellipse["fmus"]["vessel"]["path"] = "./fmu/vessel.fmu"
        assert command(scenario(), *arguments).returncode == 0
        with_set = (tmp_path / "out" / "log.csv").read_bytes()
    command(scenario(), *arguments[:3])
    assert (tmp_path / "out" / "log.csv").read_bytes() == with_set


def test_an_integer_of_a_set_fits_an_integer_of_an_fmu(plain_fmu, tmp_path):
    init = 'self.n = 1\nself.register_variable(Integer("n", causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable))'
    fmu = plain_fmu(
        "Counts",
        init + '\nself.y = 0.0\nself.register_variable(Real("y", causality=Fmi2Causality.output))',
    )
    (tmp_path / "n.ssv").write_text(
        SSV.format('<ssv:Parameter name="Counts.n"><ssv:Integer value="3"/></ssv:Parameter>')
    )
    content = {"name": "s", "step": 0.1, "stop": 0.2, "fmus": {"a": {"path": f"./{Path(fmu).name}"}}}
    run(content, tmp_path / "out", tmp_path / "n.ssv")
    assert json.loads((tmp_path / "out" / "log.json").read_text())["scenario"]["fmus"]["a"][
        "parameters"
    ] == {"n": 3}


def test_building_reads_sets_without_the_master():
    code = "import sys, fmus.build; sys.exit('cosim' in sys.modules or 'numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0
