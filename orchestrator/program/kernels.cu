/* Kernels of a program: each thread makes runs. Word w of run i is at memory[w * n + i], so that
 * neighbours read and write neighbouring words together. Their random words, of half the length, are
 * arranged likewise in pairs.
 *
 * The file is compiled twice: with HOT for the steps alone, whose values the compiler is to keep in
 * registers, and without for the rest.
 */

/* The run of this thread. */
#ifndef EACH
#define EACH(i, n) if (const size_t i = blockIdx.x * (size_t)blockDim.x + threadIdx.x; i < (size_t)(n))
#endif

#if HOT

/* Makes steps up to a number of them for each run. */
extern "C" __global__ void advance(int n, uint64_t memory[], uint32_t words[], const int until[],
                                   int refused[]) {
    EACH(i, n) {
        RUN(it);
        fetch(&it, memory, n, i);
        attach(&it, words, n, i);
        keep_same(&it);
#if STEPPED
        (void)refused;
        go_on(&it, until[i]);
#else
        if (refused[i] == 0) refused[i] = run(&it, until[i], NULL);
#endif
        store_steps(&it, memory, n, i);
    }
}

#else

/* Gives the number of words of a run. */
extern "C" __global__ void words_of_a_run(int n, int found[]) {
    EACH(i, n) { found[0] = WORDS; }
}

#if STEPPED

/* Begins those whose numbers are given, as begin_all does. */
extern "C" __global__ void begin_some(int m, uint64_t memory[], uint32_t words[], int n,
                                      const int which[], const double same[], int n_varied,
                                      const int varied[], const double values[], double start_time,
                                      double step, double stop_time, int steps) {
    EACH(j, m) {
        const size_t i = which[j];
        RUN(it);
        it = simulation{};
        attach(&it, words, n, i);
        begin_one(&it, same, n_varied, varied, values + j, m, start_time, step, stop_time, steps);
        store(&it, memory, n, i);
    }
}

/* Brings all up to date after a change. */
extern "C" __global__ void pass_on(int n, uint64_t memory[], uint32_t words[]) {
    EACH(i, n) {
        RUN(it);
        fetch(&it, memory, n, i);
        attach(&it, words, n, i);
        go_on(&it, 0);
        store(&it, memory, n, i);
    }
}

/* Sets a parameter of each. */
extern "C" __global__ void tune_each(int n, uint64_t memory[], uint32_t words[], int which,
                                     const double values[], int refused[]) {
    EACH(i, n) {
        RUN(it);
        fetch(&it, memory, n, i);
        attach(&it, words, n, i);
        refused[i] = tune(&it, which, values[i]);
        store(&it, memory, n, i);
    }
}

/* Lets an input of each take again what feeds it. */
extern "C" __global__ void release_each(int n, uint64_t memory[], int input) {
    EACH(i, n) {
        RUN(it);
        fetch(&it, memory, n, i);
        release(&it, input);
        store(&it, memory, n, i);
    }
}

/* Gives places, as places does. */
extern "C" __global__ void place(int n, size_t columns_at[], size_t settables_at[],
                                 size_t members_at[]) {
    EACH(i, n) { places(columns_at, settables_at, members_at); }
}

#else

/* Begins runs: `same` has all parameters, and `varied` the places of those with other values for
 * each run. */
extern "C" __global__ void begin_all(int n, uint64_t memory[], uint32_t words[],
                                     const double same[], int n_varied, const int varied[],
                                     const double values[], const double start_times[],
                                     const double steps[], const double stop_times[],
                                     const int full_steps[], const int all_steps[],
                                     int refused[]) {
    EACH(i, n) {
        double parameters[PARAMETERS];
        RUN(it);
        for (int k = 0; k < PARAMETERS; k++) parameters[k] = same[k];
        for (int k = 0; k < n_varied; k++) parameters[varied[k]] = values[k * (size_t)n + i];
        it = simulation{};
        attach(&it, words, n, i);
        refused[i] = begin(&it, parameters, start_times[i], steps[i], stop_times[i], full_steps[i],
                           all_steps[i]);
        store(&it, memory, n, i);
    }
}

/* Gives the indices of runs: index k of run i at found[k * n + i]. */
extern "C" __global__ void give(int n, const uint64_t memory[], double found[], int refused[]) {
    EACH(i, n) {
        double numbers[FOUND];
        RUN(it);
        fetch(&it, memory, n, i);
        if (indices(&it, numbers)) refused[i] = 1;
        for (int k = 0; k < FOUND; k++) found[k * (size_t)n + i] = numbers[k];
    }
}

#endif

#endif
