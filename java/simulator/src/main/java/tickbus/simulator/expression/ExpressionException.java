package tickbus.simulator.expression;

/** An expression has a mistake. */
public final class ExpressionException extends RuntimeException {
    private static final long serialVersionUID = 1L;

    private final int offset;

    ExpressionException(int offset, String message) {
        super(message);
        this.offset = offset;
    }

    /**
     * The place of the mistake.
     *
     * @return characters from the beginning of the expression
     */
    public int offset() {
        return offset;
    }
}
