/* Runs the vessel of a native FMU: LIBRARY GUID FIRST_INPUT. Prints its pose after 1000 steps, and whether Python is here. */

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    void *logger, *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished, *environment;
} Callbacks;

static void *library;

static void *function(const char *name) {
    void *found = dlsym(library, name);
    if (!found) printf("no %s\n", name), exit(2);
    return found;
}

int main(int count, char **arguments) {
    Callbacks callbacks = {NULL, calloc, free, NULL, NULL};
    unsigned inputs[3], outputs[3];
    double forces[3] = {0.5, 0.1, -0.02}, pose[3];
    char line[4096];
    int k, python = 0;
    FILE *mapped;
    void *(*instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
    int (*call)(void *), (*set)(void *, const unsigned *, size_t, const double *);
    int (*get)(void *, const unsigned *, size_t, double *), (*step)(void *, double, double, int);
    void *vessel;

    if (count < 4 || !(library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL))) return printf("%s\n", dlerror()), 2;
    for (k = 0; k < 3; k++) inputs[k] = atoi(arguments[3]) + k, outputs[k] = inputs[k] + 3;
    instantiate = function("fmi2Instantiate");
    set = function("fmi2SetReal"), get = function("fmi2GetReal"), step = function("fmi2DoStep");
    if (!(vessel = instantiate("vessel", 1, arguments[2], "", &callbacks, 0, 0))) return 3;
    if (set(vessel, inputs, 3, forces)) return 4;
    call = function("fmi2EnterInitializationMode"), call(vessel);
    call = function("fmi2ExitInitializationMode");
    if (call(vessel)) return 5;
    for (k = 0; k < 1000; k++)
        if (step(vessel, 0.01 * k, 0.01, 1)) return 6;
    if (get(vessel, outputs, 3, pose)) return 7;
    for (k = 0; k < 3; k++) printf("%.17g\n", pose[k]);
    ((void (*)(void *))function("fmi2FreeInstance"))(vessel);

    if (!(mapped = fopen("/proc/self/maps", "r"))) return puts("what is mapped cannot be read here"), 0;
    while (fgets(line, sizeof line, mapped)) python |= strstr(line, "libpython") || strstr(line, "bin/python");
    puts(python ? "Python is in this process" : "no Python in this process");
    return 0;
}
