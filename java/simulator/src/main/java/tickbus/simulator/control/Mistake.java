package tickbus.simulator.control;

/**
 * Something wrong in a control table.
 *
 * @param file name of the file, as the user gave it
 * @param line line number from 1; 0 if the file as a whole is meant
 * @param what what is wrong and what would be right
 */
public record Mistake(String file, int line, String what) {
    /** {@code file:line: what}, as editors and compilers show it. */
    @Override
    public String toString() {
        return line == 0 ? file + ": " + what : file + ":" + line + ": " + what;
    }
}
