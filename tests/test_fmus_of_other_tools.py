"""FMUs made with other tools, and Python FMUs with rare features: many variables, enumerations, strings.

The environment variable CYBERSHIP_FMUS names a folder with FMUs of other tools, for instance the 2.0 ones of
the Modelica Reference FMUs. A reference result ``NAME_ref.csv`` beside ``NAME.fmu`` is compared as well.
"""

import os
from pathlib import Path

import fmpy
import numpy as np
import pytest

import cosim

FOLDER = os.environ.get("CYBERSHIP_FMUS", "")
FOREIGN = sorted(Path(FOLDER).glob("*.fmu")) if FOLDER else []
if FOLDER and not FOREIGN:
    raise FileNotFoundError(f"CYBERSHIP_FMUS names '{FOLDER}', where no FMU is")


@pytest.mark.skipif(not FOREIGN, reason="no FMUs of other tools: CYBERSHIP_FMUS names no folder")
@pytest.mark.parametrize("isolate", [False, True])
@pytest.mark.parametrize("path", FOREIGN, ids=lambda p: p.stem)
def test_fmu_of_another_tool_gives_the_values_of_fmpy(path, isolate, tmp_path):
    """But for rounding: FMPy's steps differ in the last digit. Follows its reference, if one lies there."""
    description = fmpy.read_model_description(str(path), validate=False)
    if description.coSimulation is None or description.fmiVersion != "2.0":
        pytest.skip("not for FMI 2.0 co-simulation")
    if fmpy.platform not in fmpy.supported_platforms(str(path)):
        pytest.skip(f"no binary for {fmpy.platform}")
    experiment = description.defaultExperiment
    step = float(experiment.stepSize or 0.01) if experiment else 0.01
    stop = min(float(experiment.stopTime or 1.0) if experiment else 1.0, 1000 * step)
    stop = round(stop / step) * step
    inputs = {
        v.name: 1.0 for v in description.modelVariables if v.causality == "input" and v.type == "Real"
    }
    content = {
        "name": "x", "step": step, "stop": stop,
        "fmus": {"m": {"path": str(path), "isolate": isolate, "parameters": inputs}},
    }  # fmt: skip
    result = cosim.simulate(cosim.load_scenario(content), tmp_path / "out")
    assert result.status == "done", result.message
    log = cosim.read_log(tmp_path / "out")
    outputs = [
        v.name for v in description.modelVariables if v.causality == "output" and f"m.{v.name}" in log
    ]
    other = fmpy.simulate_fmu(
        str(path), stop_time=stop, output_interval=step, fmi_type="CoSimulation", output=outputs, start_values=inputs
    )  # fmt: skip
    for name in outputs:
        assert np.allclose(log[f"m.{name}"], other[name], rtol=1e-9, atol=1e-12), name
    reference = path.with_name(f"{path.stem}_ref.csv")
    if reference.is_file() and not inputs:
        expected = np.genfromtxt(reference, delimiter=",", names=True, deletechars="")
        for name in outputs:
            if name in (expected.dtype.names or ()):
                wanted = np.interp(log["time"], expected["time"], expected[name])
                tolerance = 0.02 * max(1e-6, np.ptp(expected[name]))
                assert np.mean(abs(log[f"m.{name}"] - wanted) <= tolerance) > 0.95, name


