package tickbus.simulator.control;

import java.util.List;

/**
 * One row as it was written, quotes resolved and blanks cut off.
 *
 * @param line its line number
 * @param sources names in the source column, may be empty
 * @param variable name for the result, empty if it has none
 * @param transfer text of the transfer column, empty for copy
 * @param destination where the result goes, empty if nowhere
 */
record Row(int line, List<String> sources, String variable, String transfer, String destination) {
    /** How messages name the row's result. */
    String result() {
        return variable.isEmpty() ? destination : variable;
    }
}
