package tickbus.simulator.control;

/**
 * A mistake in a control table.
 *
 * @param file name of the file, as the user gave it
 * @param line line number from 1; 0 for the whole file
 * @param what the mistake and the remedy
 */
public record Mistake(String file, int line, String what) {
    /** {@code file:line: what}, the format of editors and compilers. */
    @Override
    public String toString() {
        return line == 0 ? file + ": " + what : file + ":" + line + ": " + what;
    }
}
