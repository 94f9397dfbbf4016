/* Modes and steps.
 *
 * A step is a transaction: state and outputs change together, after everything was computed and found
 * finite.
 */
#include <math.h>

/* A step may exceed `h_max` by this share without being split: hosts round their time. */
static const double ROUNDING = 1e-9;

/* Longest step of a component that has no internal steps [s]. */
static const double NO_LIMIT = 1e300;

/* Largest norm of a state. No vehicle comes near it, and from a state below it a step with sane inputs
 * is always finite: one wild sample must not be the end of a run. */
static const double LARGEST_STATE = 1e100;

/* More internal steps than this in one communication step are taken for a mistake. */
static const double MOST_INTERNAL_STEPS = 1e6;

/* Makes everything what it is after instantiation. */
static void renew(instance *it) {
    run fresh = {.parameters.h_max = NO_LIMIT};
    for (size_t i = 0; i < N_PORTS; i++) {
        if (ports[i].causality == PARAMETER) {
            put_parameter(&fresh.parameters, &ports[i], ports[i].start);
        }
    }
    release_run(&it->run);
    it->run = fresh;
    it->stale = 0;
    it->in_error = 0;
    it->n_said = 0;
}
