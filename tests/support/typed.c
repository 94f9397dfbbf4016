/* An FMI 3.0 slave with ports of every type: see typed.py.

   Every output is the input of its type at the same time, w = gain (M v) + x and x' = u, and counter
   adds one in every step. Compiled with LACKS, it has only the functions
   that a run without events needs. */

/* Functions that do nothing are declared without arguments. */
#define fmi3Functions_h
#include <fmi3FunctionTypes.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

enum { N = 3, ROWS = 2, LONGEST = 100 };

typedef struct {
    fmi3Float64 time, x, end_at, early_at, gain[ROWS], m[ROWS][N], v[N], w[ROWS];
    fmi3Float64 u_float64, y_float64;
    fmi3Float32 u_float32, y_float32;
    fmi3Int8 u_int8, y_int8;
    fmi3UInt8 u_uint8, y_uint8;
    fmi3Int16 u_int16, y_int16, steps[N];
    fmi3UInt16 u_uint16, y_uint16;
    fmi3Int32 u_int32, y_int32;
    fmi3UInt32 u_uint32, y_uint32;
    fmi3Int64 u_int64, y_int64, u_enumeration, y_enumeration;
    fmi3UInt64 n, u_uint64, y_uint64, counter, counts_from;
    fmi3Boolean u_boolean, y_boolean, complains;
    char u_string[LONGEST], y_string[LONGEST], names[ROWS][LONGEST], joined[ROWS][LONGEST];
    fmi3LogMessageCallback log;
    fmi3InstanceEnvironment environment;
} Instance;

/* Place and number of the values of each value reference. */
static const struct {
    size_t at, n;
} places[] = {
    {offsetof(Instance, time), 1},
    {offsetof(Instance, x), 1},
    {offsetof(Instance, end_at), 1},
    {offsetof(Instance, early_at), 1},
    {offsetof(Instance, gain), ROWS},
    {offsetof(Instance, m), ROWS * N},
    {offsetof(Instance, v), N},
    {offsetof(Instance, w), ROWS},
    {offsetof(Instance, steps), N},
    {offsetof(Instance, n), 1},
    {offsetof(Instance, counter), 1},
    {offsetof(Instance, counts_from), 1},
    {offsetof(Instance, complains), 1},
    {offsetof(Instance, names), ROWS},
    {offsetof(Instance, joined), ROWS},
#define BOTH(name) {offsetof(Instance, u_##name), 1}, {offsetof(Instance, y_##name), 1}
    BOTH(float64), BOTH(float32), BOTH(int8), BOTH(uint8), BOTH(int16), BOTH(uint16), BOTH(int32),
    BOTH(uint32), BOTH(int64), BOTH(uint64), BOTH(enumeration), BOTH(boolean), BOTH(string),
};
enum { V = 6, W = 7, U = 15 };

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[],
    size_t n, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3IntermediateUpdateCallback update)
{
    Instance *it = calloc(1, sizeof *it);
    if (events || early || n || update || resources[strlen(resources) - 1] != '/')
        return NULL;
    it->log = log;
    it->environment = environment;
    it->end_at = it->early_at = HUGE_VAL;
    it->gain[0] = it->gain[1] = it->u_enumeration = 1;
    it->n = N;
    it->v[2] = 0.5;
    for (int i = 0; i < ROWS * N; i++)
        it->m[i / N][i % N] = i + 1;
    strcpy(it->names[0], "a");
    strcpy(it->names[1], "b");
    strcpy(it->u_string, "said");
    return it;
}

void fmi3FreeInstance(fmi3Instance c) { free(c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean tolerance, fmi3Float64 t,
                                       fmi3Float64 start, fmi3Boolean stop, fmi3Float64 end)
{
    ((Instance *)c)->time = start;
    return stop ? fmi3Error : fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    Instance *it = c;
    it->counter = it->counts_from;
    if (it->complains)
        it->log(it->environment, fmi3Warning, "", "100 % of it");
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance c) { return fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance c)
{
    ((Instance *)c)->x = 0.0;
    return fmi3OK;
}

static void respond(Instance *it)
{
    for (size_t i = 0; i < ROWS; i++) {
        it->w[i] = it->x;
        for (size_t j = 0; j < N; j++)
            it->w[i] += it->gain[i] * it->m[i][j] * it->v[j];
        strcpy(it->joined[i], it->names[i]);
        strcat(it->joined[i], it->u_string);
    }
#define PASS(name) it->y_##name = it->u_##name
    PASS(float64), PASS(float32), PASS(int8), PASS(uint8), PASS(int16), PASS(uint16), PASS(int32);
    PASS(uint32), PASS(int64), PASS(uint64), PASS(enumeration), PASS(boolean);
    strcpy(it->y_string, it->u_string);
}

#define ACCESS(type) \
    fmi3Status fmi3Get##type(fmi3Instance c, const fmi3ValueReference r[], size_t n, \
                             fmi3##type values[], size_t n_values) \
    { \
        respond(c); \
        for (size_t i = 0; i < n; i++) { \
            const size_t m = places[r[i]].n; \
            if (m > n_values) \
                return fmi3Error; \
            memcpy(values, (char *)c + places[r[i]].at, m * sizeof *values); \
            values += m, n_values -= m; \
        } \
        return n_values ? fmi3Error : fmi3OK; \
    } \
    fmi3Status fmi3Set##type(fmi3Instance c, const fmi3ValueReference r[], size_t n, \
                             const fmi3##type values[], size_t n_values) \
    { \
        for (size_t i = 0; i < n; i++) { \
            const size_t m = places[r[i]].n; \
            if (m > n_values) \
                return fmi3Error; \
            memcpy((char *)c + places[r[i]].at, values, m * sizeof *values); \
            values += m, n_values -= m; \
        } \
        return n_values ? fmi3Error : fmi3OK; \
    }
ACCESS(Float64)
ACCESS(Float32)
ACCESS(Int8)
ACCESS(UInt8)
ACCESS(Int16)
ACCESS(UInt16)
ACCESS(Int32)
ACCESS(UInt32)
ACCESS(Int64)
ACCESS(UInt64)
ACCESS(Boolean)

fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                         fmi3String values[], size_t n_values)
{
    respond(c);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < places[r[i]].n; j++, n_values--)
            *values++ = (char *)c + places[r[i]].at + j * LONGEST;
    return n_values ? fmi3Error : fmi3OK;
}

fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference r[], size_t n,
                         const fmi3String values[], size_t n_values)
{
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < places[r[i]].n; j++, n_values--)
            strcpy((char *)c + places[r[i]].at + j * LONGEST, *values++);
    return n_values ? fmi3Error : fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_set,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early,
                      fmi3Float64 *last)
{
    Instance *it = c;
    *event = false;
    *terminate = t + h > it->end_at - 1e-9;
    *early = t + h > it->early_at;
    *last = *early ? it->early_at : fmin(t + h, it->end_at);
    it->x += (*last - t) * it->u_float64;
    it->time = *last;
    it->counter++;
    for (int i = 0; i < N; i++)
        it->steps[i] += (fmi3Int16)(i + 1);
    return it->u_float64 < 0.0 ? fmi3Discard : fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    *state = memcpy(malloc(sizeof(Instance)), c, sizeof(Instance));
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    Instance own = *(Instance *)c, *it = memcpy(c, state, sizeof own);
    it->log = own.log;
    it->environment = own.environment;
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    free(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    *size = sizeof(Instance);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    memcpy(bytes, state, size);
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size,
                                   fmi3FMUState *state)
{
    *state = memcpy(malloc(size), bytes, size);
    return fmi3OK;
}

/* Derivatives of w by v and of y by u; there are no others. */
fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknowns[],
                                        size_t n_unknowns, const fmi3ValueReference knowns[],
                                        size_t n_knowns, const fmi3Float64 seed[], size_t n_seed,
                                        fmi3Float64 found[], size_t n_found)
{
    const Instance *it = c;
    memset(found, 0, n_found * sizeof *found);
    for (size_t i = 0; i < n_unknowns; found += places[unknowns[i++]].n) {
        const fmi3Float64 *by = seed;
        for (size_t j = 0; j < n_knowns; by += places[knowns[j++]].n) {
            if (knowns[j] >= U && unknowns[i] == knowns[j] + 1)
                found[0] += by[0];
            if (unknowns[i] == W && knowns[j] == V)
                for (size_t k = 0; k < ROWS * N; k++)
                    found[k / N] += it->gain[k / N] * it->m[k / N][k % N] * by[k % N];
        }
    }
    return fmi3OK;
}

#ifndef LACKS
#define ABSENT(name) \
    fmi3Status fmi3##name(void) { return fmi3Error; }
const char *fmi3GetVersion(void) { return "3.0"; }
ABSENT(SetDebugLogging) ABSENT(InstantiateModelExchange) ABSENT(InstantiateScheduledExecution)
ABSENT(EnterEventMode) ABSENT(GetBinary) ABSENT(SetBinary) ABSENT(GetClock) ABSENT(SetClock)
ABSENT(GetNumberOfVariableDependencies) ABSENT(GetVariableDependencies)
ABSENT(GetAdjointDerivative) ABSENT(EnterConfigurationMode) ABSENT(ExitConfigurationMode)
ABSENT(GetIntervalDecimal) ABSENT(GetIntervalFraction) ABSENT(GetShiftDecimal)
ABSENT(GetShiftFraction) ABSENT(SetIntervalDecimal) ABSENT(SetIntervalFraction)
ABSENT(SetShiftDecimal) ABSENT(SetShiftFraction) ABSENT(EvaluateDiscreteStates)
ABSENT(UpdateDiscreteStates) ABSENT(EnterContinuousTimeMode) ABSENT(CompletedIntegratorStep)
ABSENT(SetTime) ABSENT(SetContinuousStates) ABSENT(GetContinuousStateDerivatives)
ABSENT(GetEventIndicators) ABSENT(GetContinuousStates) ABSENT(GetNominalsOfContinuousStates)
ABSENT(GetNumberOfEventIndicators) ABSENT(GetNumberOfContinuousStates) ABSENT(EnterStepMode)
ABSENT(GetOutputDerivatives) ABSENT(ActivateModelPartition)
#endif
