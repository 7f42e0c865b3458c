package tickbus.machines.peeler;

import java.util.Locale;
import java.util.Map;
import tickbus.machines.demo.DemoFailure;

/**
 * The times between records at their destination, in one direction of one link.
 *
 * @param count the number of intervals
 * @param mean in milliseconds, like {@code max} and {@code min}
 * @param max the longest
 * @param min the shortest
 * @param variance in square milliseconds
 */
record Intervals(long count, double mean, double max, double min, double variance) {
    /** To agree with its other figures, the paper's variances must be in thousandths of square seconds. */
    private static final double PAPER_VARIANCE = 1e3;

    /**
     * The four directions, and the measurements of S. Nyyssönen in 2018 (table 4 of his thesis, Wireshark at the PC).
     */
    enum Direction {
        /** Commands to the charger. */
        CHARGER_TO_SIMULATION("charger -> simulation", 12298, 10.03, 31.11, 7.98, 0.00094),
        /** Commands to the lathe. */
        LATHE_TO_SIMULATION("lathe -> simulation", 15426, 10.11, 20.88, 7.54, 0.00154),
        /** Feedback of the charger. */
        SIMULATION_TO_CHARGER("simulation -> charger", 7907, 15.61, 35.34, 1.39, 0.01742),
        /** Feedback of the lathe. */
        SIMULATION_TO_LATHE("simulation -> lathe", 9993, 15.61, 38.85, 2.00, 0.01700);

        private final String text;
        private final Intervals paper;

        Direction(String text, long count, double mean, double max, double min, double variance) {
            this.text = text;
            this.paper = new Intervals(count, mean, max, min, variance * PAPER_VARIANCE);
        }

        String text() {
            return text;
        }

        Intervals paper() {
            return paper;
        }
    }

    /**
     * Reads the intervals from the statistics of the receiving end.
     *
     * @throws DemoFailure if nothing was measured
     */
    static Intervals of(Map<String, String> statistics, Direction direction) {
        long count = (long) number(statistics, "count", direction);
        if (count == 0) {
            throw new DemoFailure("no records came from " + direction.text());
        }
        double deviation = number(statistics, "stdev_us", direction) / 1e3;
        return new Intervals(count, number(statistics, "mean_us", direction) / 1e3,
                number(statistics, "max_us", direction) / 1e3, number(statistics, "min_us", direction) / 1e3,
                deviation * deviation);
    }

    private static double number(Map<String, String> statistics, String part, Direction direction) {
        String key = "bus_cycle." + part;
        String value = statistics.get(key);
        try {
            return Double.parseDouble(value == null ? "" : value);
        } catch (NumberFormatException e) {
            throw new DemoFailure("the receiving end of " + direction.text() + " tells no " + key);
        }
    }

    /** Cells of a table: count, mean, max, min, variance, standard deviation. */
    Object[] cells(String who, String direction) {
        return new Object[] {direction, who, count, text(mean), text(max), text(min), text(variance),
            text(Math.sqrt(variance))};
    }

    private static String text(double value) {
        return String.format(Locale.ROOT, "%.2f", value);
    }
}
