package tickbus.simulator.demo;

import tickbus.simulator.TimeSource;

/**
 * Notices when this whole machine stands still, as a busy one does, or one that is the guest of another: a tick then
 * comes much too late, or the PLC's regular statistics do. Data that are stale for that reason say nothing about the
 * link.
 */
public final class Stalls {
    /** Half of the least max_age: who stood still for so long may have made the other end's data stale. */
    private static final long LONG_NANOS = 125_000_000L;

    private final TimeSource time;
    private final long stepNanos;
    private long last;
    private boolean counting;
    private long longest;

    /**
     * Nothing has stood still yet.
     *
     * @param time the clock
     * @param stepNanos how often {@link #look} is called
     */
    public Stalls(TimeSource time, long stepNanos) {
        this.time = time;
        this.stepNanos = stepNanos;
    }

    /** Looks at the clock; once a tick, in real-time mode. */
    public void look() {
        long now = time.nanoTime();
        if (counting) {
            longest = Math.max(longest, now - last - stepNanos);
        }
        last = now;
        counting = true;
    }

    /** The pause before the next tick is meant. */
    public void pause() {
        counting = false;
    }

    /**
     * The other end was silent for longer than it should be.
     *
     * @param nanos for how much longer
     */
    public void silent(long nanos) {
        longest = Math.max(longest, nanos);
    }

    /**
     * The longest one.
     *
     * @return nanoseconds; 0 if none was long enough to matter
     */
    public long longestNanos() {
        return longest < LONG_NANOS ? 0 : longest;
    }
}
