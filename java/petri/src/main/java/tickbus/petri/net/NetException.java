package tickbus.petri.net;

/**
 * A net that cannot be built or read. The message has the location, what was found, what was expected and what to do; each
 * mistake of a builder is on a separate line.
 */
public final class NetException extends RuntimeException {
    private static final long serialVersionUID = 1L;

    private final String source;
    private final int line;
    private final String element;

    /**
     * A mistake, for readers of files.
     *
     * @param source the file, or the name of the net
     * @param line the line in the file, from 1; 0 without a line
     * @param element the element, such as {@code arc a3}; empty if the whole is meant
     * @param message what was found, what was expected, and what to do
     */
    public NetException(String source, int line, String element, String message) {
        super(source + (line > 0 ? ":" + line : "") + ": " + (element.isEmpty() ? "" : element + ": ") + message);
        this.source = source;
        this.line = line;
        this.element = element;
    }

    /** The file, or the name of the net if it does not come from a file. */
    public String source() {
        return source;
    }

    /** The line in the file, from 1; 0 without a line. */
    public int line() {
        return line;
    }

    /** The element of the file or net, such as {@code arc a3}; empty if the whole is meant. */
    public String element() {
        return element;
    }
}
