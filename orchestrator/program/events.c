/* Events, which change a run between two steps: see orchestrator/cosim/events.py.
 *
 * The host passes events and actions as numbers. Their state, which begins with zeros, is kept in
 * the same arrays. Several events may act on one input or parameter: the latest one counts, and
 * when it ends, the one before it counts again.
 */

typedef struct {
    double is_timed, at;              /* if set, it happens at this time [s] */
    double column, comparison, value; /* otherwise when this condition on a row becomes true */
    double repeats;                   /* if set, it happens each time that it becomes true */
    double lasts;                     /* duration [s]; 0: until the run ends */
    double first, last;               /* its actions: from the first to before the last */
    double has_happened, was_false, end, listed;
} event;

typedef struct {
    double kind;
    double place; /* an input, a parameter, or a component, by its number */
    double value;
    double turn; /* rank among active actions, the latest highest; 0: inactive */
} action;

enum { OVERRIDE, BIAS, FREEZE, RELEASE, SET_VALUE, RESET, END };
enum { BELOW, AT_MOST, ABOVE, AT_LEAST };
enum { ENDED = REFUSED + 1 };

/* More steps than any run has. */
enum { NEVER = 1000000001 };

/* Most entries of the same event in the list, and numbers of an entry. */
enum { MOST_LISTED = 1000, LISTED = 3 };

/* The events of a run. */
typedef struct {
    simulation *it, *ahead;
    int is_ahead;             /* if set, current values have been passed on in `ahead` */
    const double *parameters; /* at the start of the run */
    int n;
    event *events;
    action *actions;
    double *happened; /* number of entries, then of each entry: event, step, 1 if it ends */
    double turn;      /* highest rank so far */
} course;

/* Current values */

/* Passes current values on in a copy of the simulation, once. */
static int look_ahead(course *of) {
    if (!HAS_PASSING || of->is_ahead) return WELL;
    *of->ahead = *of->it;
    if (pass_now(of->ahead)) {
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

/* Returns the latest action at the same place with a lower rank; NULL: none. */
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

/* Applies an action to its place. */
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

/* Ends an action. If it was the latest, the one before it, or the original value, counts again. */
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

/* Times of events */

static double rounded(double n) {
    const double whole = nearest(n);
    return fabs(n - whole) <= fmin(1e-9 * whole, 1e-3) ? whole : n;
}

/* Returns the number of steps after which a time is reached: the first t_k that is not before. */
static int reaching(const simulation *it, double time) {
    return (int)ceil(rounded(fmin(fmax((time - it->start_time) / it->step, 0.0), NEVER)));
}

/* Returns the number of steps after which to examine an event. */
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

/* Sets `found` to 1 if an event begins now, else to 0. */
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

/* Ends the events that end now, then begins those that begin now. */
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

/* Completes the current row, which no step follows. */
static void show_last(simulation *it, double rows[]) {
    if (it->shown > it->made || pass_now(it)) return;
    keep(it, it->made, rows);
}

/* Makes steps as `run` does, with events. Returns WELL, REFUSED if a component refuses, or ENDED if
 * an event ends the run.
 *
 * `ahead` is memory for another simulation; `happened` has room for MOST_LISTED entries of each
 * event.
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
