/* The FMI 2.0 co-simulation face of a component whose functions and tables "tables.h" declares.

   It behaves as the project's Python face does (fmus/fmi/slave.py): a value that is out of place is told and
   changes nothing; a step that fails is told with its cause and leaves the state as it was.
   All that an instance knows lies in one block of memory, so that instances do not meet. */

#include <math.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tables.h"

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

/* What FMI 2.0.4 defines in fmi2TypesPlatform.h and fmi2FunctionTypes.h. */
typedef void *fmi2Component;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Char;
typedef const fmi2Char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct {
    void (*logger)(void *, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(void *, fmi2Status);
    void *componentEnvironment;
} fmi2CallbackFunctions;

#define FIRST_OUTPUT (PARAMS + INPUTS)
#define VARIABLES (FIRST_OUTPUT + OUTPUTS)
#define AT_LEAST_ONE(n) ((n) > 0 ? (n) : 1) /* C has no empty arrays */
#define MOST_PARTS 100000 /* of a long communication step; beyond, somebody has mistaken a unit */

static const char *const categories[] = {"logStatusWarning", "logStatusError", "logAll"};
enum { WARNING, ERROR, ALL, CATEGORIES };

/* What fmi2GetFMUstate saves. */
typedef struct {
    double values[AT_LEAST_ONE(FIRST_OUTPUT)];
    double outputs[AT_LEAST_ONE(OUTPUTS)];
    double state[AT_LEAST_ONE(STATES)];
    double reached;
    int initialising;
} Saved;

typedef struct {
    double values[AT_LEAST_ONE(FIRST_OUTPUT)]; /* parameters, then inputs, in the order of the value references */
    double prepared[AT_LEAST_ONE(PREPARED)];
    /* A step writes where nothing of the present state lies, so that one that fails leaves that as it is. */
    double outputs[2][AT_LEAST_ONE(OUTPUTS)];
    double states[3][AT_LEAST_ONE(STATES)];
    int shown, current; /* which of them are the present ones */
    int initialising;
    int is_prepared; /* prepared belongs to the present parameters */
    int stale;       /* state and outputs do not belong to the present start values */
    int failed;      /* no state follows from the start values */
    double reached;  /* end of the last step that succeeded [s] */
    int logs[CATEGORIES];
    void (*logger)(void *, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
    void *environment;
    char name[1]; /* goes on behind the end */
} Instance;

/* The saved state as bytes: this, then Saved. */
#define STATE_VERSION 1
typedef struct {
    char guid[64];
    uint32_t version;
    uint32_t size;
    uint64_t checksum;
} Header;

/* FNV-1a of 64 bits (Fowler, Noll, Vo): one byte that is another one always changes it. */
static uint64_t checksum(const void *data, size_t size) {
    const unsigned char *bytes = data;
    uint64_t sum = 0xcbf29ce484222325u;
    size_t k;
    for (k = 0; k < size; k++) sum = (sum ^ bytes[k]) * 0x100000001b3u;
    return sum;
}

static void tell(Instance *m, fmi2Status status, const char *format, ...) {
    int category = status == fmi2Warning ? WARNING : status == fmi2OK ? ALL : ERROR;
    char text[1024];
    va_list arguments;
    if (!m->logger || !m->logs[category]) return;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    /* The text is the format: it holds no "%", and many a host does not read what would follow. */
    m->logger(m->environment, m->name, status, categories[category], text);
}

static int is_finite(double x) { return x - x == 0.0; }

static double *params(Instance *m) { return m->values; }
static double *inputs(Instance *m) { return m->values + PARAMS; }
/* What the next step writes. */
static double *new_outputs(Instance *m) { return m->outputs[1 - m->shown]; }

static void start(Instance *m) {
    memset(m->values, 0, sizeof m->values);
    memset(m->outputs, 0, sizeof m->outputs);
    memset(m->states, 0, sizeof m->states);
    model_starts(params(m), inputs(m));
    m->initialising = 1;
    m->stale = 1;
    m->failed = 0;
    m->is_prepared = 0;
    m->reached = 0.0;
    m->shown = m->current = 0;
}

static int prepare(Instance *m) {
    if (!m->is_prepared) {
        if (model_prepare(params(m), m->prepared)) return 1;
        m->is_prepared = 1;
    }
    return 0;
}

/* One communication step, in parts where it is too long for one; which array holds the state after it, -1 where
   it divides by zero. The present state stays as it is. */
static int advance(Instance *m, double h) {
    const int others[2] = {(m->current + 1) % 3, (m->current + 2) % 3};
    int state = m->current;
    long parts = 1, k;
    if (MAX_STEP > 0.0 && !(h <= MAX_STEP * (1.0 + 1e-9))) parts = (long)-floor(-h / MAX_STEP);
    for (k = 0; k < parts; k++) {
        const int after = others[k % 2];
        if (model_step(params(m), m->prepared, inputs(m), m->states[state], parts > 1 ? h / parts : h,
                       m->states[after], new_outputs(m)))
            return -1;
        state = after;
    }
    return state;
}

static void initialise(Instance *m) {
    m->stale = 0;
    m->failed = prepare(m) || model_init(params(m), inputs(m), m->states[m->current]) || advance(m, 0.0) < 0;
    if (m->failed)
        tell(m, fmi2Error, "initialisation failed: division by zero");
    else
        m->shown = 1 - m->shown;
}

static fmi2Status refuse(Instance *m, const char *what) {
    tell(m, fmi2Error, "%s", what);
    return fmi2Error;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) {
    Instance *m = c;
    size_t k;
    int i, every = on && (n == 0);
    for (i = 0; i < CATEGORIES; i++) m->logs[i] = every;
    for (k = 0; k < n; k++)
        for (i = 0; i < CATEGORIES; i++)
            if (on && !strcmp(names[k], categories[i])) m->logs[i] = 1;
    return fmi2OK;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean on) {
    Instance *m;
    (void)resources, (void)visible;
    if (!name) name = "";
    m = calloc(1, sizeof(Instance) + strlen(name));
    if (!m) return NULL;
    strcpy(m->name, name);
    if (callbacks) m->logger = callbacks->logger, m->environment = callbacks->componentEnvironment;
    m->logs[ERROR] = 1;
    if (type != fmi2CoSimulation || !guid || strcmp(guid, GUID)) {
        refuse(m, type != fmi2CoSimulation ? "this FMU is for co-simulation" : "the guid is that of another FMU");
        free(m);
        return NULL;
    }
    fmi2SetDebugLogging(m, on, 0, NULL);
    start(m);
    return m;
}

EXPORT void fmi2FreeInstance(fmi2Component c) { free(c); }

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerant, fmi2Real tolerance, fmi2Real begin,
                                      fmi2Boolean ends, fmi2Real end) {
    (void)tolerant, (void)tolerance, (void)ends, (void)end;
    ((Instance *)c)->reached = begin;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *m = c;
    if (m->stale) initialise(m);
    if (m->failed) return refuse(m, "initialisation failed: division by zero");
    m->initialising = 0;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c) {
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c) {
    start(c);
    return fmi2OK;
}

/* Four sums, so that none waits for the one before. */
static int all_finite(const double *values, size_t n) {
    double a = 0.0, b = 0.0, c = 0.0, d = 0.0;
    size_t k;
    for (k = 0; k + 3 < n; k += 4) {
        a += values[k] - values[k];
        b += values[k + 1] - values[k + 1];
        c += values[k + 2] - values[k + 2];
        d += values[k + 3] - values[k + 3];
    }
    for (; k < n; k++) a += values[k] - values[k];
    return a + b + c + d == 0.0;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Instance *m = c;
    const double *shown;
    size_t k;
    if (m->stale) initialise(m);
    shown = m->outputs[m->shown];
    for (k = 0; k < n; k++) {
        const fmi2ValueReference r = vr[k];
        if (r >= VARIABLES) return refuse(m, "there is no variable with this value reference");
        value[k] = r < FIRST_OUTPUT ? m->values[r] : shown[r - FIRST_OUTPUT];
    }
    return fmi2OK;
}

static fmi2Status set(Instance *m, fmi2ValueReference vr, double value) {
    if (vr >= FIRST_OUTPUT) {
        tell(m, fmi2Warning, "value reference %u cannot be set", vr);
    } else if (vr >= PARAMS) {
        if (!HOLD_NONFINITE || is_finite(value)) {
            m->values[vr] = value;
            return fmi2OK;
        }
        tell(m, fmi2Warning, "input %s is %g; it keeps its last value", names[vr], value);
    } else if (!is_finite(value)) {
        tell(m, fmi2Warning, "parameter %s cannot be %g", names[vr], value);
    } else if (fixed[vr] && !m->initialising) {
        tell(m, fmi2Warning, "parameter %s is fixed after initialisation", names[vr]);
    } else {
        m->values[vr] = value;
        m->is_prepared = 0;
        return fmi2OK;
    }
    return fmi2Warning;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    Instance *m = c;
    fmi2Status status = fmi2OK;
    size_t k;
    for (k = 0; k < n; k++)
        if (set(m, vr[k], value[k]) != fmi2OK) status = fmi2Warning;
    if (m->initialising) m->stale = 1;
    return status;
}

/* Variables of other types do not exist. */
static fmi2Status none(Instance *m, size_t n) { return n ? refuse(m, "all variables are Real") : fmi2OK; }

#define NO_VARIABLES(Type)                                                                                      \
    EXPORT fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2##Type v[]) { \
        (void)vr, (void)v;                                                                                      \
        return none(c, n);                                                                                      \
    }                                                                                                           \
    EXPORT fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference vr[], size_t n,                   \
                                    const fmi2##Type v[]) {                                                     \
        (void)vr, (void)v;                                                                                      \
        return none(c, n);                                                                                      \
    }
