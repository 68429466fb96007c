"""An FMU that is no Python: a first-order lag in C, compiled here, run beside ours."""

import subprocess
import zipfile

import ccode
import fmpy
import numpy as np
import pytest

import cosim

pytestmark = pytest.mark.skipif(ccode.COMPILER is None, reason="no C compiler on this machine")

SOURCE = r"""
#include <stdlib.h>
#include <string.h>
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct { Logger logger; void *(*allocate)(size_t, size_t); void (*release)(void *);
                 void *step_finished; void *environment; } Callbacks;
typedef struct { double u, y, T; int steps; int on; const Callbacks *callbacks; char name[64]; } Lag;

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const k[]) { return 0; }
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                      const Callbacks *callbacks, int visible, int logging) {
    if (strcmp(guid, "{lag}")) return NULL;
    Lag *m = callbacks->allocate(1, sizeof(Lag));
    m->T = 1.0; m->on = 1; m->callbacks = callbacks; strncpy(m->name, name, 63);
    return m;
}
void fmi2FreeInstance(void *c) { Lag *m = c; m->callbacks->release(m); }
int fmi2SetupExperiment(void *c, int t, double tol, double start, int s, double stop) { return 0; }
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) { return 0; }
int fmi2Terminate(void *c) { return 0; }
int fmi2Reset(void *c) { Lag *m = c; m->u = m->y = 0.0; m->steps = 0; return 0; }
int fmi2GetReal(void *c, const unsigned vr[], size_t n, double v[]) {
    Lag *m = c; double all[] = {m->u, m->y, m->T};
    for (size_t k = 0; k < n; k++) { if (vr[k] > 2) return 3; v[k] = all[vr[k]]; } return 0;
}
int fmi2SetReal(void *c, const unsigned vr[], size_t n, const double v[]) {
    Lag *m = c;
    for (size_t k = 0; k < n; k++) { if (vr[k] == 0) m->u = v[k]; else if (vr[k] == 2) m->T = v[k]; else return 3; }
    return 0;
}
int fmi2GetInteger(void *c, const unsigned vr[], size_t n, int v[]) { v[0] = ((Lag *)c)->steps; return 0; }
int fmi2SetInteger(void *c, const unsigned vr[], size_t n, const int v[]) { return 3; }
int fmi2GetBoolean(void *c, const unsigned vr[], size_t n, int v[]) { v[0] = ((Lag *)c)->on; return 0; }
int fmi2SetBoolean(void *c, const unsigned vr[], size_t n, const int v[]) { ((Lag *)c)->on = v[0]; return 0; }
int fmi2GetString(void *c, const unsigned vr[], size_t n, const char *v[]) { return 3; }
int fmi2SetString(void *c, const unsigned vr[], size_t n, const char *const v[]) { return 3; }
int fmi2DoStep(void *c, double t, double h, int no_set) {
    Lag *m = c;
    if (m->u > 1e6) {
        m->callbacks->logger(m->callbacks->environment, m->name, 3, "error", "input %g is too large", m->u);
        return 3;
    }
    if (m->on) m->y += h / m->T * (m->u - m->y);
    m->steps++;
    return 0;
}
int fmi2CancelStep(void *c) { return 3; }
int fmi2GetStatus(void *c, int k, int *v) { return 2; }
int fmi2GetRealStatus(void *c, int k, double *v) { return 2; }
int fmi2GetIntegerStatus(void *c, int k, int *v) { return 2; }
int fmi2GetBooleanStatus(void *c, int k, int *v) { return 2; }
int fmi2GetStringStatus(void *c, int k, const char **v) { return 2; }
int fmi2SetRealInputDerivatives(void *c, const unsigned v[], size_t n, const int o[], const double x[]) { return 3; }
int fmi2GetRealOutputDerivatives(void *c, const unsigned v[], size_t n, const int o[], double x[]) { return 3; }
int fmi2GetFMUstate(void *c, void **s) { return 3; }
int fmi2SetFMUstate(void *c, void *s) { return 3; }
int fmi2FreeFMUstate(void *c, void **s) { return 3; }
int fmi2SerializedFMUstateSize(void *c, void *s, size_t *n) { return 3; }
int fmi2SerializeFMUstate(void *c, void *s, char b[], size_t n) { return 3; }
int fmi2DeSerializeFMUstate(void *c, const char b[], size_t n, void **s) { return 3; }
int fmi2GetDirectionalDerivative(void *c, const unsigned u[], size_t nu, const unsigned k[], size_t nk,
                                 const double dk[], double du[]) { return 3; }
"""

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="lag" guid="{lag}">
  <CoSimulation modelIdentifier="lag" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <ScalarVariable name="in[1]" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="out, filtered" valueReference="1" causality="output" initial="exact"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="T" valueReference="2" causality="parameter" variability="tunable"><Real start="1" min="0.01"/></ScalarVariable>
    <ScalarVariable name="steps" valueReference="0" causality="output" variability="discrete" initial="exact"><Integer start="0"/></ScalarVariable>
    <ScalarVariable name="on" valueReference="0" causality="input" variability="discrete"><Boolean start="true"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2" dependencies=""/><Unknown index="4" dependencies=""/></Outputs></ModelStructure>
