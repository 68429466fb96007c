/* The step loop of the master in C: the same calls and the same arithmetic in the same order as in Python
   (cosim/master/stepper.py, cosim/scenario/operations.py), so that every value is the same to the bit.

   What depends on time and chance comes planned, for each call of an operation: whether it acts, and with which
   numbers. The structures are those of cosim/master/layout.py. */

#define _POSIX_C_SOURCE 199309L /* clock_gettime */
#include <math.h>
#include <stdint.h>
#include <string.h>

#if defined(_WIN32)
#include <windows.h>
#define EXPORT __declspec(dllexport)
static double now(void) {
    LARGE_INTEGER count, rate;
    QueryPerformanceCounter(&count);
    QueryPerformanceFrequency(&rate);
    return (double)count.QuadPart / (double)rate.QuadPart;
}
#else
#include <time.h>
#define EXPORT __attribute__((visibility("default")))
#if defined(CLOCK_MONOTONIC_COARSE) /* some ms, read in a few ns: that is a block's patience to the percent */
#define CLOCK CLOCK_MONOTONIC_COARSE
#else
#define CLOCK CLOCK_MONOTONIC
#endif
static double now(void) {
    struct timespec at;
    clock_gettime(CLOCK, &at);
    return (double)at.tv_sec + 1e-9 * (double)at.tv_nsec;
}
#endif

#define DISCARD 2             /* of fmi2Status: it and what is worse ends the block */
#define CALLS 8               /* places behind ``called``, of cosim/process/run_state.py */
#define NOT_32_BIT (-1)       /* in place of a status: a value that is no fmi2Integer */
#define LIMIT 2147483648.0    /* 2**31 */
#define TWO_PI 6.283185307179586 /* as 2.0 * math.pi in Python */
#define PI 3.141592653589793

/* Codes of cosim/scenario/operations.py. */
enum { ADD, SET, HOLD, DELAY, WRAP, CONVERT };
/* Why a block ended. */
enum { AT_END, FULL, DUE, PUT, STEP, GET };

typedef struct {
    int64_t code, count;
    const int64_t *slots;
    const uint8_t *acts;  /* for each call; NULL: always */
    const double *numbers;
    int64_t stride;       /* numbers from one call to the next; 0: the same for all */
    int64_t *cursor;      /* of the next call */
    int64_t samples;      /* of a delay */
    double *memory;       /* values of before: held, or on their way */
    int64_t *calls;       /* so far, of operations with a memory */
    const int64_t *sources;
} Operation;

typedef struct {
    int64_t target, source, count;
} Copy;

typedef struct {
    int (*function)(void *, const uint32_t *, size_t, void *);
    const uint32_t *references;
    int64_t count;
    void *values;         /* doubles of the table, or a buffer of integers */
    const int64_t *slots; /* of the buffer; NULL: doubles */
} Transfer;

typedef struct {
    void *component;
    int64_t number, every;
    double h;
    int (*do_step)(void *, double, double, int);
    int (*save)(void *, void **); /* NULL: a step is never repeated */
    void **state;
    int64_t copies, inputs, outputs, sets, gets;
    const Copy *copied;
    Operation *on_inputs, *on_outputs;
    const Transfer *set, *get;
} Fmu;

typedef struct {
    double *table;
    int64_t width, fmus, jacobi;
    Fmu *fmu;
    const double *times; /* of base steps from ``first`` on */
    int64_t first;
    double *instants, *rows; /* what is not in the log yet */
    int64_t *finite;         /* how many rows, from the first on, hold nothing but finite numbers */
    volatile int32_t *called, *taken; /* of cosim/process/run_state.py: the FMU that is called (and the step,
                                         at CALLS), rows so far */
    int64_t room;                /* for rows */
    double patience;             /* wall time of a block [s] */
    int64_t step, index, status, saved; /* out: base steps done; where and with what it ended early */
} Loop;

static void apply(Operation *operation, double *table) {
    const int64_t n = operation->count, *slots = operation->slots;
    const int64_t call = (*operation->cursor)++;
    const int acts = !operation->acts || operation->acts[call];
    const double *numbers = operation->numbers + call * operation->stride;
    int64_t k;
    switch (operation->code) {
    case ADD:
        if (acts)
            for (k = 0; k < n; k++) table[slots[k]] += numbers[k];
        break;
    case SET:
        if (acts)
            for (k = 0; k < n; k++) table[slots[k]] = numbers[k];
        break;
    case HOLD:
        if (acts && *operation->calls) {
            for (k = 0; k < n; k++) table[slots[k]] = operation->memory[k];
        } else {
            for (k = 0; k < n; k++) operation->memory[k] = table[slots[k]];
            *operation->calls = 1;
        }
        break;
    case DELAY: {
        const int64_t c = (*operation->calls)++, length = operation->samples + 1;
        double *written = operation->memory + c % length * n;
        const double *late = operation->memory + (c <= operation->samples ? 0 : (c - operation->samples) % length) * n;
        for (k = 0; k < n; k++) written[k] = table[slots[k]];
        for (k = 0; k < n; k++) table[slots[k]] = late[k];
        break;
    }
    case WRAP:
        for (k = 0; k < n; k++) {
            const double angle = table[slots[k]], turns = (PI - angle) / TWO_PI;
            /* In Python the floor of an infinite number of turns is NaN. */
            table[slots[k]] = angle + TWO_PI * (turns - turns == 0.0 ? floor(turns) : turns - turns);
        }
        break;
    case CONVERT:
        for (k = 0; k < n; k++)
            table[slots[k]] = numbers[2 * k] * table[operation->sources[k]] + numbers[2 * k + 1];
        break;
    }
}

