"""An FMU that is no Python: a first-order lag in C, compiled here, with whatever habits a test wants."""

import subprocess
import zipfile

import fmpy
import pytest

from support import ccode

needs_compiler = pytest.mark.skipif(ccode.COMPILER is None, reason="no C compiler on this machine")
ANY_STEP = 'canHandleVariableCommunicationStepSize="true"'
STATE = 'canGetAndSetFMUstate="true"'

SOURCE = r"""
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct { Logger logger; void *(*allocate)(size_t, size_t); void (*release)(void *);
                 void *step_finished; void *environment; } Callbacks;
typedef struct { double u, y, T; int steps; int on; double last; int done; int pending; double pending_step;
                 const Callbacks *callbacks; char name[64]; } Lag;

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
    HABIT
    if (m->u > 1e6) {
        m->callbacks->logger(m->callbacks->environment, m->name, 3, "error", "input %g is too large", m->u);
        return 3;
    }
    if (m->on) m->y += h / m->T * (m->u - m->y);
    m->steps++;
    return 0;
}
int fmi2CancelStep(void *c) { return 3; }
int fmi2GetStatus(void *c, int k, int *v) { /* of a step in its own time: ready at the third question */
    Lag *m = c;
    if (k != 0 || !m->pending) return 2;
    if (--m->pending) { *v = 5; return 0; }
    m->y += m->pending_step / m->T * (m->u - m->y); m->steps++;
    *v = 0; return 0;
}
int fmi2GetRealStatus(void *c, int k, double *v) { *v = ((Lag *)c)->last; return k == 2 ? 0 : 2; }
int fmi2GetIntegerStatus(void *c, int k, int *v) { return 2; }
int fmi2GetBooleanStatus(void *c, int k, int *v) { *v = ((Lag *)c)->done; return k == 3 ? 0 : 2; }
int fmi2GetStringStatus(void *c, int k, const char **v) { return 2; }
int fmi2SetRealInputDerivatives(void *c, const unsigned v[], size_t n, const int o[], const double x[]) { return 3; }
int fmi2GetRealOutputDerivatives(void *c, const unsigned v[], size_t n, const int o[], double x[]) { return 3; }
int fmi2GetFMUstate(void *c, void **s) {
    if (!*s) *s = malloc(sizeof(Lag));
    memcpy(*s, c, sizeof(Lag)); return 0;
}
int fmi2SetFMUstate(void *c, void *s) { memcpy(c, s, sizeof(Lag)); return 0; }
int fmi2FreeFMUstate(void *c, void **s) { free(*s); *s = NULL; return 0; }
int fmi2SerializedFMUstateSize(void *c, void *s, size_t *n) { return 3; }
int fmi2SerializeFMUstate(void *c, void *s, char b[], size_t n) { return 3; }
int fmi2DeSerializeFMUstate(void *c, const char b[], size_t n, void **s) { return 3; }
int fmi2GetDirectionalDerivative(void *c, const unsigned u[], size_t nu, const unsigned k[], size_t nk,
                                 const double dk[], double du[]) { return 3; }
"""

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="lag" guid="{lag}">
  <CoSimulation modelIdentifier="lag" CAPABILITIES/>
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


def _with(before):
    """The source with functions of a habit, behind what it includes."""
    head, _, rest = SOURCE.partition("typedef")
    return f"#define _GNU_SOURCE\n{head}{before}typedef{rest}"


def build_lag(folder, name="lag", habit="", capabilities=ANY_STEP, before=""):
    """Path of the compiled FMU.

    Args:
        folder: where to work.
        name: of the file.
        habit: C statements at the start of fmi2DoStep(Lag *m, double t, double h).
        capabilities: attributes of the CoSimulation element.
        before: C at the start of the file.
    """
    (folder / f"{name}.c").write_text(_with(before).replace("HABIT", habit))
    library = folder / f"{name}{fmpy.sharedLibraryExtension}"
    subprocess.run(
        [ccode.COMPILER, "-O1", "-shared", "-fPIC", "-o", library, folder / f"{name}.c", "-lm"],
        check=True,
    )
    with zipfile.ZipFile(folder / f"{name}.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION.replace("CAPABILITIES", capabilities))
        archive.write(library, f"binaries/{fmpy.platform}/lag{fmpy.sharedLibraryExtension}")
    return folder / f"{name}.fmu"
