package tickbus.simulator.expression;

/**
 * A typed part of an expression, which computes its value from the table's values.
 *
 * <p>Each node is computed exactly once per tick, so blocks with a state can stand anywhere. Computing allocates nothing.
 */
final class Node {
    /** Computes a BOOL. */
    @FunctionalInterface
    interface Truth {
        boolean of(double[] values);
    }

    /** Computes a LINT, or a TIME in nanoseconds. */
    @FunctionalInterface
    interface Whole {
        long of(double[] values);
    }

    /** Computes an LREAL. */
    @FunctionalInterface
    interface Real {
        double of(double[] values);
    }

    /** Null for a variable of the machine whose type its use decides. */
    final Type type;
    /** The place in the expression. */
    final int offset;
    /** True for a whole number as written, which is an LREAL beside one. */
    final boolean literal;
    /** The name of a node without a type. */
    final String name;
    /** The index of a node without a type. */
    final int index;
    private final Truth truth;
    private final Whole whole;
    private final Real real;

    private Node(Type type, int offset, boolean literal, Truth truth, Whole whole, Real real) {
        this(type, offset, literal, null, -1, truth, whole, real);
    }

    private Node(Type type, int offset, boolean literal, String name, int index, Truth truth, Whole whole, Real real) {
        this.type = type;
        this.offset = offset;
        this.literal = literal;
        this.name = name;
        this.index = index;
        this.truth = truth;
        this.whole = whole;
        this.real = real;
    }

    static Node truth(int offset, Truth truth) {
        return new Node(Type.BOOL, offset, false, truth, null, null);
    }

    static Node whole(int offset, Whole whole) {
        return new Node(Type.LINT, offset, false, null, whole, null);
    }

    static Node time(int offset, Whole nanos) {
        return new Node(Type.TIME, offset, false, null, nanos, null);
    }

    static Node real(int offset, Real real) {
        return new Node(Type.LREAL, offset, false, null, null, real);
    }

    /** A whole number as written. */
    static Node literal(int offset, long number) {
        return new Node(Type.LINT, offset, true, null, values -> number, null);
    }

    /** A value of the table. */
    static Node value(int offset, String name, int index, Type type) {
        if (type == null) {
            return new Node(null, offset, false, name, index, values -> values[index] != 0, null, values -> values[index]);
        }
        return switch (type) {
            case BOOL -> truth(offset, values -> values[index] != 0);
            case LINT -> whole(offset, values -> (long) values[index]);
            case LREAL -> real(offset, values -> values[index]);
            case TIME -> throw new IllegalArgumentException("no value of a table is a TIME");
        };
    }

    boolean truth(double[] values) {
        return truth.of(values);
    }

    long whole(double[] values) {
        return whole.of(values);
    }

    double real(double[] values) {
        return real.of(values);
    }

    /** The node as an LREAL, for a whole number as written and a value without a type. */
    Node asReal() {
        Whole number = whole;
        return literal ? real(offset, values -> number.of(values)) : real(offset, real);
    }

    /** The node as a BOOL, for a value without a type. */
    Node asTruth() {
        return truth(offset, truth);
    }

    /** The value as the table keeps it; of a node that is no TIME. */
    Real stored() {
        if (type == null) {
            return real;
        }
        return switch (type) {
            case BOOL -> values -> truth.of(values) ? 1 : 0;
            case LINT, TIME -> values -> whole.of(values);
            case LREAL -> real;
        };
    }
}
