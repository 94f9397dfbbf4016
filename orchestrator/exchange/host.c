/* A co-simulation program in C: runs FMI 2.0 FMUs as a plan says, and writes all their ports.
 *
 * usage: host PLAN TABLE
 *
 * Needs nothing but the C library. c_host.py writes the plan, a line a fact:
 *
 *     step SECONDS, steps N                      of the run
 *     fmu NAME                                   begins an FMU; what follows is of it
 *     guid TEXT, library PATH, resources URI
 *     real|integer|boolean|string REFERENCE VALUE    a value before the initialisation
 *     input|output REFERENCE NAME                the next column of the table, a Real
 *     connect TARGET SOURCE                      columns, in the initialisation
 *     stage                                      begins a stage of every step
 *     gather TARGET SOURCE                       columns, before the FMUs of the stage are stepped
 *     member N                                   steps the FMU with this number
 */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#ifdef _WIN32
#include <windows.h>
#define OPEN(path) ((void *)LoadLibraryA(path))
#define FIND(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
#endif

enum { FMUS = 16, COLUMNS = 512, COPIES = 512, STAGES = 16, LINE = 1024 };
enum { OK, WARNING };
enum { CO_SIMULATION = 1 };

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} callbacks;

/* Ports that lie side by side in the row. */
typedef struct {
    int first;
    size_t n;
    unsigned references[COLUMNS];
} block;

typedef struct {
    char name[LINE], guid[LINE], resources[LINE];
    block inputs, outputs;
    void *library, *instance;
    int (*do_step)(void *, double, double, int);
    int (*set)(void *, const unsigned *, size_t, const double *);
    int (*get)(void *, const unsigned *, size_t, double *);
} fmu;

typedef struct {
    int target, source;
} copy;

typedef struct {
    size_t n;
    copy all[COPIES];
} copies;

typedef struct {
    copies gathered;
    size_t members;
    size_t member[FMUS];
} stage;

static fmu fmus[FMUS];
static stage stages[STAGES];
static copies connections;
static size_t fmu_count, stage_count, columns, steps;
static double step, row[COLUMNS];
static char names[COLUMNS][LINE];

static void fail(const char *what, const char *of) {
    fprintf(stderr, "%s: %s\n", of, what);
    exit(1);
}

static void check(int status, const char *call, const fmu *of) {
    if (status > WARNING) {
        fprintf(stderr, "%s: %s: status %d\n", of->name, call, status);
        exit(1);
    }
}

