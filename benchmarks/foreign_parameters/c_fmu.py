"""FMUs in C, written from FMI 2.0's standard alone, for systems that are given by their equations."""

import shutil
import subprocess
import sys
import zipfile
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import fmpy

SOURCE = r"""
#include <math.h>
#include <stdlib.h>
#include <stdio.h>
#include <string.h>
enum { NAMES, COUNT };
typedef struct { double v[COUNT]; } Instance;
static const double START[] = { VALUES };
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const k[]) { return 0; }
int fmi2Reset(void *c) { memcpy(c, START, sizeof START); return 0; }
void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                      const void *callbacks, int visible, int logging) {
    void *c = malloc(sizeof(Instance)); fmi2Reset(c); return c;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int t, double tol, double start, int s, double stop) { return 0; }
static void slope(double *p) { EQUATIONS }
int fmi2EnterInitializationMode(void *c) { double *p = c; BEGIN return 0; }
int fmi2ExitInitializationMode(void *c) { slope(c); return 0; }
int fmi2Terminate(void *c) { return 0; }
int fmi2GetReal(void *c, const unsigned r[], size_t n, double v[]) {
    double *p = c;
    for (size_t k = 0; k < n; k++) { if (r[k] >= COUNT) return 3; v[k] = p[r[k]]; }
    return 0;
}
int fmi2SetReal(void *c, const unsigned r[], size_t n, const double v[]) {
    double *p = c;
    for (size_t k = 0; k < n; k++) { if (r[k] >= COUNT) return 3; p[r[k]] = v[k]; }
    return 0;
}
int fmi2GetInteger(void *c, const unsigned r[], size_t n, int v[]) { return 3; }
int fmi2SetInteger(void *c, const unsigned r[], size_t n, const int v[]) { return 3; }
int fmi2GetBoolean(void *c, const unsigned r[], size_t n, int v[]) { return 3; }
int fmi2SetBoolean(void *c, const unsigned r[], size_t n, const int v[]) { return 3; }
int fmi2GetString(void *c, const unsigned r[], size_t n, const char *v[]) { return 3; }
int fmi2SetString(void *c, const unsigned r[], size_t n, const char *const v[]) { return 3; }
int fmi2DoStep(void *c, double t, double h, int no_set) { /* Runge and Kutta, fourth order */
    double *p = c, a[] = {0.5, 0.5, 1.0, 0.0}, b[] = {1.0, 2.0, 2.0, 1.0};
    HABIT
    int n = (int)ceil(h / 0.01 - 1e-9); double d = h / n;
    for (int k = 0; k < n; k++) {
        double x[STATES], sum[STATES] = {0};
        memcpy(x, p + FIRST, sizeof x);
        for (int j = 0; j < 4; j++) {
            slope(p);
            for (int i = 0; i < STATES; i++) {
                sum[i] += b[j] / 6 * p[RATE + i]; p[FIRST + i] = x[i] + a[j] * d * p[RATE + i];
            }
        }
        for (int i = 0; i < STATES; i++) p[FIRST + i] = x[i] + d * sum[i];
    }
    slope(p);
    return 0;
}
int fmi2CancelStep(void *c) { return 3; }
int fmi2GetStatus(void *c, int k, int *v) { return 2; }
int fmi2GetRealStatus(void *c, int k, double *v) { return 2; }
int fmi2GetIntegerStatus(void *c, int k, int *v) { return 2; }
int fmi2GetBooleanStatus(void *c, int k, int *v) { return 2; }
int fmi2GetStringStatus(void *c, int k, const char **v) { return 2; }
int fmi2SetRealInputDerivatives(void *c, const unsigned v[], size_t n, const int o[],
                                const double x[]) { return 3; }
int fmi2GetRealOutputDerivatives(void *c, const unsigned v[], size_t n, const int o[],
                                 double x[]) { return 3; }
int fmi2GetFMUstate(void *c, void **s) { return 3; }
int fmi2SetFMUstate(void *c, void *s) { return 3; }
int fmi2FreeFMUstate(void *c, void **s) { return 3; }
int fmi2SerializedFMUstateSize(void *c, void *s, size_t *n) { return 3; }
int fmi2SerializeFMUstate(void *c, void *s, char b[], size_t n) { return 3; }
int fmi2DeSerializeFMUstate(void *c, const char b[], size_t n, void **s) { return 3; }
int fmi2GetDirectionalDerivative(void *c, const unsigned u[], size_t nu, const unsigned k[], size_t nk,
                                 const double dk[], double du[]) { return 3; }
"""
BASES = ("kg", "m", "s", "A", "K")
UNITS = {
    "N": (1, 1, -2), "m": (0, 1), "m/s": (0, 1, -1), "kg": (1,), "N/m": (1, 0, -2), "N.s/m": (1, 0, -1),
    "N/m3": (1, -2, -2), "m/s2": (0, 1, -2), "rad": (), "rad/s": (0, 0, -1), "rad/s2": (0, 0, -2),
    "N.m": (1, 2, -2), "N.m.s": (1, 2, -1), "kg.m2": (1, 2), "Ohm": (1, 2, -3, -2), "H": (1, 2, -2, -2),
    "V": (1, 2, -3, -1), "A": (0, 0, 0, 1), "N.m/A": (1, 2, -2, -1), "K": (0, 0, 0, 0, 1),
    "K/s": (0, 0, -1, 0, 1), "W": (1, 2, -3), "W/K": (1, 2, -3, 0, -1), "J/K": (1, 2, -2, 0, -1),
    "m2": (0, 2), "m3/s": (0, 3, -1), "A/s": (0, 0, -1, 1), "N.s2/m": (1,), "1": (),
}  # fmt: skip


