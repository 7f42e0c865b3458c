package tickbus.simulator;

/** A device driver failed: while opening, in a tick, or while closing. */
public final class DriverFailure extends RuntimeException {
    private static final long serialVersionUID = 1L;

    /**
     * Wraps an exception of a driver.
     *
     * @param what the driver, and its action
     * @param cause the exception; its message is shown
     */
    public DriverFailure(String what, Throwable cause) {
        super(what + ": " + reason(cause), cause);
    }

    private static String reason(Throwable cause) {
        return cause.getMessage() == null ? cause.toString() : cause.getMessage();
    }
}
