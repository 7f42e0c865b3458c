package tickbus.machines.board;

import java.util.Locale;

/** The measurements; a value out of bounds has already ended the demo. */
final class LabFacts {
    /** The tolerance of a level around the thresholds of plc/lab/tanks.toml, in percent. */
    static final double MARGIN = 8;

    private static final double[] LOWEST = {40, 30};
    private static final double[] HIGHEST = {60, 50};

    private final double[] min = {100, 100};
    private final double[] max = {0, 0};
    private long heldNanos;
    private int lamps;
    private long slowestLampNanos;
    private int pulses;
    private int counted;
    private long wokeNanos;

    static boolean inBand(int tank, double level) {
        return level >= LOWEST[tank - 1] && level <= HIGHEST[tank - 1];
    }

    /**
     * Records the levels of one tick in which the controller should hold them.
     *
     * @return the error, or null
     */
    String level(int tank, double level, long stepNanos) {
        int i = tank - 1;
        min[i] = Math.min(min[i], level);
        max[i] = Math.max(max[i], level);
        heldNanos += i == 0 ? stepNanos : 0;
        if (level < LOWEST[i] - MARGIN || level > HIGHEST[i] + MARGIN) {
            return text("the level of tank %d is %.1f %%, it should be %.0f to %.0f %%", tank, level, LOWEST[i], HIGHEST[i]);
        }
        return null;
    }

    void lamp(long nanos) {
        lamps++;
        slowestLampNanos = Math.max(slowestLampNanos, nanos);
    }

    void pulse() {
        pulses++;
    }

    void counted(double gauge) {
        counted = (int) gauge;
    }

    void woke(long nanos) {
        wokeNanos = nanos;
    }

    /** The part of the last line with the measurements. */
    String line(int overtaken) {
        return text("levels=%.1f..%.1f,%.1f..%.1f held_s=%.1f lamps=%d lamp_ms=%d edges=%d/%d woke_ms=%d overtaken=%d",
                min[0], max[0], min[1], max[1], heldNanos / 1e9, lamps, slowestLampNanos / 1_000_000, counted,
                pulses, wokeNanos / 1_000_000, overtaken);
    }

    /** Rows of a table: the quantity, the measurement, the expectation. */
    Object[][] rows() {
        return new Object[][] {
            {"level of tank 1", text("%.1f to %.1f %%", min[0], max[0]), text("40 to 60 %%, or up to %.0f beyond", MARGIN)},
            {"level of tank 2", text("%.1f to %.1f %%", min[1], max[1]), text("30 to 50 %%, or up to %.0f beyond", MARGIN)},
            {"they were held for", text("%.1f s", heldNanos / 1e9), ""},
            {"switch 3 and its lamp", lamps + " times", "through both controllers"},
            {"the slowest lamp", slowestLampNanos / 1_000_000 + " ms", "2000 ms"},
            {"pulses of switch 4, counted by PANEL", counted, pulses + ", none lost"},
            {"TANKS is back in its connections after", wokeNanos / 1_000_000 + " ms", "without asking for them"},
        };
    }

    private static String text(String format, Object... values) {
        return String.format(Locale.ROOT, format, values);
    }
}
