package tickbus;

import java.nio.DoubleBuffer;
import java.nio.LongBuffer;
import java.util.ArrayList;
import java.util.Arrays;
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

    /** The signals that this end writes, or those that it reads. Created while the slots hold the fail-safe values. */
    SignalGroup(Layout layout, List<Signal> all, boolean written, Conversions conversions) {
        List<Signal> signals = new ArrayList<>();
        for (Signal signal : all) {
            if (signal.isWritten() == written) {
                signals.add(signal);
            }
        }
        this.slots = layout.slots();
        this.doubles = layout.doubles();
        this.at = new int[signals.size()];
        int[] wide = new int[at.length];
        int count = 0;
        for (int i = 0; i < at.length; i++) {
            at[i] = signals.get(i).slot();
            if (signals.get(i).integer() != null) {
                wide[count++] = i;
            }
        }
        this.dense = at.length > 0 && at[at.length - 1] - at[0] == at.length - 1;
        this.integers = Arrays.copyOf(wide, count);
        this.kinds = new IntegerKind[count];
        this.failSafe = new long[count];
        for (int i = 0; i < count; i++) {
            kinds[i] = signals.get(integers[i]).integer();
            failSafe[i] = slots.get(at[integers[i]]);
        }
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
