package tickbus.simulator.control;

/**
 * A mistake in a control table.
 *
 * @param file name of the file, as the user gave it
 * @param line line number from 1; 0 for the whole file
 * @param column column from 1; 0 for the whole line
 * @param what the mistake and the remedy
 */
public record Mistake(String file, int line, int column, String what) {
    /**
     * A mistake of a whole line or file.
     *
     * @param file name of the file, as the user gave it
     * @param line line number from 1; 0 for the whole file
     * @param what the mistake and the remedy
     */
    public Mistake(String file, int line, String what) {
        this(file, line, 0, what);
    }

    /** {@code file:line:column: what}, the format of editors and compilers. */
    @Override
    public String toString() {
        return file + (line == 0 ? "" : ":" + line) + (column == 0 ? "" : ":" + column) + ": " + what;
    }
}