</fmiModelDescription>
"""


@pytest.fixture
def lag(tmp_path):
    """Path of the compiled FMU."""
    (tmp_path / "lag.c").write_text(SOURCE)
    library = tmp_path / f"lag{fmpy.sharedLibraryExtension}"
    subprocess.run(
        [ccode.COMPILER, "-O1", "-shared", "-fPIC", "-o", library, tmp_path / "lag.c"], check=True
    )
    with zipfile.ZipFile(tmp_path / "lag.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.write(library, f"binaries/{fmpy.platform}/{library.name}")
    return tmp_path / "lag.fmu"


def scenario(lag, **changes):
    return {
        "name": "lag", "step": 0.01, "stop": 2.0,
        "fmus": {
            "guidance": {"path": "guidance_ellipse.fmu", "parameters": {"u_t": 0.1}},
            "lag": {"path": str(lag), "parameters": {"T": 0.5}},
        },
        "connections": [["guidance.x_t_dot", "lag.in[1]"]],
    } | changes  # fmt: skip


def test_compiled_fmu_runs_beside_python_ones(lag, tmp_path):
    result = cosim.simulate(cosim.load_scenario(scenario(lag)), tmp_path / "out")
    assert result.status == "done"
    log = cosim.read_log(tmp_path / "out")
    u, y = log["lag.in[1]"], log["lag.out, filtered"]
    assert np.allclose(np.diff(y), 0.01 / 0.5 * (u[1:] - y[:-1]))
    assert list(log["lag.steps"]) == list(range(201))


def test_events_reach_its_parameter_and_its_flag(lag, tmp_path):
    events = [
        {"time": 0.5, "model": "lag", "variable": "T", "action": "override", "value": 0.1},
        {"time": 1.0, "model": "lag", "variable": "on", "action": "override", "value": False},
        {"time": 1.5, "model": "lag", "variable": "on", "action": "reset"},
    ]
    cosim.simulate(cosim.load_scenario(scenario(lag, events=events)), tmp_path / "out")
    log = cosim.read_log(tmp_path / "out")
    u, change = log["lag.in[1]"][1:], np.diff(log["lag.out, filtered"])
    y = log["lag.out, filtered"][:-1]
    assert np.allclose(change[:50], 0.01 / 0.5 * (u - y)[:50])
    assert np.allclose(change[50:100], 0.01 / 0.1 * (u - y)[50:100])
    assert (change[100:150] == 0.0).all()
    assert (change[150:] != 0.0).all()


def test_its_error_ends_the_run_with_what_it_said(lag, tmp_path):
    events = [{"time": 1.0, "model": "lag", "variable": "in[1]", "action": "override", "value": 1e7}]
    result = cosim.simulate(cosim.load_scenario(scenario(lag, events=events)), tmp_path / "out")
    assert result.status == "failed"
    assert "returned error: input 1e+07 is too large" in result.message
    assert len(cosim.read_log(tmp_path / "out")["time"]) == 101


def test_alone_it_does_what_fmpy_makes_it_do(lag, tmp_path):
    content = {
        "name": "alone", "step": 0.01, "stop": 2.0,
        "fmus": {"lag": {"path": str(lag), "parameters": {"in[1]": 1.0}}},
    }  # fmt: skip
    cosim.simulate(cosim.load_scenario(content), tmp_path / "out")
    y = cosim.read_log(tmp_path / "out")["lag.out, filtered"]
    other = fmpy.simulate_fmu(
        str(lag),
        stop_time=2.0,
        output_interval=0.01,
        start_values={"in[1]": 1.0},
        output=["out, filtered"],
    )
    assert np.allclose(y, other["out, filtered"], rtol=1e-12)


def test_refused_instantiation_is_one_message(lag, tmp_path):
    with zipfile.ZipFile(lag) as archive:
        content = {n: archive.read(n) for n in archive.namelist()}
    wrong = content["modelDescription.xml"].replace(b"{lag}", b"{other}")
    with zipfile.ZipFile(lag, "w") as archive:
        for name, data in (content | {"modelDescription.xml": wrong}).items():
            archive.writestr(name, data)
    with pytest.raises(cosim.InputError, match="cannot be instantiated as 'lag'"):
        cosim.simulate(cosim.load_scenario(scenario(lag)), tmp_path / "out")
    assert not (tmp_path / "out").exists()
