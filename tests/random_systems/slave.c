/* An FMI 2.0 slave that computes what a text in its resources says: see generator.py, which writes
   it. Value references are places of variables; expressions are in postfix. Derivatives are exact:
   every value on the stack has its own beside it. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "slave.h"

enum { VARIABLES = 64, STATES = 16, TOKENS = 1600, LENGTH = 24, DEPTH = 64 };

typedef struct {
    double number, slope;
    char text[LENGTH];
} Value;

/* The contents of a state. */
typedef struct {
    Value variables[VARIABLES], states[STATES];
    double rates[VARIABLES];
    double time;
    int initialised, responds;
} Live;

typedef struct {
    char op;
    int place;
    Value value;
} Token;

typedef struct {
    int target, first, last;
} Formula;

typedef struct {
    Live live, start;
    char kinds[VARIABLES];
    Token tokens[TOKENS];
    Formula states[STATES], outputs[VARIABLES];
    int variable_count, state_count, output_count, token_count;
} Instance;

/* Operators by the letters that tokens have. */
static const char *const NAMES[] = {"+", "-", "*", "/", "sin", "tanh", "sqrt", "log", "max", "mod",
                                    "floor", ">", "or", "not", "pick", "same", NULL};
enum { ADD, SUB, MUL, DIV, SIN, TANH, SQRT, LOG, MAX, MOD, FLOOR, MORE, OR, NOT, PICK, SAME };
enum { NUMBER = 100, VARIABLE, STATE, TIME, LENGTH_OF_STEP };

static Value evaluate(const Instance *it, const Formula *formula, double h)
{
    Value stack[DEPTH] = {{0}}, *top = stack;
    int i;
    for (i = formula->first; i < formula->last; i++) {
        const Token *token = &it->tokens[i];
        Value *a = top - 1, *b = top - 2, *c = top - 3;
        switch (token->op) {
        case NUMBER: *top++ = token->value; break;
        case VARIABLE: *top++ = it->live.variables[token->place]; break;
        case STATE: *top++ = it->live.states[token->place]; break;
        case TIME: *top++ = (Value){it->live.time, 0.0, ""}; break;
        case LENGTH_OF_STEP: *top++ = (Value){h, 0.0, ""}; break;
        case ADD: b->number += a->number; b->slope += a->slope; top--; break;
        case SUB: b->number -= a->number; b->slope -= a->slope; top--; break;
        case MUL:
            b->slope = b->slope * a->number + b->number * a->slope;
            b->number *= a->number;
            top--;
            break;
        case DIV:
            b->number /= a->number;
            b->slope = (b->slope - b->number * a->slope) / a->number;
            top--;
            break;
        case SIN: a->slope *= cos(a->number); a->number = sin(a->number); break;
        case TANH:
            a->number = tanh(a->number);
            a->slope *= 1.0 - a->number * a->number;
            break;
        case SQRT: a->number = sqrt(a->number); a->slope /= 2.0 * a->number; break;
        case LOG: a->slope /= a->number; a->number = log(a->number); break;
        case MAX: if (a->number > b->number) *b = *a; top--; break;
        case MOD: b->number = fmod(b->number, a->number); b->slope = 0.0; top--; break;
        case FLOOR: a->number = floor(a->number); a->slope = 0.0; break;
        case MORE: b->number = b->number > a->number; b->slope = 0.0; top--; break;
        case OR: b->number = b->number || a->number; top--; break;
        case NOT: a->number = !a->number; break;
        case SAME: b->number = !strcmp(b->text, a->text); top--; break;
        case PICK: *c = c->number ? *b : *a; top -= 2; break;
        }
    }
    return stack[0];
}

static void respond(Instance *it)
{
    int i;
    for (i = 0; i < it->output_count; i++)
        it->live.variables[it->outputs[i].target] = evaluate(it, &it->outputs[i], 0.0);
}

/* Reading the text */

static Value value_of(const char *word)
{
    Value value = {0};
    if (*word == '\'')
        strncpy(value.text, word + 1, LENGTH - 1);
    else
        value.number = strtod(word, NULL);
    return value;
}

static void read_formula(Instance *it, FILE *file, Formula *formula, int target)
{
    char word[64];
    int n, i;
    formula->target = target;
    formula->first = it->token_count;
    if (fscanf(file, "%d", &n) != 1) abort();
    while (n--) {
        Token *token = &it->tokens[it->token_count++];
        if (it->token_count > TOKENS || fscanf(file, "%63s", word) != 1) abort();
        token->op = NUMBER;
        if (*word == '$' || *word == '@') {
            token->op = *word == '$' ? VARIABLE : STATE;
            token->place = atoi(word + 1);
        } else if (!strcmp(word, "t") || !strcmp(word, "h"))
            token->op = *word == 't' ? TIME : LENGTH_OF_STEP;
        else {
            token->value = value_of(word);
            for (i = 0; NAMES[i]; i++)
                if (!strcmp(word, NAMES[i])) token->op = i;
        }
    }
    formula->last = it->token_count;
}

