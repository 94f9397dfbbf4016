/* What happens to a run from outside, between two steps: see orchestrator/cosim/events.py.
 *
 * The host gives what is to happen as numbers, with zeros where this keeps how far it has come.
 * Several events may act on one input or parameter: the latest counts, and when it ends, the one
 * before it counts again.
 */

typedef struct {
    double is_timed, at;              /* whether it comes at a time, and which [s] */
    double column, comparison, value; /* or else its condition, on a column of the row */
    double repeats;
    double lasts; /* for how long [s]; 0: for good */
    double first, last; /* its actions, without the last */
    double has_happened, was_false, end, listed;
} event;

typedef struct {
    double kind;
    double place; /* an input, a parameter, or a component, by its number */
    double value;
    double turn; /* which of all that act it is: the latest counts; 0: it does not act */
} action;

enum { OVERRIDE, BIAS, FREEZE, RELEASE, SET_VALUE, RESET, END };
enum { BELOW, AT_MOST, ABOVE, AT_LEAST };
enum { WELL, REFUSED, ENDED };

/* After more steps than any run has. */
enum { NEVER = 1000000001 };

/* How often the same event is listed, and the numbers of each time. */
enum { MOST_LISTED = 1000, LISTED = 3 };

/* What is to happen to a run. */
typedef struct {
    simulation *it, *ahead;
    int is_ahead;             /* whether the values of now have passed there */
    const double *parameters; /* that it began with */
    int n;
    event *events;
    action *actions;
    double *happened; /* how often something has, then of each time: event, step, whether it ends */
    double turn;
} course;

/* Lets an input take what feeds it, or what it would have, in another way. */
static void alter(simulation *it, int i, double factor, double offset) {
    it->factors[i] = factor;
    it->offsets[i] = offset;
    if (!inputs[i].is_fed) put(it, columns[inputs[i].column], factor * it->supplied[i] + offset);
}

/* Gives a tunable parameter, or an input that nothing feeds, a value in its range; whether the
 * component refuses. */
EXPORTED int set(simulation *it, int which, double value) {
    const settable *of = &settables[which];
    const double before = get(it, of->at);
    if (of->input >= 0) {
        it->supplied[of->input] = value;
        alter(it, of->input, it->factors[of->input], it->offsets[of->input]);
    } else {
        put(it, of->at, value);
        if (retune(it, of->component)) {
            put(it, of->at, before);
            it->port = which;
            return REFUSED;
        }
    }
    return WELL;
}

/* Looking at values of now */

/* Lets values of now pass in a copy of the simulation, unless they have. */
static int look_ahead(course *of) {
    if (!HAS_PASSING || of->is_ahead) return WELL;
    *of->ahead = *of->it;
    if (PASS(of->ahead, of->it->made, time_after(of->it, of->it->made))) {
        refused(of->it, of->ahead->component, of->ahead->call, of->ahead->port);
        return REFUSED;
    }
    of->is_ahead = 1;
    return WELL;
}

static const simulation *seen(const course *of) { return HAS_PASSING ? of->ahead : of->it; }

static int compare(int comparison, double a, double b) {
    switch (comparison) {
    case BELOW: return a < b;
    case AT_MOST: return a <= b;
    case ABOVE: return a > b;
    default: return a >= b;
    }
}

/* Layers */

static int alters(const action *one) { return one->kind < RELEASE; }

static int share_place(const action *one, const action *other) {
    const int is_set = one->kind == SET_VALUE;
    return one->place == other->place &&
           (is_set ? other->kind == SET_VALUE : alters(one) && alters(other));
}

static int n_actions(const course *of) {
    return of->n > 0 ? (int)of->events[of->n - 1].last : 0;
}

/* The latest action at the place of one, before that one in its turn; NULL: there is none. */
static action *below(const course *of, const action *one) {
    action *found = NULL;
    for (int i = 0; i < n_actions(of); i++) {
        action *other = &of->actions[i];
        const int is_below = other->turn > 0.0 && (one->turn == 0.0 || other->turn < one->turn);
        if (is_below && share_place(one, other) && (found == NULL || found->turn < other->turn)) {
            found = other;
        }
    }
    return found;
}

static int is_top(const course *of, const action *one) {
    action last = *one;
    last.turn = 0.0;
    return below(of, &last) == one;
}

/* Does what an action says at its place. */
static int apply(course *of, const action *one) {
    const int i = (int)one->place;
    of->is_ahead = 0;
    switch ((int)one->kind) {
    case OVERRIDE:
    case FREEZE: alter(of->it, i, 0.0, one->value); return WELL;
    case BIAS: alter(of->it, i, inputs[i].factor, inputs[i].offset + one->value); return WELL;
    default: return set(of->it, i, one->value);
    }
}

/* Undoes what an action does, if it counts: the one before it counts again, or what there was. */
static int undo(course *of, action *one) {
    const int i = (int)one->place, counts = is_top(of, one);
    const action *other = below(of, one);
    one->turn = 0.0;
    if (!counts) return WELL;
    if (other != NULL) return apply(of, other);
    of->is_ahead = 0;
    if (one->kind == SET_VALUE) return set(of->it, i, of->parameters[i]);
    alter(of->it, i, inputs[i].factor, inputs[i].offset);
    return WELL;
}

