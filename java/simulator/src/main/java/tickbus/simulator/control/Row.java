package tickbus.simulator.control;

import java.util.List;

/**
 * One row as written, with quotes resolved and blanks removed.
 *
 * @param line the row's line number
 * @param sources names in the source column, can be empty
 * @param variable name for the result, can be empty
 * @param transfer text of the transfer column, empty for copy
 * @param expression the same text with its quotes
 * @param column the column in the line, from 1, in which that text begins
 * @param destination destination of the result, can be empty
 */
record Row(int line, List<String> sources, String variable, String transfer, String expression, int column,
        String destination) {
    /** The row's result in messages. */
    String result() {
        return variable.isEmpty() ? destination : variable;
    }
}