static int read_all(Instance *it, const char *location)
{
    char path[4096], word[64];
    size_t n = 0;
    int i;
    FILE *file;
    if (strncmp(location, "file://", 7)) return 0;
    for (location += 7; *location && n < sizeof path - 16; location++) {
        unsigned code;
        if (*location == '%' && sscanf(location + 1, "%2x", &code) == 1) {
            path[n++] = (char)code;
            location += 2;
        } else
            path[n++] = *location;
    }
    strcpy(path + n, "/model.txt");
    file = fopen(path, "r");
    if (!file || fscanf(file, "%d %d", &it->live.responds, &it->variable_count) != 2) return 0;
    for (i = 0; i < it->variable_count; i++) {
        if (fscanf(file, " %c %63s", &it->kinds[i], word) != 2) return 0;
        it->live.variables[i] = value_of(word);
    }
    if (fscanf(file, "%d", &it->state_count) != 1) return 0;
    for (i = 0; i < it->state_count; i++) {
        if (fscanf(file, "%63s", word) != 1) return 0;
        it->live.states[i] = value_of(word);
        read_formula(it, file, &it->states[i], i);
    }
    if (fscanf(file, "%d", &it->output_count) != 1) return 0;
    for (i = 0; i < it->output_count; i++) {
        int target;
        if (fscanf(file, "%d", &target) != 1) return 0;
        read_formula(it, file, &it->outputs[i], target);
    }
    fclose(file);
    it->start = it->live;
    return 1;
}

/* FMI */

Component fmi2Instantiate(const char *name, int type, const char *guid, const char *location,
                          const Callbacks *callbacks, int visible, int logging)
{
    Instance *it = calloc(1, sizeof *it);
    if (read_all(it, location)) return it;
    free(it);
    return NULL;
}

Status fmi2SetupExperiment(Component c, int given, double tolerance, double start, int ends,
                           double end)
{
    ((Instance *)c)->live.time = start;
    return OK;
}

Status fmi2ExitInitializationMode(Component c)
{
    Instance *it = c;
    respond(it);
    it->live.initialised = 1;
    return OK;
}

Status fmi2Reset(Component c)
{
    ((Instance *)c)->live = ((Instance *)c)->start;
    return OK;
}

static void before_get(Instance *it)
{
    if (it->live.responds || !it->live.initialised) respond(it);
}

#define ACCESS(name, type)                                                           \
    Status fmi2Get##name(Component c, const unsigned *r, size_t n, type *values)     \
    {                                                                                \
        size_t i;                                                                    \
        before_get(c);                                                               \
        for (i = 0; i < n; i++)                                                      \
            values[i] = (type)((Instance *)c)->live.variables[r[i]].number;          \
        return OK;                                                                   \
    }                                                                                \
    Status fmi2Set##name(Component c, const unsigned *r, size_t n, const type *values) \
    {                                                                                \
        Instance *it = c;                                                            \
        size_t i;                                                                    \
        for (i = 0; i < n; i++) {                                                    \
            /* No item of an enumeration is zero, and no pressure. */                \
            if (strchr("EP", it->kinds[r[i]]) && !(values[i] > 0)) return Error;     \
            it->live.variables[r[i]].number = values[i];                             \
            it->live.rates[r[i]] = 0.0;                                              \
        }                                                                            \
        return OK;                                                                   \
    }
ACCESS(Real, double)
ACCESS(Integer, int)
ACCESS(Boolean, int)

Status fmi2GetString(Component c, const unsigned *r, size_t n, const char **values)
{
    size_t i;
    before_get(c);
    for (i = 0; i < n; i++) values[i] = ((Instance *)c)->live.variables[r[i]].text;
    return OK;
}

Status fmi2SetString(Component c, const unsigned *r, size_t n, const char *const *values)
{
    size_t i;
    for (i = 0; i < n; i++)
        snprintf(((Instance *)c)->live.variables[r[i]].text, LENGTH, "%s", values[i]);
    return OK;
}

Status fmi2SetRealInputDerivatives(Component c, const unsigned *r, size_t n, const int *orders,
                                   const double *values)
{
    size_t i;
    for (i = 0; i < n; i++) {
        if (orders[i] != 1) return Error;
        ((Instance *)c)->live.rates[r[i]] = values[i];
    }
    return OK;
}

static void move_inputs(Instance *it, double h)
{
    int i;
    for (i = 0; i < it->variable_count; i++)
        it->live.variables[i].number += h * it->live.rates[i];
}

/* One step of Euler's, with the inputs of its middle where they move. */
Status fmi2DoStep(Component c, double t, double h, int no_rollback)
{
    Instance *it = c;
    Value next[STATES];
    int i;
    move_inputs(it, 0.5 * h);
    for (i = 0; i < it->state_count; i++) next[i] = evaluate(it, &it->states[i], h);
    memcpy(it->live.states, next, it->state_count * sizeof *next);
    move_inputs(it, 0.5 * h);
    memset(it->live.rates, 0, sizeof it->live.rates);
    it->live.time = t + h;
    respond(it);
    return OK;
}

Status fmi2GetDirectionalDerivative(Component c, const unsigned *unknowns, size_t n,
                                    const unsigned *knowns, size_t m, const double *seeds,
                                    double *found)
{
    Instance *it = c;
    size_t i;
    int k;
    for (i = 0; i < m; i++) it->live.variables[knowns[i]].slope = seeds[i];
    for (i = 0; i < n; i++)
        for (k = 0; k < it->output_count; k++)
            if (it->outputs[k].target == (int)unknowns[i])
                found[i] = evaluate(it, &it->outputs[k], 0.0).slope;
    for (i = 0; i < m; i++) it->live.variables[knowns[i]].slope = 0.0;
    return OK;
}

Status fmi2GetFMUstate(Component c, void **state)
{
    if (!*state) *state = malloc(sizeof(Live));
    memcpy(*state, &((Instance *)c)->live, sizeof(Live));
    return OK;
}

Status fmi2SetFMUstate(Component c, void *state)
{
    memcpy(&((Instance *)c)->live, state, sizeof(Live));
    return OK;
}

STATE_IS(Live)
