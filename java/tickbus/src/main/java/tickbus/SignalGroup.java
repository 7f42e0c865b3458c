package tickbus;

import java.util.List;

/** The signals that one end writes, or those that it reads: all at once, as an array of doubles. */
final class SignalGroup {
    private final long[] slots;
    /** The slot of each signal. */
    private final int[] at;
    /** Which of them hold an integer; mostly none. */
    private final int[] integers;
    private final IntegerKind[] kinds;

    SignalGroup(long[] slots, List<Signal> signals) {
        this.slots = slots;
        this.at = signals.stream().mapToInt(Signal::slot).toArray();
        List<Signal> wide = signals.stream().filter(signal -> signal.integer() != null).toList();
        this.integers = wide.stream().mapToInt(signals::indexOf).toArray();
        this.kinds = wide.stream().map(Signal::integer).toArray(IntegerKind[]::new);
    }

    int size() {
        return at.length;
    }

    /** The lowest slot of the group; 0 in an empty one. */
    int from() {
        return at.length == 0 ? 0 : at[0];
    }

    /** The slot behind the highest one of the group; 0 in an empty one. */
    int to() {
        return at.length == 0 ? 0 : at[at.length - 1] + 1;
    }

    void set(double[] values) {
        for (int i = 0; i < at.length; i++) {
            slots[at[i]] = Double.doubleToRawLongBits(values[i]);
        }
        for (int i = 0; i < integers.length; i++) {
            slots[at[integers[i]]] = kinds[i].fromDouble(values[integers[i]]);
        }
    }

    void get(double[] into) {
        for (int i = 0; i < at.length; i++) {
            into[i] = Double.longBitsToDouble(slots[at[i]]);
        }
        for (int i = 0; i < integers.length; i++) {
            into[integers[i]] = kinds[i].toDouble(slots[at[integers[i]]]);
        }
    }
}
