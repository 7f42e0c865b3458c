package tickbus.simulator;

/** The user's files or folders are wrong; the message says how, and what would be right. */
public final class WrongInput extends RuntimeException {
    private static final long serialVersionUID = 1L;

    /**
     * For one mistake or several.
     *
     * @param message lines for people
     */
    public WrongInput(String message) {
        super(message);
    }

    /**
     * For a mistake reported by an exception.
     *
     * @param message lines for people
     * @param cause the exception
     */
    public WrongInput(String message, Throwable cause) {
        super(message, cause);
    }
}
