package tickbus;

/**
 * The only exception of tickbus: a status code, and a message that says what happened and what to do.
 */
public final class FieldbusException extends RuntimeException {
    private static final long serialVersionUID = 1L;

    /** The status code, below zero. */
    private final int code;

    /**
     * Thrown by the native library, and by this package.
     *
     * @param code a code of {@link Status}
     * @param message what happened and what to do
     */
    public FieldbusException(int code, String message) {
        super(message);
        this.code = code;
    }

    /** For what happened, with the remedy of the status table. */
    FieldbusException(Status status, String what) {
        this(status.code(), status + " (" + status.code() + "): " + what + "\n  " + status.remedy());
    }

    /**
     * The status code.
     *
     * @return one of {@link Status}'s codes
     */
    public int code() {
        return code;
    }

    /**
     * The status behind the code.
     *
     * @return {@link Status#of} the code
     */
    public Status status() {
        return Status.of(code);
    }
}