static int put_on_top(course *of, const event *by, action *one) {
    for (int i = (int)by->first; i < (int)by->last; i++) {
        if (share_place(&of->actions[i], one)) of->actions[i].turn = 0.0;
    }
    if (one->kind == FREEZE) one->value = get(of->it, columns[inputs[(int)one->place].column]);
    one->turn = ++of->turn;
    return apply(of, one);
}

static void release(course *of, const action *by) {
    const int input = (int)by->place;
    for (int i = 0; i < n_actions(of); i++) {
        if (alters(&of->actions[i]) && of->actions[i].place == input) of->actions[i].turn = 0.0;
    }
    of->is_ahead = 0;
    alter(of->it, input, inputs[input].factor, inputs[input].offset);
}

static int reset(course *of, int component) {
    if (look_ahead(of)) return REFUSED;
    const int found = restart(of->it, seen(of), component, time_after(of->it, of->it->made));
    of->is_ahead = 0;
    return found;
}

/* When events happen */

static double rounded(double n) {
    const double whole = nearest(n);
    return fabs(n - whole) <= fmin(1e-9 * whole, 1e-3) ? whole : n;
}

/* After how many steps a time has come: the first t_k that is not before it. */
static int reaching(const simulation *it, double time) {
    return (int)ceil(rounded(fmin(fmax((time - it->start_time) / it->step, 0.0), NEVER)));
}

/* After how many steps to look at an event. */
static int due(const course *of, const event *one) {
    if (one->has_happened != 0.0 && one->repeats == 0.0) return NEVER;
    return one->is_timed != 0.0 ? reaching(of->it, one->at) : of->it->made + 1;
}

static void list(course *of, event *one, int ends) {
    if (++one->listed > MOST_LISTED) return;
    double *row = of->happened + 1 + LISTED * (int)*of->happened;
    row[0] = (double)(one - of->events);
    row[1] = of->it->made;
    row[2] = ends;
    *of->happened += 1.0;
}

/* Whether an event begins now, in `found`. */
static int find_begin(course *of, event *one, int *found) {
    const int at = due(of, one);
    *found = at <= of->it->made;
    if (at == NEVER || one->is_timed != 0.0) return WELL;
    if (look_ahead(of)) return REFUSED;
    const double now = get(seen(of), columns[(int)one->column]);
    const int is_true = compare((int)one->comparison, now, one->value);
    *found = is_true && one->was_false != 0.0;
    one->was_false = !is_true;
    return WELL;
}

static int begin_event(course *of, event *one) {
    one->has_happened = 1.0;
    list(of, one, 0);
    for (int i = (int)one->first; i < (int)one->last; i++) {
        action *what = &of->actions[i];
        switch ((int)what->kind) {
        case RELEASE: release(of, what); break;
        case END: return ENDED;
        case RESET:
            if (reset(of, (int)what->place)) return REFUSED;
            break;
        default:
            if (put_on_top(of, one, what)) return REFUSED;
        }
    }
    if (one->lasts > 0.0) {
        const int end = reaching(of->it, time_after(of->it, of->it->made) + one->lasts);
        one->end = end > of->it->made ? end : of->it->made + 1;
    }
    return WELL;
}

static int end_event(course *of, event *one) {
    one->end = 0.0;
    for (int i = (int)one->first; i < (int)one->last; i++) {
        if (of->actions[i].turn > 0.0 && undo(of, &of->actions[i])) return REFUSED;
    }
    list(of, one, 1);
    return WELL;
}

/* Ends what ends now, then begins what begins now. */
static int act(course *of) {
    simulation *it = of->it;
    it->due = NEVER;
    of->is_ahead = 0;
    for (int i = 0; i < of->n; i++) {
        event *one = &of->events[i];
        if (one->end > 0.0 && one->end <= it->made && end_event(of, one)) return REFUSED;
    }
    for (int i = 0; i < of->n; i++) {
        int begins, found;
        if (find_begin(of, &of->events[i], &begins)) return REFUSED;
        if (begins && (found = begin_event(of, &of->events[i])) != WELL) return found;
    }
    for (int i = 0; i < of->n; i++) {
        const event *one = &of->events[i];
        const int at = due(of, one);
        if (at < it->due) it->due = at;
        if (one->end > 0.0 && one->end < it->due) it->due = (int)one->end;
    }
    return WELL;
}

/* Completes the row of now, which no step follows. */
static void show_last(simulation *it, double rows[]) {
    if (it->shown > it->made || PASS(it, it->made, time_after(it, it->made))) return;
    keep(it, it->made, rows);
}

/* Makes steps as `run` does, while events happen; whether a component refuses, or an event ends the
 * run.
 *
 * `ahead` is room for another simulation; `happened` has room for MOST_LISTED times of each event.
 */
EXPORTED int run_with_events(simulation *it, simulation *ahead, int until, double rows[],
                             const double begun_with[], int n, event events[], action actions[],
                             double happened[]) {
    course of = {it, ahead, 0, begun_with, n, events, actions, happened, 0.0};
    int found = run(it, it->made, rows); /* the first row, where nothing passes */
    for (int i = 0; i < n_actions(&of); i++) of.turn = fmax(of.turn, actions[i].turn);
    while (found == WELL && it->made < until) {
        if (it->due <= it->made) found = act(&of);
        if (found == WELL) found = run(it, it->due < until ? it->due : until, rows);
    }
    if (found == ENDED) show_last(it, rows);
    return found;
}
