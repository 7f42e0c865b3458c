package tickbus.simulator.text;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;

/** A text table with aligned columns. */
public final class Columns {
    private final List<String[]> rows = new ArrayList<>();
    private final boolean[] right;

    /**
     * An empty table.
     *
     * @param headings one per column; a heading that starts with {@code >} makes its column right aligned
     */
    public Columns(String... headings) {
        right = new boolean[headings.length];
        String[] row = new String[headings.length];
        for (int i = 0; i < row.length; i++) {
            right[i] = headings[i].startsWith(">");
            row[i] = right[i] ? headings[i].substring(1) : headings[i];
        }
        rows.add(row);
        rows.add(new String[0]);
    }

    /**
     * Adds a row.
     *
     * @param cells one per column
     * @throws IllegalArgumentException if their number differs from the columns
     */
    public void row(Object... cells) {
        if (cells.length != right.length) {
            throw new IllegalArgumentException("got " + cells.length + " cells for " + right.length + " columns");
        }
        rows.add(Arrays.stream(cells).map(String::valueOf).toArray(String[]::new));
    }

    /**
     * The table.
     *
     * @param indent put before each line
     * @return lines, each ended by a line feed, without blanks at their ends
     */
    public String text(String indent) {
        int[] widths = new int[right.length];
        for (String[] row : rows) {
            for (int i = 0; i < row.length; i++) {
                widths[i] = Math.max(widths[i], row[i].length());
            }
        }
        StringBuilder text = new StringBuilder();
        for (String[] row : rows) {
            StringBuilder line = new StringBuilder(indent);
            for (int i = 0; i < widths.length; i++) {
                String cell = row.length == 0 ? "-".repeat(widths[i]) : row[i];
                String blanks = " ".repeat(widths[i] - cell.length());
                line.append(i == 0 ? "" : "  ").append(right[i] ? blanks + cell : cell + blanks);
            }
            text.append(line.toString().stripTrailing()).append('\n');
        }
        return text.toString();
    }
}
