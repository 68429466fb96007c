/* Steps an FMU from its library alone: LIBRARY GUID FIRST_INPUT INPUTS OUTPUTS ROWS STEP.

   Rows of inputs come from the standard input; the outputs after a step with each go to the standard output,
   written so that they read back to the bit. Says at the end whether Python is in this process. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#include <windows.h>
#define LOAD(path) ((void *)LoadLibraryA(path))
#define FIND(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#define LOAD(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
#endif

enum { MOST = 1000 };

typedef struct {
    void *logger, *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished, *environment;
} Callbacks;

static void *library;

static void *function(const char *name) {
    void *found = FIND(library, name);
    if (!found) printf("no %s\n", name), exit(2);
    return found;
}

static void tell_python(void) {
#if !defined(_WIN32)
    char line[4096];
    int python = 0;
    FILE *mapped = fopen("/proc/self/maps", "r");
    if (mapped) {
        while (fgets(line, sizeof line, mapped)) python |= strstr(line, "libpython") || strstr(line, "bin/python");
        puts(python ? "Python is in this process" : "no Python in this process");
        return;
    }
#endif
    puts("what is mapped cannot be read here");
}

int main(int count, char **arguments) {
    Callbacks callbacks = {NULL, calloc, free, NULL, NULL};
    unsigned read_from[MOST], written_to[MOST];
    double row[MOST], outputs[MOST], h;
    int k, first, inputs, shown, rows, step;
    void *(*instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
    int (*call)(void *), (*set)(void *, const unsigned *, size_t, const double *);
    int (*get)(void *, const unsigned *, size_t, double *), (*do_step)(void *, double, double, int);
    void *instance;

    if (count < 8 || !(library = LOAD(arguments[1]))) return puts("no library"), 2;
    first = atoi(arguments[3]), inputs = atoi(arguments[4]), shown = atoi(arguments[5]);
    rows = atoi(arguments[6]), h = atof(arguments[7]);
    if (inputs > MOST || shown > MOST) return puts("too many variables"), 2;
    for (k = 0; k < inputs; k++) written_to[k] = first + k;
    for (k = 0; k < shown; k++) read_from[k] = first + inputs + k;
    instantiate = function("fmi2Instantiate");
    set = function("fmi2SetReal"), get = function("fmi2GetReal"), do_step = function("fmi2DoStep");
    if (!(instance = instantiate("instance", 1, arguments[2], "", &callbacks, 0, 0))) return 3;
    for (step = 0; step < rows; step++) {
        for (k = 0; k < inputs; k++)
            if (scanf("%lf", row + k) != 1) return puts("too few numbers"), 2;
        if (set(instance, written_to, inputs, row)) return 4;
        if (step == 0) {
            call = function("fmi2EnterInitializationMode"), call(instance);
            call = function("fmi2ExitInitializationMode");
            if (call(instance)) return 5;
        }
        if (do_step(instance, h * step, h, 1)) return 6;
        if (get(instance, read_from, shown, outputs)) return 7;
        for (k = 0; k < shown; k++) printf("%.17g%c", outputs[k], k + 1 < shown ? ' ' : '\n');
    }
    ((void (*)(void *))function("fmi2FreeInstance"))(instance);
    tell_python();
    return 0;
}
