package tickbus.machines.demo;

import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;

/** The PLC at the other end of the link, as far as the demo can control and observe it. */
public interface Plc extends AutoCloseable {
    /**
     * The PLC's counts at one moment of its current life, that is since power-on.
     *
     * @param scans scans of the PLC's program; -1 if it does not report them
     * @param rises rising edges per Boolean signal: those that the program saw of signals to it, and those that it made of
     * signals from it; the image starts with all bits off
     * @param nanoTime when the demo got them, on the clock of {@link System#nanoTime()}
     */
    record Counts(long scans, Map<String, Long> rises, long nanoTime) {
        /** Nothing is known yet. */
        static final Counts NONE = new Counts(-1, Map.of(), Long.MIN_VALUE);

        private static final String RISES = "plc.rises.";

        /**
         * Extracts the PLC's lines, {@code plc.scans} and {@code plc.rises.<signal>}, from statistics.
         *
         * @param statistics of a driver that hosts the PLC, or of the PLC's process
         * @param nanoTime when the demo got them, on the clock of {@link System#nanoTime()}
         * @return the counts
         * @throws DemoFailure if a value is no number
         */
        public static Counts of(Map<String, String> statistics, long nanoTime) {
            Map<String, Long> rises = new LinkedHashMap<>();
            statistics.forEach((key, value) -> {
                if (key.startsWith(RISES)) {
                    rises.put(key.substring(RISES.length()), number(key, value));
                }
            });
            String scans = statistics.get("plc.scans");
            return new Counts(scans == null ? -1 : number("plc.scans", scans), rises, nanoTime);
        }

        private static long number(String key, String value) {
            try {
                return Long.parseLong(value);
            } catch (NumberFormatException e) {
                throw new DemoFailure("the PLC's statistics say " + key + "=" + value + ", which is no count");
            }
        }
    }

    /**
     * Returns whether the demo can switch the PLC off and on.
     *
     * @return false if the demo does not control the PLC
     */
    boolean restartable();

    /**
     * Switches the PLC on: a new life begins, without any memory of an earlier one.
     *
     * @throws DemoFailure if the PLC cannot be started
     */
    void start();

    /** Cuts the PLC's power without warning; on return the PLC is dead. */
    void kill();

    /**
     * The newest counts of the current life.
     *
     * @return as reported last
     */
    Counts counts();

    /**
     * The PLC's output for people since the last call.
     *
     * @return lines
     */
    List<String> news();

    /**
     * The longest delay of a regular report, over all lives.
     *
     * @return nanoseconds, 0 if the PLC does not report regularly
     */
    long longestSilenceNanos();

    /**
     * Identifies the PLC for people.
     *
     * @return such as {@code process 4711}
     */
    String name();

    /**
     * Fails if the PLC has ended on its own.
     *
     * @throws DemoFailure with the PLC's last output
     */
    void check();

    /** Ends the PLC for good. */
    @Override
    void close();
}
