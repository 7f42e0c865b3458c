package tickbus.petri.sfc;

/**
 * An action at a step.
 *
 * @param step the index of the step
 * @param action the index of the action
 * @param qualifier one of the standard's
 * @param nanos the time of a qualifier that has one
 */
record Association(int step, int action, Qualifier qualifier, long nanos) {
    /** When an action is active. */
    enum Qualifier {
        N, S, R, L, D, P, P0, P1, SD, DS, SL;

        boolean isTimed() {
            return this == L || this == D || this == SD || this == DS || this == SL;
        }
    }
}
