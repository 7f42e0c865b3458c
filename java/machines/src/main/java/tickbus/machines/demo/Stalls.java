package tickbus.machines.demo;

import tickbus.simulator.TimeSource;

/**
 * Detects that the whole computer has stalled, because it is busy or a virtual machine: a tick or the PLC's regular
 * statistics then come much too late. Data that are stale for that reason prove nothing about the link.
 */
public final class Stalls {
    /** Half of the smallest max_age: a stall of this length can have made the other end's data stale. */
    private static final long LONG_NANOS = 125_000_000L;

    private final TimeSource time;
    private final long stepNanos;
    private long last;
    private boolean counting;
    private long longest;

    /**
     * Begins without a stall.
     *
     * @param time the clock
     * @param stepNanos the interval of the calls of {@link #look}
     */
    public Stalls(TimeSource time, long stepNanos) {
        this.time = time;
        this.stepNanos = stepNanos;
    }

    /** Checks the clock; once per tick, in real-time mode. */
    public void look() {
        long now = time.nanoTime();
        if (counting) {
            longest = Math.max(longest, now - last - stepNanos);
        }
        last = now;
        counting = true;
    }

    /** The pause before the next tick is intended. */
    public void pause() {
        counting = false;
    }

    /**
     * The other end was silent for longer than expected.
     *
     * @param nanos the excess in nanoseconds
     */
    public void silent(long nanos) {
        longest = Math.max(longest, nanos);
    }

    /**
     * The longest stall.
     *
     * @return nanoseconds; 0 without a relevant stall
     */
    public long longestNanos() {
        return longest < LONG_NANOS ? 0 : longest;
    }
}
