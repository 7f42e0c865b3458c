package tickbus.simulator.control;

import java.util.List;

/**
 * One row as written, with quotes resolved and blanks removed.
 *
 * @param line its line number
 * @param sources names in the source column, may be empty
 * @param variable name for the result, empty if it has none
 * @param transfer text of the transfer column, empty for copy
 * @param destination where the result goes, empty if nowhere
 */
record Row(int line, List<String> sources, String variable, String transfer, String destination) {
    /** The row's result in messages. */
    String result() {
        return variable.isEmpty() ? destination : variable;
    }
}