class Quantity(NamedTuple):
    """A variable: its start value, its unit, and further attributes of its element ``Real``."""

    start: float
    unit: str
    more: str = ""


class CSystem(NamedTuple):
    """A system by its equations.

    Attributes:
        inputs, states, parameters: name -> quantity; a state ``x`` is an output, has the start value
            ``x0`` and the rate ``der_x``, which is an output, too.
        equations: C statements for the rates, by the names.
    """

    inputs: Mapping[str, Quantity]
    states: Mapping[str, Quantity]
    parameters: Mapping[str, Quantity]
    equations: str


def compiler() -> list[str]:
    """The command of a C compiler; empty: there is none."""
    for name in ("cc", "gcc", "clang"):
        if found := shutil.which(name):
            return [found]
    return [sys.executable, "-m", "ziglang", "cc"] if find_spec("ziglang") else []


def build_c_fmu(
    folder: Path, name: str, system: CSystem, habit: str = "", left_out: Sequence[str] = ()
) -> Path:
    """Path of the compiled FMU of a system.

    Args:
        folder: where to work.
        name: of the file.
        system: its equations.
        habit: C statements at the start of a step, by the values ``p[V_name]``.
        left_out: variables that its description does not have.
    """
    rates = {f"der_{n}": Quantity(0.0, _rate(q.unit)) for n, q in system.states.items()}
    starts = {f"{n}0": q for n, q in system.states.items()}
    roles = [
        ("input", system.inputs), ("output", system.states), ("output", rates),
        ("parameter", system.parameters), ("parameter", starts),
    ]  # fmt: skip
    every = [(role, n, q) for role, group in roles for n, q in group.items()]
    names = [f"V_{n}" for _, n, _ in every]
    defines = "\n".join(f"#define {n} p[V_{n}]" for _, n, _ in every)
    first = next(iter(system.states))
    text = (
        SOURCE.replace("NAMES", ", ".join(names))
        .replace("VALUES", ", ".join(repr(q.start) for *_, q in every))
        .replace("STATES", str(len(system.states)))
        .replace("FIRST", f"V_{first}")
        .replace("RATE", f"V_der_{first}")
        .replace("BEGIN", " ".join(f"p[V_{n}] = p[V_{n}0];" for n in system.states))
        .replace("static void slope(double *p) {", f"{defines}\nstatic void slope(double *p) {{")
        .replace("EQUATIONS", system.equations)
        .replace("HABIT", habit)
    )
    # Names such as c and t are of the interface's arguments as well.
    undefines = "\n".join(f"#undef {n}" for _, n, _ in every)
    text = text.replace("int fmi2EnterInit", f"{undefines}\nint fmi2EnterInit", 1)
    source, library = folder / f"{name}.c", folder / f"{name}{fmpy.sharedLibraryExtension}"
    source.write_text(text)
    command = [*compiler(), "-O2", "-shared", "-fPIC", "-o", str(library), str(source), "-lm"]
    subprocess.run(command, check=True)
    path = folder / f"{name}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", _described(name, every, left_out))
        archive.write(library, f"binaries/{fmpy.platform}/{name}{fmpy.sharedLibraryExtension}")
    return path


def _rate(unit: str) -> str:
    return {"m": "m/s", "m/s": "m/s2", "rad": "rad/s", "rad/s": "rad/s2", "K": "K/s", "A": "A/s"}[unit]


def _described(name: str, every: Sequence[tuple[str, str, Quantity]], left_out: Sequence[str]) -> str:
    """The model description."""
    units = []
    for unit, exponents in UNITS.items():
        bases = " ".join(f'{b}="{e}"' for b, e in zip(BASES, exponents, strict=False) if e)
        units.append(f'<Unit name="{unit}"><BaseUnit {bases}/></Unit>')
    lines, outputs = [], []
    for k, (role, n, q) in enumerate(every):
        if n in left_out:
            continue
        output = role == "output"
        look = {
            "input": 'variability="continuous"',
            "output": 'variability="continuous" initial="calculated"',
            "parameter": 'variability="tunable" initial="exact"',
        }[role]
        start = "" if output else f'start="{q.start!r}"'
        lines.append(
            f'<ScalarVariable name="{n}" valueReference="{k}" causality="{role}" {look}>'
            f'<Real {start} unit="{q.unit}" {q.more}/></ScalarVariable>'
        )
        if output:
            outputs.append(f'<Unknown index="{len(lines)}"/>')
    listed = "".join(outputs)
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{{{name}}}">'
        f'<CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true"/>'
        f"<UnitDefinitions>{''.join(units)}</UnitDefinitions>"
        f"<ModelVariables>{''.join(lines)}</ModelVariables>"
        f"<ModelStructure><Outputs>{listed}</Outputs><InitialUnknowns>{listed}</InitialUnknowns>"
        "</ModelStructure></fmiModelDescription>"
    )