static void told(void *environment, const char *instance, int status, const char *category,
                 const char *message, ...) {
    va_list arguments;
    (void)environment;
    fprintf(stderr, "%s, status %d, %s: ", instance, status, category);
    va_start(arguments, message);
    vfprintf(stderr, message, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

static const callbacks functions = {told, calloc, free, NULL, NULL};

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

static void load(fmu *of, const char *path) {
    void *(*instantiate)(const char *, int, const char *, const char *, const callbacks *, int, int);
    of->library = OPEN(path);
    if (of->library == NULL) fail("cannot be loaded", path);
    *(void **)&instantiate = function(of, "fmi2Instantiate");
    *(void **)&of->do_step = function(of, "fmi2DoStep");
    *(void **)&of->set = function(of, "fmi2SetReal");
    *(void **)&of->get = function(of, "fmi2GetReal");
    of->instance =
        instantiate(of->name, CO_SIMULATION, of->guid, of->resources, &functions, 0, 1);
    if (of->instance == NULL) fail("no instance", of->name);
}

static void set_value(const fmu *of, const char *kind, unsigned reference, const char *text) {
    if (strcmp(kind, "real") == 0) {
        double value = strtod(text, NULL);
        check(of->set(of->instance, &reference, 1, &value), "fmi2SetReal", of);
    } else if (strcmp(kind, "string") == 0) {
        CALL(of, "fmi2SetString", (void *, const unsigned *, size_t, const char *const *),
             of->instance, &reference, 1, &text);
    } else {
        int value = atoi(text);
        const char *name = strcmp(kind, "integer") == 0 ? "fmi2SetInteger" : "fmi2SetBoolean";
        CALL(of, name, (void *, const unsigned *, size_t, const int *), of->instance, &reference,
             1, &value);
    }
}

static void add_column(block *to, const fmu *of, unsigned reference, const char *name) {
    if (columns == COLUMNS) fail("too many ports", of->name);
    if (to->n == 0) to->first = (int)columns;
    to->references[to->n++] = reference;
    snprintf(names[columns++], LINE, "%.500s.%.500s", of->name, name);
}

static void add_copy(copies *to, const char *text) {
    copy *next = &to->all[to->n++];
    if (to->n == COPIES || sscanf(text, "%d %d", &next->target, &next->source) != 2)
        fail("too many, or not two columns", text);
}

/* One line of the plan: a word, and the rest. */
static void take(const char *word, const char *rest) {
    fmu *of = &fmus[fmu_count - (fmu_count > 0)];
    stage *at = &stages[stage_count - (stage_count > 0)];
    char *text;
    unsigned reference = (unsigned)strtoul(rest, &text, 10);
    text += *text == ' ';
    if (strcmp(word, "step") == 0) {
        step = strtod(rest, NULL);
    } else if (strcmp(word, "steps") == 0) {
        steps = reference;
    } else if (strcmp(word, "fmu") == 0) {
        if (fmu_count == FMUS) fail("too many FMUs", rest);
        strcpy(fmus[fmu_count++].name, rest);
    } else if (strcmp(word, "guid") == 0) {
        strcpy(of->guid, rest);
    } else if (strcmp(word, "resources") == 0) {
        strcpy(of->resources, rest);
    } else if (strcmp(word, "library") == 0) {
        load(of, rest);
    } else if (strcmp(word, "input") == 0) {
        add_column(&of->inputs, of, reference, text);
    } else if (strcmp(word, "output") == 0) {
        add_column(&of->outputs, of, reference, text);
    } else if (strcmp(word, "connect") == 0) {
        add_copy(&connections, rest);
    } else if (strcmp(word, "stage") == 0) {
        if (stage_count++ == STAGES) fail("too many stages", "plan");
    } else if (strcmp(word, "gather") == 0) {
        add_copy(&at->gathered, rest);
    } else if (strcmp(word, "member") == 0) {
        if (at->members == FMUS || reference >= fmu_count) fail("no such member", rest);
        at->member[at->members++] = reference;
    } else {
        set_value(of, word, reference, text);
    }
}

static void read_plan(const char *path) {
    char line[LINE];
    FILE *file = fopen(path, "r");
    if (file == NULL) fail("cannot be opened", path);
    while (fgets(line, sizeof line, file) != NULL) {
        char *rest;
        line[strcspn(line, "\r\n")] = '\0';
        rest = line + strcspn(line, " ");
        if (*rest != '\0') *rest++ = '\0';
        take(line, rest);
    }
    fclose(file);
}

static void gather(const copies *of) {
    for (size_t i = 0; i < of->n; i++) row[of->all[i].target] = row[of->all[i].source];
}

static void set_inputs(const fmu *of) {
    const block *ports = &of->inputs;
    if (ports->n > 0)
        check(of->set(of->instance, ports->references, ports->n, &row[ports->first]),
              "fmi2SetReal", of);
}

static void get_outputs(const fmu *of) {
    const block *ports = &of->outputs;
    if (ports->n > 0)
        check(of->get(of->instance, ports->references, ports->n, &row[ports->first]),
              "fmi2GetReal", of);
}

static void exchange(void) {
    gather(&connections);
    for (size_t i = 0; i < fmu_count; i++) {
        set_inputs(&fmus[i]);
        get_outputs(&fmus[i]);
    }
}

/* What follows from what at the start time comes to rest in as many exchanges as there are FMUs. */
static void initialise(void) {
    for (size_t i = 0; i < fmu_count; i++) {
        const fmu *of = &fmus[i];
        CALL(of, "fmi2SetupExperiment", (void *, int, double, double, int, double), of->instance,
             0, 0.0, 0.0, 1, (double)steps * step);
        CALL(of, "fmi2EnterInitializationMode", (void *), of->instance);
        if (of->inputs.n > 0)
            check(of->get(of->instance, of->inputs.references, of->inputs.n,
                          &row[of->inputs.first]),
                  "fmi2GetReal", of);
    }
    for (size_t i = 0; i <= fmu_count; i++) exchange();
    for (size_t i = 0; i < fmu_count; i++)
        CALL(&fmus[i], "fmi2ExitInitializationMode", (void *), fmus[i].instance);
    exchange();
}

static void advance(double t) {
    for (size_t i = 0; i < stage_count; i++) {
        const stage *at = &stages[i];
        gather(&at->gathered);
        for (size_t j = 0; j < at->members; j++) {
            const fmu *of = &fmus[at->member[j]];
            set_inputs(of);
            check(of->do_step(of->instance, t, step, 1), "fmi2DoStep", of);
        }
        for (size_t j = 0; j < at->members; j++) get_outputs(&fmus[at->member[j]]);
    }
}

static void write_table(const char *path, const double *table) {
    FILE *file = fopen(path, "w");
    if (file == NULL) fail("cannot be written", path);
    fputs("time", file);
    for (size_t i = 0; i < columns; i++) fprintf(file, ",%s", names[i]);
    for (size_t k = 0; k <= steps; k++) {
        fprintf(file, "\n%.17g", (double)k * step);
        for (size_t i = 0; i < columns; i++) fprintf(file, ",%.17g", *table++);
    }
    fputc('\n', file);
    if (fclose(file) != 0) fail("cannot be written", path);
}

static void end(void) {
    for (size_t i = 0; i < fmu_count; i++) {
        void (*release)(void *);
        CALL(&fmus[i], "fmi2Terminate", (void *), fmus[i].instance);
        *(void **)&release = function(&fmus[i], "fmi2FreeInstance");
        release(fmus[i].instance);
    }
}

int main(int n, char **arguments) {
    double *table, seconds;
    clock_t start;
    if (n != 3) fail("usage: host PLAN TABLE", "host");
    read_plan(arguments[1]);
    table = malloc((steps + 1) * columns * sizeof *table);
    if (table == NULL) fail("too many rows", arguments[1]);
    initialise();
    memcpy(table, row, columns * sizeof *row);
    start = clock();
    for (size_t k = 0; k < steps; k++) {
        advance((double)k * step);
        memcpy(table + (k + 1) * columns, row, columns * sizeof *row);
    }
    seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
    write_table(arguments[2], table);
    free(table);
    end();
    printf("%.9g\n", seconds);
    return 0;
}