NO_VARIABLES(Integer)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_return) {
    Instance *m = c;
    const double *written;
    int k, after;
    (void)no_return;
    if (!(h >= 0.0 && is_finite(h))) {
        tell(m, fmi2Error, "step at t = %.15g s: %.15g s is not a valid step size", t, h);
        return fmi2Error;
    }
    if (m->initialising) return refuse(m, "a step needs a finished initialisation");
    if (MAX_STEP > 0.0 && h > MOST_PARTS * MAX_STEP) {
        tell(m, fmi2Error, "step at t = %.15g s failed: a step of %.15g s is too long: %.15g s are integrated at once",
             t, h, MAX_STEP);
        return fmi2Error;
    }
    after = prepare(m) ? -1 : advance(m, h);
    if (after < 0) {
        tell(m, fmi2Error, "step at t = %.15g s failed: division by zero", t);
        return fmi2Error;
    }
    written = new_outputs(m);
    if (!all_finite(written, OUTPUTS)) {
        char text[512] = "";
        for (k = 0; k < OUTPUTS; k++)
            if (!is_finite(written[k]) && strlen(text) + strlen(names[FIRST_OUTPUT + k]) + 3 < sizeof text)
                strcat(strcat(text, *text ? ", " : ""), names[FIRST_OUTPUT + k]);
        tell(m, fmi2Error, "step at t = %.15g s failed: %s not finite", t, text);
        return fmi2Error;
    }
    m->current = after;
    m->shown = 1 - m->shown;
    m->reached = t + h;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    Instance *m = c;
    Saved *saved;
    if (!*state) *state = calloc(1, sizeof(Saved));
    if (!(saved = *state)) return refuse(m, "out of memory");
    memcpy(saved->values, m->values, FIRST_OUTPUT * sizeof(double));
    memcpy(saved->outputs, m->outputs[m->shown], OUTPUTS * sizeof(double));
    memcpy(saved->state, m->states[m->current], STATES * sizeof(double));
    saved->reached = m->reached;
    saved->initialising = m->initialising;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    Instance *m = c;
    const Saved *saved = state;
    if (!saved) return refuse(m, "there is no state to set");
    memcpy(m->values, saved->values, FIRST_OUTPUT * sizeof(double));
    memcpy(m->outputs[m->shown], saved->outputs, OUTPUTS * sizeof(double));
    memcpy(m->states[m->current], saved->state, STATES * sizeof(double));
    m->reached = saved->reached;
    /* Before initialisation has ended, all follows from the start values. */
    m->initialising = m->stale = saved->initialising;
    m->is_prepared = m->failed = 0;
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(Header) + sizeof(Saved);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    Header header = {GUID, STATE_VERSION, sizeof(Saved), 0};
    if (!state || size < sizeof(Header) + sizeof(Saved)) return refuse(c, "the memory for a state is too small");
    header.checksum = checksum(state, sizeof(Saved));
    memcpy(bytes, &header, sizeof header);
    memcpy(bytes + sizeof header, state, sizeof(Saved));
    return fmi2OK;
}

EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                          fmi2FMUstate *state) {
    Header header = {"", 0, 0, 0};
    if (size >= sizeof(Header) + sizeof(Saved)) memcpy(&header, bytes, sizeof header);
    if (strncmp(header.guid, GUID, sizeof header.guid) || header.size != sizeof(Saved))
        return refuse(c, "these bytes are not a state of this FMU");
    if (header.version != STATE_VERSION) return refuse(c, "this state belongs to another version");
    if (header.checksum != checksum(bytes + sizeof header, sizeof(Saved)))
        return refuse(c, "this state was changed: its checksum differs");
    if (!*state) *state = malloc(sizeof(Saved));
    if (!*state) return refuse(c, "out of memory");
    memcpy(*state, bytes + sizeof header, sizeof(Saved));
    return fmi2OK;
}

/* What the description does not offer. */
EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference u[], size_t nu,
                                               const fmi2ValueReference k[], size_t nk, const fmi2Real dk[],
                                               fmi2Real du[]) {
    (void)u, (void)nu, (void)k, (void)nk, (void)dk, (void)du;
    return refuse(c, "derivatives are not supported");
}

EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                              const fmi2Integer order[], const fmi2Real value[]) {
    (void)vr, (void)n, (void)order, (void)value;
    return refuse(c, "derivatives are not supported");
}

EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                               const fmi2Integer order[], fmi2Real value[]) {
    (void)vr, (void)n, (void)order, (void)value;
    return refuse(c, "derivatives are not supported");
}

EXPORT fmi2Status fmi2CancelStep(fmi2Component c) { return refuse(c, "there is no step to cancel"); }

EXPORT fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
    if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = ((Instance *)c)->reached;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}

EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
    (void)c;
    if (kind != fmi2Terminated) return fmi2Discard;
    *value = 0;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
    (void)c, (void)kind, (void)value;
    return fmi2Discard;
}
