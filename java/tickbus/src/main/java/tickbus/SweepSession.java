package tickbus;

import java.nio.file.Path;
import java.util.List;

/**
 * A sweep of faults over a scenario, for test frameworks: what {@code [sweep]} is in a test file of {@code tickbus test},
 * with a machine and a scenario in Java. Its faults, its verdicts and its accepted verdicts are the same.
 *
 * <p>Each run is made on a driver that has just been opened, with a stepped bus: first that without a fault, then
 * {@link #plan}, then one for each fault at each moment. In a run {@link #before} comes right before each exchange and
 * {@link #after} right after it, until the run is over; {@link #idle} says that the scenario is done, and the ticks go on.
 *
 * <p>Used by one thread at a time, the one that ticks the driver.
 */
public final class SweepSession implements AutoCloseable {
    /** The verdict of one run. */
    public static final class Verdict {
        private final boolean passes;
        private final String word;
        private final String what;

        private Verdict(String[] lines) {
            this.passes = Boolean.parseBoolean(lines[0]);
            this.word = lines[1];
            this.what = lines[2];
        }

        /**
         * Returns whether the verdict is right, or was accepted.
         *
         * @return false for a failure
         */
        public boolean passes() {
            return passes;
        }

        /**
         * The verdict in one word.
         *
         * @return {@code told}, {@code right}, {@code differs}, {@code still} or {@code never}; {@code wrong} if the run could
         *     not be judged
         */
        public String word() {
            return word;
        }

        /**
         * The verdict as a sentence.
         *
         * @return if it does not pass and another one was accepted, that one is in a second line
         */
        public String what() {
            return what;
        }
    }

    /** Passes, word, sentence. */
    private static final int LINES = 3;

    private final long handle;
    private boolean closed;

    /**
     * Reads the keys of a sweep.
     *
     * @param bus a driver with the signals of the sweep
     * @param name what messages and the file of accepted verdicts call the sweep: a file name
     * @param folder the folder from which paths are seen
     * @param keys the keys of {@code [sweep]} but for {@code scenario}, one per line
     * @param stepNanos the simulation time of each tick
     * @throws FieldbusException {@link Status#BAD_ARGUMENT} with every mistake in the keys
     */
    public SweepSession(Tickbus bus, String name, Path folder, String keys, long stepNanos) {
        this.handle = openNative(bus.handle(), name, folder.toString(), keys, stepNanos);
    }

    /**
     * Begins the run without a fault, on a driver that has just been opened.
     *
     * @param bus the driver
     */
    public void beginWithoutFault(Tickbus bus) {
        beginNative(handle, bus.handle(), -1);
    }

    /**
     * Begins a run with a fault, on a driver that has just been opened.
     *
     * @param bus the driver
     * @param run its place in the list of {@link #plan}
     */
    public void begin(Tickbus bus, int run) {
        beginNative(handle, bus.handle(), run);
    }

    /**
     * Injects the fault if its moment has come. Call this right before each exchange, when the machine has set its sensors.
     *
     * @param bus the driver of the run
     */
    public void before(Tickbus bus) {
        beforeNative(handle, bus.handle());
    }

    /**
     * Looks at the values of an exchange, right after it.
     *
     * @param bus the driver of the run
     * @return true if the run is over
     */
    public boolean after(Tickbus bus) {
        return afterNative(handle, bus.handle());
    }

    /**
     * Ends the scenario. The driver ticks on until the run is over.
     *
     * @param bus the driver of the run
     * @return true if the run is over
     */
    public boolean idle(Tickbus bus) {
        return idleNative(handle, bus.handle());
    }

    /**
     * Lists the runs with a fault, after the one without.
     *
     * @param rewriting true if all verdicts are about to be accepted: faults that the sweep does not have any more are then
     *     no mistake in the file
     * @return their names, such as {@code LA1 bottom stuck-on @ Step 3}
     * @throws FieldbusException {@link Status#BAD_ARGUMENT} if a moment never came, if a condition held that only a fault
     *     may cause, or with every mistake in the accepted verdicts
     */
    public List<String> plan(boolean rewriting) {
        return planNative(handle, rewriting).lines().toList();
    }

    /**
     * The verdict of a run that is over.
     *
     * @param run its place in the list of {@link #plan}
     * @return null if the run is not over
     */
    public Verdict verdict(int run) {
        String[] lines = resultNative(handle, run).split("\n", LINES);
        return lines.length == LINES ? new Verdict(lines) : null;
    }

    /**
     * The matrix of the runs so far, with their counts and their hash in the last line.
     *
     * @return as {@code tickbus test} prints it
     */
    public String summary() {
        return summaryNative(handle);
    }

    /**
     * Writes the page of the runs so far: their matrix, whose cells open reports.
     *
     * @param page the HTML file
     * @param again the command that repeats a run, with <code>{}</code> in the place of its name
     * @param reports the report about the recording of each run, in the order of {@link #plan}; null for none
     * @throws FieldbusException {@link Status#BAD_ARGUMENT} if it cannot be written
     */
    public void page(Path page, String again, List<Path> reports) {
        StringBuilder lines = new StringBuilder();
        for (Path report : reports) {
            lines.append(report == null ? "" : report).append('\n');
        }
        pageNative(handle, page.toString(), again, lines.toString());
    }

    /**
     * Writes the verdicts of all runs as accepted.
     *
     * @return the file
     * @throws FieldbusException {@link Status#BAD_ARGUMENT} if a run was not made, or the file cannot be written
     */
    public Path accept() {
        return Path.of(acceptNative(handle));
    }

    /** Ends the sweep. Closing twice is allowed. */
    @Override
    public void close() {
        if (!closed) {
            closed = true;
            closeNative(handle);
        }
    }

    private static native long openNative(long driver, String name, String folder, String keys, long stepNanos);

    private static native void closeNative(long sweep);

    private static native void beginNative(long sweep, long driver, int cell);

    private static native void beforeNative(long sweep, long driver);

    private static native boolean afterNative(long sweep, long driver);

    private static native boolean idleNative(long sweep, long driver);

    private static native String planNative(long sweep, boolean rewriting);

    private static native String resultNative(long sweep, int cell);

    private static native String summaryNative(long sweep);

    private static native String acceptNative(long sweep);

    private static native void pageNative(long sweep, String page, String again, String reports);
}
