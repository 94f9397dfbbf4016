/* Steps and changes by a host, of one simulation or of many side by side in memory: see
 * orchestrator/simulation.
 *
 * Values pass along connections once a host asks for them. They pass again before the next step
 * only if the host has changed something since.
 */

EXPORTED const char *reason(const simulation *it) { return REASON(it); }

/* Continues with other steps. With another start, steps made before do not count. */
EXPORTED void regrid(simulation *it, double start_time, double step, double stop_time,
                     int full_steps, int steps) {
    if (start_time != it->start_time) {
        it->shown -= it->made;
        it->made = 0;
    }
    it->start_time = start_time;
    it->step = step;
    it->stop_time = stop_time;
    it->full_steps = full_steps;
    it->steps = steps;
}

static int come_up_to_date(simulation *it) {
    if (!HAS_PASSING || it->is_passed) return WELL;
    if (pass_now(it)) return REFUSED;
    it->is_passed = 1;
    return WELL;
}

/* Writes the row of the present time. Returns REFUSED if a component refuses. */
EXPORTED int present(simulation *it, double row[]) {
    if (come_up_to_date(it)) return REFUSED;
    show(it, time_after(it, it->made), row);
    return WELL;
}

/* Gives an input a value, whatever feeds it. */
EXPORTED void override(simulation *it, int input, double value) {
    it->is_passed = 0;
    alter(it, input, 0.0, value);
}

/* Lets an input take again what feeds it, or the value that it had before. */
EXPORTED void release(simulation *it, int input) {
    it->is_passed = 0;
    alter(it, input, inputs[input].factor, inputs[input].offset);
}

/* Sets a parameter, as `set` does. */
EXPORTED int tune(simulation *it, int which, double value) {
    it->is_passed = 0;
    return set(it, which, value);
}

/* Many simulations */

static simulation *at(char *all, int i) { return (simulation *)all + i; }

/* Steps one to a number of steps, unless a component has refused before. */
static void go_on(simulation *it, int until) {
    if (!it->has_failed) it->has_failed = run(it, until, NULL) || come_up_to_date(it);
}

/* Begins one with parameters: `same` has all, and `varied` the places of those with values of its
 * own, which are `apart`. */
static void begin_one(simulation *it, const double same[], int n_varied, const int varied[],
                      const double values[], size_t apart, double start_time, double step,
                      double stop_time, int steps) {
    double parameters[SETTABLES + 1];
    for (int k = 0; k < SETTABLES; k++) parameters[k] = same[k];
    for (int k = 0; k < n_varied; k++) parameters[varied[k]] = values[k * apart];
    it->has_failed = begin(it, parameters, start_time, step, stop_time, steps, steps);
    go_on(it, 0);
}

/* Begins those whose numbers are given: value k of the j-th is values[k * m + j]. */
EXPORTED void begin_all(char *all, int m, const int which[], const double same[], int n_varied,
                        const int varied[], const double values[], double start_time, double step,
                        double stop_time, int steps) {
    for (int j = 0; j < m; j++) {
        begin_one(at(all, which[j]), same, n_varied, varied, values + j, (size_t)m, start_time, step,
                  stop_time, steps);
    }
}

EXPORTED void advance_all(char *all, int n, const int until[]) {
    for (int i = 0; i < n; i++) go_on(at(all, i), until[i]);
}

/* Brings all up to date after a change. */
EXPORTED void pass_all(char *all, int n) {
    for (int i = 0; i < n; i++) go_on(at(all, i), 0);
}

/* Lets an input of each take again what feeds it. */
EXPORTED void release_all(char *all, int n, int input) {
    for (int i = 0; i < n; i++) release(at(all, i), input);
}

/* Sets a parameter of each. Returns how many refuse it. */
EXPORTED int tune_all(char *all, int n, int which, const double values[]) {
    int refusals = 0;
    for (int i = 0; i < n; i++) refusals += tune(at(all, i), which, values[i]);
    return refusals;
}

/* Gives the places of columns and parameters, each with 1 for an int, and of other members. */
EXPORTED void places(size_t columns_at[], size_t settables_at[], size_t members_at[]) {
    for (size_t i = 0; i < sizeof columns / sizeof columns[0]; i++) {
        columns_at[2 * i] = columns[i].place;
        columns_at[2 * i + 1] = (size_t)columns[i].is_whole;
    }
    for (size_t i = 0; i < SETTABLES; i++) {
        settables_at[2 * i] = settables[i].at.place;
        settables_at[2 * i + 1] = (size_t)settables[i].at.is_whole;
    }
    members_at[0] = offsetof(simulation, factors);
    members_at[1] = offsetof(simulation, offsets);
    members_at[2] = offsetof(simulation, supplied);
    members_at[3] = offsetof(simulation, made);
    members_at[4] = offsetof(simulation, shown);
    members_at[5] = offsetof(simulation, is_passed);
    members_at[6] = offsetof(simulation, has_failed);
}
