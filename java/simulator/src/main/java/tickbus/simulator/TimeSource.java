package tickbus.simulator;

import java.util.concurrent.locks.LockSupport;

/** The wall clock, and a way to wait for it; injected so that tests need not wait. */
public interface TimeSource {
    /**
     * The current time.
     *
     * @return nanoseconds since some fixed point, never decreasing
     */
    long nanoTime();

    /**
     * Waits; may return early.
     *
     * @param nanoTime until when
     */
    void waitUntil(long nanoTime);

    /**
     * The computer's own clock.
     *
     * @return reads {@link System#nanoTime} and parks the thread
     */
    static TimeSource system() {
        return new TimeSource() {
            @Override
            public long nanoTime() {
                return System.nanoTime();
            }

            @Override
            public void waitUntil(long nanoTime) {
                LockSupport.parkNanos(this, nanoTime - System.nanoTime());
            }
        };
    }
}
