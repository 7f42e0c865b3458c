package tickbus.petri.sfc;

/**
 * An expression.
 *
 * @param kind the type of its value
 * @param of computes the value
 */
record Value(Kind kind, Of of) {
    /** Computes a value from the variables and steps. */
    @FunctionalInterface
    interface Of {
        long of(State state);
    }

    boolean holds(State state) {
        return of.of(state) != 0;
    }
}
