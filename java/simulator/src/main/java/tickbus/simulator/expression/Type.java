package tickbus.simulator.expression;

/** The types that the parts of an expression have. */
public enum Type {
    /** True or false; in the table 1 or 0. */
    BOOL,
    /** A whole number of 64 bits: results of {@code TO_LINT}, and counts. */
    LINT,
    /** A number of 64 bits, in the unit of its signal: every signal that is not BOOL. */
    LREAL,
    /** A duration in nanoseconds; only inside of an expression. */
    TIME
}
