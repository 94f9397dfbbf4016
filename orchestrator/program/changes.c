/* Changes between two steps: what inputs take, and values of parameters. */

enum { WELL, REFUSED };

/* Sets the factor and offset of an input, for its connection or its own value. */
static void alter(simulation *it, int i, double factor, double offset) {
    it->factors[i] = factor;
    it->offsets[i] = offset;
    if (!inputs[i].is_fed) put(it, columns[inputs[i].column], factor * it->supplied[i] + offset);
}

/* Sets a tunable parameter or an unconnected input to a value in its range. Returns REFUSED if the
 * component refuses it. */
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
