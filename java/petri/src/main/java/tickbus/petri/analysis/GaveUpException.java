package tickbus.petri.analysis;

/** An analysis has reached its size limit. The message says how far it came. */
public final class GaveUpException extends RuntimeException {
    private static final long serialVersionUID = 1L;

    GaveUpException(String message) {
        super(message);
    }
}
