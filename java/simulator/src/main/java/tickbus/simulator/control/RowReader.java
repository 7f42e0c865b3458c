package tickbus.simulator.control;

import java.util.ArrayList;
import java.util.List;

/** Splits a control table's text into rows: columns at bars, sources at commas, without comments and quotes. */
final class RowReader {
    private static final int COLUMNS = 4;
    /** The transfer column is the third one. */
    private static final int TRANSFER = 3;

    private final String file;
    private final List<Mistake> mistakes;

    RowReader(String file, List<Mistake> mistakes) {
        this.file = file;
        this.mistakes = mistakes;
    }

    /** All well-formed rows; mistakes in the others are added to the list. */
    List<Row> read(String text) {
        List<Row> rows = new ArrayList<>();
        int number = 0;
        for (String line : text.split("\\R", -1)) {
            number++;
            Row row = row(number, line);
            if (row != null) {
                rows.add(row);
            }
        }
        return rows;
    }

    private Row row(int number, String line) {
        List<List<String>> columns = new ArrayList<>();
        List<String> column = new ArrayList<>();
        StringBuilder part = new StringBuilder();
        boolean quoted = false;
        int begin = 0;
        int transfer = 0;
        String expression = "";
        for (int i = 0; i < line.length(); i++) {
            char c = line.charAt(i);
            if (c == '"') {
                quoted = !quoted;
            } else if (quoted) {
                part.append(c);
            } else if (c == '#' && (i == 0 || Character.isWhitespace(line.charAt(i - 1)))) {
                break;
            } else if (c == '|') {
                close(column, part);
                columns.add(column);
                column = new ArrayList<>();
                if (columns.size() == TRANSFER) {
                    transfer = begin;
                    expression = line.substring(begin, i);
                }
                begin = i + 1;
            } else if (c == ',' && columns.isEmpty()) {
                close(column, part);
            } else {
                part.append(c);
            }
        }
        if (quoted) {
            mistake(number, "a quotation mark is opened and not closed");
            return null;
        }
        if (columns.isEmpty() && column.isEmpty() && part.toString().isBlank()) {
            return null;
        }
        close(column, part);
        columns.add(column);
        int blanks = expression.length() - expression.stripLeading().length();
        return row(number, columns, expression.strip(), transfer + blanks + 1);
    }

    private static void close(List<String> column, StringBuilder part) {
        column.add(part.toString().strip());
        part.setLength(0);
    }

    private Row row(int number, List<List<String>> columns, String expression, int column) {
        if (columns.size() != COLUMNS) {
            mistake(number, "a row has four columns, source | variable | transfer | destination; this one has "
                    + columns.size());
            return null;
        }
        List<String> sources = columns.get(0);
        if (sources.size() == 1 && sources.get(0).isEmpty()) {
            sources = List.of();
        } else if (sources.contains("")) {
            mistake(number, "a source between the commas is missing");
            return null;
        }
        Row row = new Row(number, List.copyOf(sources), columns.get(1).get(0), columns.get(2).get(0),
                expression, column, columns.get(3).get(0));
        if (row.result().isEmpty()) {
            mistake(number, "the result goes nowhere; name a variable or a destination");
            return null;
        }
        if (row.variable().indexOf(':') >= 0) {
            mistake(number, "\"" + row.variable() + "\" is no name for a variable; it must not have a colon");
            return null;
        }
        return row;
    }

    private void mistake(int line, String what) {
        mistakes.add(new Mistake(file, line, what));
    }
}