static int set_all(const Fmu *fmu, const double *table) {
    int64_t i, k;
    for (i = 0; i < fmu->sets; i++) {
        const Transfer *set = fmu->set + i;
        int status;
        if (set->slots) {
            int32_t *buffer = set->values;
            for (k = 0; k < set->count; k++) {
                const double value = table[set->slots[k]];
                if (!(value >= -LIMIT - 0.5 && value < LIMIT - 0.5)) return NOT_32_BIT; /* rounding is to even */
                buffer[k] = (int32_t)nearbyint(value);
            }
        }
        status = set->function(fmu->component, set->references, (size_t)set->count, set->values);
        if (status >= DISCARD) return status;
    }
    return 0;
}

static int get_all(const Fmu *fmu, double *table) {
    int64_t i, k;
    for (i = 0; i < fmu->gets; i++) {
        const Transfer *get = fmu->get + i;
        const int status = get->function(fmu->component, get->references, (size_t)get->count, get->values);
        if (get->slots)
            for (k = 0; k < get->count; k++) table[get->slots[k]] = (double)((const int32_t *)get->values)[k];
        if (status >= DISCARD) return status;
    }
    return 0;
}

/* Newest values on their way to the inputs; a status. */
static int exchange(const Fmu *fmu, double *table) {
    int64_t k, i;
    for (k = 0; k < fmu->copies; k++) {
        const Copy *copy = fmu->copied + k;
        /* From outputs to inputs, a few numbers each: a function's call would take longer. */
        for (i = 0; i < copy->count; i++) table[copy->target + i] = table[copy->source + i];
    }
    for (k = 0; k < fmu->inputs; k++) apply(fmu->on_inputs + k, table);
    return set_all(fmu, table);
}

/* A step and its outputs; why it ended the block, or 0. */
static int advance(Loop *loop, const Fmu *fmu, double t) {
    int64_t k;
    int status;
    loop->saved = fmu->save && fmu->save(fmu->component, fmu->state) < DISCARD;
    /* The last argument promises that the state will not be restored. */
    status = fmu->do_step(fmu->component, t, fmu->h, !loop->saved);
    if (status >= DISCARD) {
        loop->status = status;
        return STEP;
    }
    if ((status = get_all(fmu, loop->table)) >= DISCARD) {
        loop->status = status;
        return GET;
    }
    for (k = 0; k < fmu->outputs; k++) apply(fmu->on_outputs + k, loop->table);
    return 0;
}

static int one_step(Loop *loop, int64_t step) {
    const double *times = loop->times - loop->first;
    int64_t i;
    int why, status;
    loop->called[CALLS] = (int32_t)step;
    for (i = 0; i < loop->fmus; i++) {
        const Fmu *fmu = loop->fmu + i;
        if (step % fmu->every) continue;
        loop->index = i;
        *loop->called = (int32_t)fmu->number;
        if ((status = exchange(fmu, loop->table))) {
            loop->status = status;
            return PUT;
        }
        if (!loop->jacobi && (why = advance(loop, fmu, times[step - fmu->every]))) return why;
    }
    if (loop->jacobi)
        for (i = 0; i < loop->fmus; i++) {
            const Fmu *fmu = loop->fmu + i;
            if (step % fmu->every) continue;
            loop->index = i;
            *loop->called = (int32_t)fmu->number;
            if ((why = advance(loop, fmu, times[step - fmu->every]))) return why;
        }
    return 0;
}

/* Copy numbers; whether all are finite. Their exponents are looked at as whole numbers, several at once: one more
   in an exponent of nothing but ones, that of infinities and NaN, is carried into the bit of the sign. */
static int copy_row(double *restrict to, const double *restrict from, int64_t n) {
    uint64_t carried = 0;
    int64_t k;
    for (k = 0; k < n; k++) {
        uint64_t bits;
        memcpy(&bits, from + k, sizeof bits);
        memcpy(to + k, &bits, sizeof bits);
        carried |= (bits & 0x7ff0000000000000u) + 0x0010000000000000u;
    }
    return !(carried >> 63);
}

/* Base steps up to ``last``, each with its row; returns why it ended. */
EXPORT int run_block(Loop *loop, int64_t last) {
    const double end = now() + loop->patience;
    while (loop->step < last) {
        const int64_t step = loop->step + 1;
        const int why = one_step(loop, step);
        int32_t taken;
        if (why) return why;
        taken = *loop->taken;
        if (copy_row(loop->rows + taken * loop->width, loop->table, loop->width) && *loop->finite == taken)
            *loop->finite = taken + 1;
        loop->instants[taken] = loop->times[step - loop->first];
        *loop->taken = taken + 1;
        loop->step = step;
        if (taken + 1 >= loop->room) return FULL;
        if (now() > end) return DUE;
    }
    return AT_END;
}

/* Sizes of the structures, for a check of their layout in Python. */
EXPORT int64_t layout(int64_t which) {
    const int64_t sizes[] = {sizeof(Operation), sizeof(Copy), sizeof(Transfer), sizeof(Fmu), sizeof(Loop)};
    return sizes[which];
}
