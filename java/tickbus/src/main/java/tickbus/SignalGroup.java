package tickbus;

import java.nio.DoubleBuffer;
import java.nio.LongBuffer;
import java.util.List;

/** All signals that one end writes, or all that it reads, as one array of doubles. */
final class SignalGroup {
    private final LongBuffer slots;
    private final DoubleBuffer doubles;
    /** The slot of each signal. */
    private final int[] at;
    /** True if the slots are consecutive, so that one bulk copy moves them. */
    private final boolean dense;
    /** Which of the signals hold an integer; usually none. */
    private final int[] integers;
    private final IntegerKind[] kinds;
    /** The value of each integer if NaN is set. */
    private final long[] failSafe;
    private final Conversions conversions;

    /** Created while the slots hold the fail-safe values, before the driver's first tick. */
    SignalGroup(Layout layout, List<Signal> signals, Conversions conversions) {
        this.slots = layout.slots();
        this.doubles = layout.doubles();
        this.at = signals.stream().mapToInt(Signal::slot).toArray();
        this.dense = at.length > 0 && at[at.length - 1] - at[0] == at.length - 1;
        List<Signal> wide = signals.stream().filter(signal -> signal.integer() != null).toList();
        this.integers = wide.stream().mapToInt(signals::indexOf).toArray();
        this.kinds = wide.stream().map(Signal::integer).toArray(IntegerKind[]::new);
        this.failSafe = wide.stream().mapToLong(signal -> slots.get(signal.slot())).toArray();
        this.conversions = conversions;
    }

    int size() {
        return at.length;
    }

    void set(double[] values) {
        if (dense) {
            doubles.put(at[0], values, 0, at.length);
        } else {
            for (int i = 0; i < at.length; i++) {
                doubles.put(at[i], values[i]);
            }
        }
        for (int i = 0; i < integers.length; i++) {
            slots.put(at[integers[i]], conversions.slot(kinds[i], values[integers[i]], failSafe[i]));
        }
    }

    void get(double[] into) {
        if (dense) {
            doubles.get(at[0], into, 0, at.length);
        } else {
            for (int i = 0; i < at.length; i++) {
                into[i] = doubles.get(at[i]);
            }
        }
        for (int i = 0; i < integers.length; i++) {
            into[integers[i]] = kinds[i].toDouble(slots.get(at[integers[i]]));
        }
    }
}
