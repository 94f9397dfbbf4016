/* The tight loop of benchmarks/examples.py: steps of one instance, and the processor's time that
 * they take [s]; -1: a step is refused.
 */
#define _POSIX_C_SOURCE 200809L

#include <stdbool.h>
#include <time.h>

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

double fmi2_steps(int (*do_step)(void *, double, double, int), void *c, double h, int n) {
    double start = now();
    for (int k = 0; k < n; k++) {
        if (do_step(c, k * h, h, 1) > 1) return -1.0;
    }
    return now() - start;
}

typedef int (*fmi3_do_step)(void *, double, double, bool, bool *, bool *, bool *, double *);

double fmi3_steps(fmi3_do_step do_step, void *c, double h, int n) {
    bool event, end, early;
    double last, start = now();
    for (int k = 0; k < n; k++) {
        if (do_step(c, k * h, h, true, &event, &end, &early, &last) > 1) return -1.0;
    }
    return now() - start;
}
