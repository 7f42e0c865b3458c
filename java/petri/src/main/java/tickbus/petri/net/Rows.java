package tickbus.petri.net;

import java.util.Arrays;

/** Rows of integers, added one by one and removed by column. */
final class Rows {
    private final int[][] columns;
    private int size;

    Rows(int width) {
        columns = new int[width][16];
    }

    void add(int... row) {
        for (int c = 0; c < columns.length; c++) {
            if (size == columns[c].length) {
                columns[c] = Arrays.copyOf(columns[c], 2 * size);
            }
            columns[c][size] = row[c];
        }
        size++;
    }

    int size() {
        return size;
    }

    int get(int column, int row) {
        return columns[column][row];
    }

    int[] column(int column) {
        return Arrays.copyOf(columns[column], size);
    }
}
