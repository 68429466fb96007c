"""An FMU in C from FMI's standard alone: a mass on a spring with a damper, by its force and its start."""

import subprocess
import zipfile

import fmpy

from support import ccode

SOURCE = r"""
#include <math.h>
#include <stdlib.h>
#include <string.h>
typedef struct { double v[12]; } M;  /* f x v m c d x0 v0 c3 unused, x_dot, v_dot */
enum { F, X, V, MASS, C, D, X0, V0, C3, UNUSED, A, COUNT };
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const k[]) { return 0; }
static void begin(M *m) {
    double start[] = {0, 0, 0, 2, 10, 1, 0, 0, 0, 1, 0};
    memcpy(m->v, start, sizeof start);
}
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                      const void *callbacks, int visible, int logging) {
    M *m = calloc(1, sizeof(M)); begin(m); return m;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int t, double tol, double start, int s, double stop) { return 0; }
static void slope(const double *p, double x, double v, double *xd, double *vd) {
    *xd = v; *vd = (p[F] - p[C] * x - p[C3] * x * x * x - p[D] * v) / p[MASS];
}
int fmi2EnterInitializationMode(void *c) { M *m = c; m->v[X] = m->v[X0]; m->v[V] = m->v[V0]; return 0; }
int fmi2ExitInitializationMode(void *c) { M *m = c; double x; slope(m->v, m->v[X], m->v[V], &x, &m->v[A]); return 0; }
int fmi2Terminate(void *c) { return 0; }
int fmi2Reset(void *c) { begin(c); return 0; }
int fmi2GetReal(void *c, const unsigned r[], size_t n, double v[]) {
    M *m = c; for (size_t k = 0; k < n; k++) { if (r[k] >= COUNT) return 3; v[k] = m->v[r[k]]; } return 0;
}
int fmi2SetReal(void *c, const unsigned r[], size_t n, const double v[]) {
    M *m = c; for (size_t k = 0; k < n; k++) { if (r[k] >= COUNT) return 3; m->v[r[k]] = v[k]; } return 0;
}
int fmi2GetInteger(void *c, const unsigned r[], size_t n, int v[]) { return 3; }
int fmi2SetInteger(void *c, const unsigned r[], size_t n, const int v[]) { return 3; }
int fmi2GetBoolean(void *c, const unsigned r[], size_t n, int v[]) { return 3; }
int fmi2SetBoolean(void *c, const unsigned r[], size_t n, const int v[]) { return 3; }
int fmi2GetString(void *c, const unsigned r[], size_t n, const char *v[]) { return 3; }
int fmi2SetString(void *c, const unsigned r[], size_t n, const char *const v[]) { return 3; }
int fmi2DoStep(void *c, double t, double h, int no_set) {
    M *m = c; double *p = m->v;
    HABIT
    int n = (int)ceil(h / 0.01 - 1e-9); double d = h / n;
    for (int k = 0; k < n; k++) {
        double x = p[X], v = p[V], a, b, e, f, g, i, j, l;
        slope(p, x, v, &a, &b); slope(p, x + d / 2 * a, v + d / 2 * b, &e, &f);
        slope(p, x + d / 2 * e, v + d / 2 * f, &g, &i); slope(p, x + d * g, v + d * i, &j, &l);
        p[X] += d / 6 * (a + 2 * e + 2 * g + j); p[V] += d / 6 * (b + 2 * f + 2 * i + l);
    }
    double x; slope(p, p[X], p[V], &x, &p[A]);
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
UNITS = {"N": 'kg="1" m="1" s="-2"', "m": 'm="1"', "m/s": 'm="1" s="-1"', "kg": 'kg="1"',
         "N/m": 'kg="1" s="-2"', "N.s/m": 'kg="1" s="-1"', "N/m3": 'kg="1" m="-2" s="-2"',
         "m/s2": 'm="1" s="-2"'}  # fmt: skip
# Name, causality, variability, start or None, unit, further attributes of Real.
VARIABLES = (
    ("f", "input", "continuous", 0.0, "N", ""),
    ("x", "output", "continuous", None, "m", ""),
    ("v", "output", "continuous", None, "m/s", ""),
    ("m", "parameter", "tunable", 2.0, "kg", 'min="0.1"'),
    ("c", "parameter", "fixed", 10.0, "N/m", 'min="0" max="100"'),
    ("d", "parameter", "tunable", 1.0, "N.s/m", 'min="0"'),
    ("x0", "parameter", "fixed", 0.0, "m", ""),
    ("v0", "parameter", "fixed", 0.0, "m/s", ""),
    ("c3", "parameter", "fixed", 0.0, "N/m3", ""),
    ("unused", "parameter", "fixed", 1.0, None, ""),
    ("a", "output", "continuous", None, "m/s2", ""),
)


def build_oscillator(folder, name="oscillator", habit="", left_out=()):
    """Path of the compiled FMU.

    Args:
        folder: where to work.
        name: of the file.
        habit: C statements at the start of fmi2DoStep, by the values ``p[F]``, ``p[C]`` and so on.
        left_out: variables that its description does not have.
    """
    (folder / f"{name}.c").write_text(SOURCE.replace("HABIT", habit))
    library = folder / f"{name}{fmpy.sharedLibraryExtension}"
    command = [ccode.COMPILER, "-O2", "-shared", "-fPIC", "-o", library, folder / f"{name}.c", "-lm"]
    subprocess.run(command, check=True)
    with zipfile.ZipFile(folder / f"{name}.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", described(left_out))
        archive.write(library, f"binaries/{fmpy.platform}/oscillator{fmpy.sharedLibraryExtension}")
    return folder / f"{name}.fmu"


def described(left_out=()):
    """The model description."""
    units = "".join(f'<Unit name="{n}"><BaseUnit {b}/></Unit>' for n, b in UNITS.items())
    lines, outputs = [], []
    for k, (name, causality, variability, start, unit, more) in enumerate(VARIABLES):
        if name in left_out:
            continue
        initial = (
            "" if causality == "input" else f'initial="{"calculated" if start is None else "exact"}"'
        )
        given = "" if start is None else f'start="{start}"'
        of = "" if unit is None else f'unit="{unit}"'
        lines.append(
            f'<ScalarVariable name="{name}" valueReference="{k}" causality="{causality}" '
            f'variability="{variability}" {initial}><Real {given} {of} {more}/></ScalarVariable>'
        )
        if causality == "output":
            outputs.append(f'<Unknown index="{len(lines)}"/>')
    listed = "".join(outputs)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<fmiModelDescription fmiVersion="2.0" modelName="oscillator" guid="{o}">'
        '<CoSimulation modelIdentifier="oscillator" canHandleVariableCommunicationStepSize="true"/>'
        f"<UnitDefinitions>{units}</UnitDefinitions><ModelVariables>{''.join(lines)}</ModelVariables>"
        f"<ModelStructure><Outputs>{listed}</Outputs><InitialUnknowns>{listed}</InitialUnknowns>"
        "</ModelStructure></fmiModelDescription>"
    )