def test_a_thousand_variables_in_vectors(plain_fmu, tmp_path):
    init = """
        for k in range(1, 501):
            setattr(self, f"u{k}", 0.0)
            setattr(self, f"y{k}", 0.0)
            self.register_variable(Real(f"u[{k}]", causality=Fmi2Causality.input,
                getter=lambda k=k: getattr(self, f"u{k}"), setter=lambda v, k=k: setattr(self, f"u{k}", v)))
            self.register_variable(Real(f"y[{k}]", causality=Fmi2Causality.output,
                getter=lambda k=k: getattr(self, f"y{k}")))
    """
    step = "for k in range(1, 501): setattr(self, f'y{k}', getattr(self, f'u{k}') + k)\nreturn True"
    fmu = str(plain_fmu("Many", init, step))
    for isolate in (False, True):
        content = {
            "name": "many", "step": 0.1, "stop": 0.5,
            "fmus": {"a": {"path": fmu, "isolate": isolate}, "b": {"path": fmu}},
            "connections": [["a.y[*]", "b.u[*]"]],
            "log": {"signals": ["b.y[500]", "b.u[7]", "b.y[1*]"]},
        }  # fmt: skip
        assert cosim.simulate(cosim.load_scenario(content), tmp_path / "out").status == "done"
        log = cosim.read_log(tmp_path / "out")
        assert log["b.y[500]"][-1] == 1000.0
        assert log["b.u[7]"][-1] == 7.0
        assert len(log) == 1 + 2 + 111


ENUMERATION = [
    (
        "<LogCategories>",
        '<TypeDefinitions><SimpleType name="Mode"><Enumeration><Item name="off" value="1"/><Item name="on" value="2"/>'
        "</Enumeration></SimpleType></TypeDefinitions><LogCategories>",
    ),
    ('<Integer start="1"', '<Enumeration declaredType="Mode" min="1" max="2" start="1"'),
    ("<Integer/>", '<Enumeration declaredType="Mode"/>'),
]


def test_enumerations_are_numbers_within_their_range(plain_fmu, tmp_path):
    init = """
        self.mode, self.shown = 1, 1
        self.register_variable(Integer("mode", causality=Fmi2Causality.input))
        self.register_variable(Integer("shown", causality=Fmi2Causality.output))
    """
    fmu = str(plain_fmu("Modes", init, "self.shown = self.mode\nreturn True", ENUMERATION))
    content = {
        "name": "modes", "step": 0.1, "stop": 0.5,
        "fmus": {"a": {"path": fmu, "parameters": {"mode": 2}}, "b": {"path": fmu}},
        "connections": [["a.shown", "b.mode"]],
    }  # fmt: skip
    assert cosim.simulate(cosim.load_scenario(content), tmp_path / "out").status == "done"
    assert cosim.read_log(tmp_path / "out")["b.shown"][-1] == 2.0
    content["fmus"]["a"]["parameters"]["mode"] = 3
    with pytest.raises(cosim.InputError, match=r"a\.mode = 3 is above its maximum 2"):
        cosim.simulate(cosim.load_scenario(content), tmp_path / "out")


def test_strings_are_set_but_neither_connected_nor_logged(plain_fmu, tmp_path):
    init = """
        self.file, self.text, self.n = "", "", 0
        self.register_variable(String("file", causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed))
        self.register_variable(String("text", causality=Fmi2Causality.output))
        self.register_variable(String("text_in", causality=Fmi2Causality.input, getter=lambda: "", setter=lambda v: None))
        self.register_variable(Integer("n", causality=Fmi2Causality.output))
    """
    fmu = str(plain_fmu("Texts", init, "self.n = len(self.file)\nreturn True"))
    content = {
        "name": "texts", "step": 0.1, "stop": 0.5,
        "fmus": {"a": {"path": fmu, "parameters": {"file": "route.csv"}}, "b": {"path": fmu}},
    }  # fmt: skip
    assert cosim.simulate(cosim.load_scenario(content), tmp_path / "out").status == "done"
    assert cosim.read_log(tmp_path / "out")["a.n"][-1] == len("route.csv")
    for change, message in (
        ({"connections": [["a.text", "b.text_in"]]}, "String cannot feed String"),
        ({"log": {"signals": ["a.text"]}}, "is of type String, not a number"),
    ):
        with pytest.raises(cosim.InputError, match=message):
            cosim.simulate(cosim.load_scenario(content | change), tmp_path / "out")
