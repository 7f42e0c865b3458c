package tickbus.petri.analysis;

import java.util.Arrays;

/** A list of ints. */
final class Ints {
    /** The most ints of a list. */
    static final int MOST = Integer.MAX_VALUE - 16;

    private int[] values = new int[64];
    private int size;

    void add(int value) {
        if (size == values.length) {
            values = Arrays.copyOf(values, (int) Math.min(MOST, values.length * 3L / 2));
        }
        values[size++] = value;
    }

    int get(int at) {
        return values[at];
    }

    void set(int at, int value) {
        values[at] = value;
    }

    int pop() {
        return values[--size];
    }

    Ints copy() {
        Ints copy = new Ints();
        copy.values = values.clone();
        copy.size = size;
        return copy;
    }

    int[] toArray() {
        return Arrays.copyOf(values, size);
    }

    int size() {
        return size;
    }

    long bytes() {
        return 4L * values.length;
    }

    /** The bytes needed while a longer array replaces the full one. */
    long bytesToGrow() {
        return size < values.length ? 0 : bytes() / 2 * 3;
    }
}
