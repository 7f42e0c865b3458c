package tickbus.simulator.demo;

import java.util.List;
import java.util.Map;

/** The PLC at the other end of the link, as far as the demo has its hands on it and can look into it. */
public interface Plc extends AutoCloseable {
    /**
     * What the PLC had counted at one moment of its present life, that is since it was switched on.
     *
     * @param scans scans of its program; -1 if it does not say
     * @param rises rising edges per Boolean signal: those that the program saw of a signal to it, and those that
     *     it made of a signal from it; its image begins with all bits off
     * @param nanoTime when the demo got them, on the clock of {@link System#nanoTime()}
     */
    record Counts(long scans, Map<String, Long> rises, long nanoTime) {
        /** Nothing is known yet. */
        static final Counts NONE = new Counts(-1, Map.of(), Long.MIN_VALUE);
    }

    /**
     * Whether the demo can take its power and give it back.
     *
     * @return false if it is out of the demo's reach
     */
    boolean restartable();

    /**
     * Switches it on: a new life begins, which remembers nothing of an earlier one.
     *
     * @throws DemoFailure if it cannot be started
     */
    void start();

    /** Takes its power away, without a warning; on return it is dead. */
    void kill();

    /**
     * The newest counts of the present life.
     *
     * @return as told last
     */
    Counts counts();

    /**
     * What it has told since the last call, for people.
     *
     * @return lines
     */
    List<String> news();

    /**
     * How much longer than it should it was silent, at the most, in all its lives.
     *
     * @return nanoseconds, 0 if it tells nothing regularly
     */
    long longestSilenceNanos();

    /**
     * Which one it is, for people.
     *
     * @return such as {@code process 4711}
     */
    String name();

    /**
     * Fails if it has ended without having been told to.
     *
     * @throws DemoFailure with what it said last
     */
    void check();

    /** Ends it for good. */
    @Override
    void close();
}
