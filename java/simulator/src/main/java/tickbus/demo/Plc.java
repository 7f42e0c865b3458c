package tickbus.demo;

import java.util.List;
import java.util.Map;

/** The PLC at the other end of the link, as far as the demo can control and observe it. */
public interface Plc extends AutoCloseable {
    /**
     * The PLC's counts at one moment of its current life, that is since it was switched on.
     *
     * @param scans scans of its program; -1 if it does not report them
     * @param rises rising edges per Boolean signal: those that the program saw of signals to it, and those that it
     * made of signals from it; its image starts with all bits off
     * @param nanoTime when the demo got them, on the clock of {@link System#nanoTime()}
     */
    record Counts(long scans, Map<String, Long> rises, long nanoTime) {
        /** Nothing is known yet. */
        static final Counts NONE = new Counts(-1, Map.of(), Long.MIN_VALUE);
    }

    /**
     * Whether the demo can switch it off and on.
     *
     * @return false if the demo does not control it
     */
    boolean restartable();

    /**
     * Switches it on: a new life begins, without any memory of an earlier one.
     *
     * @throws DemoFailure if it cannot be started
     */
    void start();

    /** Cuts its power without warning; on return it is dead. */
    void kill();

    /**
     * The newest counts of the current life.
     *
     * @return as reported last
     */
    Counts counts();

    /**
     * Its output for people since the last call.
     *
     * @return lines
     */
    List<String> news();

    /**
     * The longest time by which one of its regular reports was late, over all its lives.
     *
     * @return nanoseconds, 0 if it does not report regularly
     */
    long longestSilenceNanos();

    /**
     * Identifies it for people.
     *
     * @return such as {@code process 4711}
     */
    String name();

    /**
     * Fails if it has ended on its own.
     *
     * @throws DemoFailure with its last output
     */
    void check();

    /** Ends it for good. */
    @Override
    void close();
}
