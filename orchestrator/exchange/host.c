/* A co-simulation program in C: runs FMI 2.0 FMUs, and writes all their ports.
 *
 * usage: host STEPS TABLE
 *
 * Needs only the C library. stepper.c makes the steps; what is run stands in plan.h, which c_host.py
 * writes.
 */
#include "../master/stepper.c"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#ifdef _WIN32
#define OPEN(path) ((void *)LoadLibraryA(path))
#define FIND(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
#endif

enum { CO_SIMULATION = 1 };

/* What one member of a stage does with an FMU. */
typedef struct {
    size_t of;
    int sets, steps, gets;
} action;

/* Seconds that no run takes. */
static const double NO_LIMIT = 1e9;

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} callbacks;

typedef struct {
    const char *name, *guid, *resources, *path;
    move inputs, outputs; /* of Reals */
    void *library, *instance;
} fmu;

static void fail(const char *what, const char *of) {
    fprintf(stderr, "%s: %s\n", of, what);
    exit(1);
}

static void check(int status, const char *call, const fmu *of) {
    if (is_bad(status)) {
        fprintf(stderr, "%s: %s: status %d\n", of->name, call, status);
        exit(1);
    }
}

static void log_message(void *environment, const char *instance, int status, const char *category,
                        const char *message, ...) {
    va_list arguments;
    (void)environment;
    fprintf(stderr, "%s, status %d, %s: ", instance, status, category);
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

static void *function(const fmu *of, const char *name) {
    void *found = FIND(of->library, name);
    if (found == NULL) fail("is missing", name);
    return found;
}

/* FMI functions of the set-up, which are looked up where they are called. */
#define CALL(of, name, parameters, ...)                                                          \
    do {                                                                                         \
        int(*called) parameters;                                                                 \
        *(void **)&called = function(of, name);                                                  \
        check(called(__VA_ARGS__), name, of);                                                    \
    } while (0)

static inline void set_real(const fmu *of, reference number, double value) {
    check(of->inputs.call.fmi2(of->instance, &number, 1, &value), "fmi2SetReal", of);
}

static inline void set_integer(const fmu *of, const char *name, reference number, int value) {
    CALL(of, name, (void *, const reference *, size_t, const int *), of->instance, &number, 1,
         &value);
}

static inline void set_string(const fmu *of, reference number, const char *value) {
    CALL(of, "fmi2SetString", (void *, const reference *, size_t, const char *const *),
         of->instance, &number, 1, &value);
}

#include "plan.h"

static void load(fmu *of) {
    static const callbacks functions = {log_message, calloc, free, NULL, NULL};
    void *(*instantiate)(const char *, int, const char *, const char *, const callbacks *, int, int);
    of->library = OPEN(of->path);
    if (of->library == NULL) fail("cannot be loaded", of->path);
    *(void **)&instantiate = function(of, "fmi2Instantiate");
    *(void **)&of->inputs.call.fmi2 = function(of, "fmi2SetReal");
    *(void **)&of->outputs.call.fmi2 = function(of, "fmi2GetReal");
    of->instance = instantiate(of->name, CO_SIMULATION, of->guid, of->resources, &functions, 0, 1);
    if (of->instance == NULL) fail("no instance", of->name);
}

static void assign(const action *what, member *to) {
    const fmu *of = &fmus[what->of];
    if (what->steps) *(void **)&to->do_step.fmi2 = function(of, "fmi2DoStep");
    to->component = of->instance;
    to->inputs = &of->inputs;
    to->outputs = &of->outputs;
    to->n_inputs = what->sets && of->inputs.n > 0;
    to->n_outputs = what->gets && of->outputs.n > 0;
}

static void read_reals(const fmu *of, const move *ports) {
    if (ports->n > 0)
        check(get(ports, of->instance), "fmi2GetReal", of);
}

static void exchange(void) {
    gather(&connections, row);
    for (size_t i = 0; i < FMUS; i++) {
        const fmu *of = &fmus[i];
        if (of->inputs.n > 0) check(set(&of->inputs, of->instance), "fmi2SetReal", of);
        read_reals(of, &of->outputs);
    }
}

/* What follows from what at the start time comes to rest in as many exchanges as there are FMUs. */
static void initialise(double stop_time) {
    for (size_t i = 0; i < FMUS; i++) load(&fmus[i]);
    for (size_t i = 0; i < MEMBERS; i++) assign(&actions[i], &members[i]);
    set_parameters();
    for (size_t i = 0; i < FMUS; i++) {
        const fmu *of = &fmus[i];
        CALL(of, "fmi2SetupExperiment", (void *, int, double, double, int, double), of->instance,
             0, 0.0, START, 1, stop_time);
        CALL(of, "fmi2EnterInitializationMode", (void *), of->instance);
        read_reals(of, &of->inputs);
    }
    for (size_t i = 0; i <= FMUS; i++) exchange();
    for (size_t i = 0; i < FMUS; i++)
        CALL(&fmus[i], "fmi2ExitInitializationMode", (void *), fmus[i].instance);
    exchange();
}

static void add_row(block *table, double time) {
    double *last = table->rows + table->n++ * (1 + COLUMNS);
    last[0] = time;
    memcpy(last + 1, row, COLUMNS * sizeof *row);
}

/* Make all steps. A row shows the end of one, or what has passed before the next. */
static void make_steps(const run *this, block *rows) {
    static const char *const calls[] = {"fmi2SetReal", "fmi2DoStep", "fmi2GetReal"};
    const int shown_at_end = this->shown_after == this->n_stages;
    failure why;
    size_t made = 0;
    int outcome;
    if (shown_at_end) add_row(rows, START);
    outcome = advance(this, &made, this->steps, NO_LIMIT, rows, &why);
    if (outcome == DUE && !shown_at_end) {
        if (stages_failed(this, 0, this->shown_after, made, &why)) outcome = FAILED;
        else if (!all_finite(row, COLUMNS)) outcome = NOT_FINITE;
        add_row(rows, this->stop_time);
    }
    if (outcome == FAILED) {
        const member *it = &this->stages[why.stage].members[why.member];
        check(why.status, calls[why.call], &fmus[actions[it - members].of]);
    }
    if (outcome == NOT_FINITE) fail("a value is not finite", "row");
}

static void write_table(const char *path, const block *table) {
    const double *value = table->rows;
    FILE *file = fopen(path, "w");
    if (file == NULL) fail("cannot be written", path);
    fputs(header, file);
    for (size_t k = 0; k < table->n; k++) {
        fprintf(file, "\n%.17g", *value++);
        for (size_t i = 0; i < COLUMNS; i++) fprintf(file, ",%.17g", *value++);
    }
    fputc('\n', file);
    if (fclose(file) != 0) fail("cannot be written", path);
}

static void end(void) {
    for (size_t i = 0; i < FMUS; i++) {
        void (*release)(void *);
        CALL(&fmus[i], "fmi2Terminate", (void *), fmus[i].instance);
        *(void **)&release = function(&fmus[i], "fmi2FreeInstance");
        release(fmus[i].instance);
    }
}

int main(int n_arguments, char **arguments) {
    const size_t n = sizeof stages / sizeof *stages;
    run all = {stages, row, n, SHOWN_AFTER, COLUMNS, START, STEP, 0.0, 0, 0};
    block table = {NULL, 0, 0};
    clock_t start;
    if (n_arguments != 3) fail("usage: host STEPS TABLE", "host");
    all.full_steps = all.steps = strtoul(arguments[1], NULL, 10);
    all.stop_time = START + (double)all.steps * STEP;
    table.most = all.steps + 1;
    table.rows = calloc(table.most, (1 + COLUMNS) * sizeof *table.rows);
    if (table.rows == NULL) fail("too many rows", arguments[1]);
    initialise(all.stop_time);
    start = clock();
    make_steps(&all, &table);
    start = clock() - start;
    write_table(arguments[2], &table);
    free(table.rows);
    end();
    printf("%.9g\n", (double)start / CLOCKS_PER_SEC);
    return 0;
}
