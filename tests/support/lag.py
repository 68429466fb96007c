"""A first-order lag as an FMU in C without a fault, to be broken on purpose by edits."""

import subprocess
import zipfile

from fmucheck.fmu import platform, suffix
from support import ccode

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="lag" guid="{lag}" generationDateAndTime="2024-05-06T07:08:09Z" variableNamingConvention="structured">
  <CoSimulation modelIdentifier="lag" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true">
    <SourceFiles><File name="lag.c"/></SourceFiles>
  </CoSimulation>
  <UnitDefinitions>
    <Unit name="m/s"><BaseUnit m="1" s="-1"/><DisplayUnit name="km/h" factor="3.6"/></Unit>
    <Unit name="s"><BaseUnit s="1"/></Unit>
  </UnitDefinitions>
  <TypeDefinitions>
    <SimpleType name="Speed"><Real unit="m/s" displayUnit="km/h" min="-100" max="100"/></SimpleType>
    <SimpleType name="Mode"><Enumeration><Item name="on" value="1"/><Item name="off" value="2"/></Enumeration></SimpleType>
  </TypeDefinitions>
  <LogCategories><Category name="errors"/></LogCategories>
  <DefaultExperiment startTime="0" stopTime="1" tolerance="1e-4" stepSize="0.01"/>
  <VendorAnnotations><Tool name="here"/></VendorAnnotations>
  <ModelVariables>
    <ScalarVariable name="in.u[1]" valueReference="0" causality="input"><Real declaredType="Speed" start="0"/></ScalarVariable>
    <ScalarVariable name="T" valueReference="2" causality="parameter" variability="fixed"><Real unit="s" start="1" min="0.01" nominal="1"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output" initial="calculated"><Real declaredType="Speed"/></ScalarVariable>
    <ScalarVariable name="direct" valueReference="3" causality="output"><Real declaredType="Speed" max="50"/></ScalarVariable>
    <ScalarVariable name="der(y)" valueReference="4"><Real derivative="3"/></ScalarVariable>
    <ScalarVariable name="T_2" valueReference="5" causality="calculatedParameter" variability="fixed"><Real unit="s"/></ScalarVariable>
    <ScalarVariable name="mode" valueReference="0" variability="constant"><Enumeration declaredType="Mode" start="1"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="3" dependencies="" dependenciesKind=""/><Unknown index="4" dependencies="1" dependenciesKind="fixed"/></Outputs>
    <Derivatives><Unknown index="5" dependencies="1 3"/></Derivatives>
    <InitialUnknowns><Unknown index="3" dependencies="2"/><Unknown index="4" dependencies="1 2"/><Unknown index="5"/><Unknown index="6" dependencies="2" dependenciesKind="constant"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""

SOURCE = r"""
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct { Logger logger; void *(*allocate)(size_t, size_t); void (*release)(void *);
                 void *step_finished; void *environment; } Callbacks;
typedef struct { double u, y, T, hidden; int running; } State;
typedef struct { State s; const Callbacks *callbacks; } Lag;
static double shared;
static int alive;

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const k[]) { return 0; }
static void begin(Lag *m) { State s = {0.0, 0.0, 1.0, 0.0, 0}; m->s = s; }
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                      const Callbacks *callbacks, int visible, int logging) {
    if (strcmp(guid, "{lag}")) return NULL;
    Lag *m = callbacks->allocate(1, sizeof(Lag));
    m->callbacks = callbacks; alive++; begin(m);
    return m;
}
void fmi2FreeInstance(void *c) { Lag *m = c; alive--; m->callbacks->release(m); }
int fmi2SetupExperiment(void *c, int t, double tol, double start, int s, double stop) { return 0; }
int fmi2EnterInitializationMode(void *c) { return 0; }
int fmi2ExitInitializationMode(void *c) { Lag *m = c; m->s.y = m->s.T; m->s.running = 1; return 0; }
int fmi2Terminate(void *c) { return 0; }
int fmi2Reset(void *c) { begin(c); return 0; }
int fmi2GetReal(void *c, const unsigned vr[], size_t n, double v[]) {
    State s = ((Lag *)c)->s; double y = s.running ? s.y : s.T;
    double all[] = {s.u, y, s.T, s.T * s.u, (s.u - y) / s.T, 2.0 * s.T};
    for (size_t k = 0; k < n; k++) { if (vr[k] > 5) return 3; v[k] = all[vr[k]]; } return 0;
}
int fmi2SetReal(void *c, const unsigned vr[], size_t n, const double v[]) {
    Lag *m = c;
    for (size_t k = 0; k < n; k++) { if (vr[k] == 0) m->s.u = v[k]; else if (vr[k] == 2) m->s.T = v[k]; else return 3; }
    return 0;
}
int fmi2GetInteger(void *c, const unsigned vr[], size_t n, int v[]) { v[0] = 1; return 0; }
int fmi2SetInteger(void *c, const unsigned vr[], size_t n, const int v[]) { return 3; }
int fmi2GetBoolean(void *c, const unsigned vr[], size_t n, int v[]) { return 3; }
int fmi2SetBoolean(void *c, const unsigned vr[], size_t n, const int v[]) { return 3; }
int fmi2GetString(void *c, const unsigned vr[], size_t n, const char *v[]) { return 3; }
int fmi2SetString(void *c, const unsigned vr[], size_t n, const char *const v[]) { return 3; }
int fmi2DoStep(void *c, double t, double h, int no_set) {
    Lag *m = c; State *s = &m->s;
    s->y += h / s->T * (s->u - s->y);
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
int fmi2GetFMUstate(void *c, void **s) {
    if (!*s) *s = malloc(sizeof(State));
    *(State *)*s = ((Lag *)c)->s; return 0;
}
int fmi2SetFMUstate(void *c, void *s) { ((Lag *)c)->s = *(State *)s; return 0; }
int fmi2FreeFMUstate(void *c, void **s) { free(*s); *s = NULL; return 0; }
int fmi2SerializedFMUstateSize(void *c, void *s, size_t *n) { *n = sizeof(State); return 0; }
int fmi2SerializeFMUstate(void *c, void *s, char b[], size_t n) { memcpy(b, s, n); return 0; }
int fmi2DeSerializeFMUstate(void *c, const char b[], size_t n, void **s) {
    *s = malloc(n); memcpy(*s, b, n); return 0;
}
int fmi2GetDirectionalDerivative(void *c, const unsigned u[], size_t nu, const unsigned k[], size_t nk,
                                 const double dk[], double du[]) { return 3; }
"""


def edited(text, edits):
    """A text with (old, new) replacements; each old one must be there."""
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new)
    return text


def pack(folder, xml=(), c=(), compiled=True, extra=()):
    """The FMU with edits.

    Args:
        folder: where to make it.
        xml: edits of the description, (old, new).
        c: edits of the source.
        compiled: whether its library is to work; else it is an empty file.
        extra: (name or ZipInfo, content) of further members.
    """
    library = folder / f"lag{suffix(platform())}"
    library.write_bytes(b"")
    if compiled:
        (folder / "lag.c").write_text(edited(SOURCE, c))
        command = [ccode.COMPILER, "-w", "-shared", "-fPIC", "-o", library, folder / "lag.c"]
        subprocess.run(command, check=True)
    path = folder / "lag.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", edited(DESCRIPTION, xml))
        archive.write(library, f"binaries/{platform()}/{library.name}")
        archive.writestr("sources/lag.c", SOURCE)
        for name, content in extra:
            archive.writestr(name, content)
    return path
