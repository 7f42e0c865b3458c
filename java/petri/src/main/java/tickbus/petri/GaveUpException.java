package tickbus.petri;

/** An analysis that has reached its limit of size. The message says how far it came. */
public final class GaveUpException extends RuntimeException {
    private static final long serialVersionUID = 1L;

    GaveUpException(String message) {
        super(message);
    }
}
