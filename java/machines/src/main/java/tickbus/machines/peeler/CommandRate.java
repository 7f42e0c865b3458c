package tickbus.machines.peeler;

import java.util.Arrays;
import java.util.List;

/** How many commands each axis gets per second: over the whole run, and the maximum within any second. */
final class CommandRate {
    /** Holding Execute for 500 ms, as in 2018, permits no more commands per second and axis. */
    static final double PAPER = 2;

    private static final long SECOND = 1_000_000_000L;
    private static final List<AxisName> AXES = List.of(AxisName.values());

    private final Peeler line;
    private final int[] seen = new int[AXES.size()];
    private final int[] most = new int[AXES.size()];
    /** Times of the commands within the last second, per axis; no link carries more than fit here. */
    private final long[][] recent = new long[AXES.size()][1024];
    private final int[] first = new int[AXES.size()];
    private long begun = -1;
    private long now;

    CommandRate(Peeler line) {
        this.line = line;
    }

    /** Checks all axes; once per tick. */
    void look(long nanos) {
        now = nanos;
        for (int i = 0; i < seen.length; i++) {
            int commands = line.commands(AXES.get(i));
            while (seen[i] < commands) {
                begun = begun < 0 ? nanos : begun;
                long[] times = recent[i];
                times[seen[i] % times.length] = nanos;
                seen[i]++;
                while (nanos - times[first[i] % times.length] >= SECOND) {
                    first[i]++;
                }
                most[i] = Math.max(most[i], seen[i] - first[i]);
            }
        }
    }

    private double seconds() {
        return begun < 0 ? 0 : (now - begun) / (double) SECOND;
    }

    int commands() {
        return Arrays.stream(seen).sum();
    }

    /** Commands per second of an axis, counted from the first command to any axis. */
    double mean(AxisName axis) {
        return seconds() == 0 ? 0 : seen[axis.ordinal()] / seconds();
    }

    /** The mean over all axes. */
    double mean() {
        return seconds() == 0 ? 0 : commands() / seconds() / seen.length;
    }

    /** The most commands that an axis got within any second. */
    int most(AxisName axis) {
        return most[axis.ordinal()];
    }

    /** The axis with the most commands. */
    AxisName busiest() {
        AxisName busiest = AXES.get(0);
        for (AxisName axis : AXES) {
            busiest = seen[axis.ordinal()] > seen[busiest.ordinal()] ? axis : busiest;
        }
        return busiest;
    }

    int commands(AxisName axis) {
        return seen[axis.ordinal()];
    }
}
