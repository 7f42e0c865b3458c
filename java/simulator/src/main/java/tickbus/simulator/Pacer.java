package tickbus.simulator;

/**
 * Deadlines of real-time mode: start, start + step, start + 2 steps, and so on.
 *
 * <p>Deadlines are counted from the start and not from the previous tick, so there is no drift. A tick that is late by less
 * than a step is followed by the next one at its own time. After a longer stall the missed deadlines are dropped, and ticks
 * continue on the same grid, without a burst. Since each tick advances the simulation by one step, simulation time then lags
 * behind the clock by the dropped time.
 */
final class Pacer {
    private final TimeSource time;
    private final long stepNanos;
    private long deadline;
    private boolean started;
    private long lateTicks;
    private long droppedTicks;

    Pacer(TimeSource time, long stepNanos) {
        this.time = time;
        this.stepNanos = stepNanos;
    }

    /** Waits for the next tick's time; the first call does not wait. Returns early if interrupted. */
    void awaitTick() {
        long now = time.nanoTime();
        if (!started) {
            started = true;
            deadline = now;
            return;
        }
        deadline += stepNanos;
        long late = now - deadline;
        if (late >= stepNanos) {
            long dropped = late / stepNanos;
            deadline += dropped * stepNanos;
            droppedTicks += dropped;
            lateTicks++;
            return;
        }
        while (now - deadline < 0 && !Thread.currentThread().isInterrupted()) {
            time.waitUntil(deadline);
            now = time.nanoTime();
        }
    }

    /** Starts a new grid at the next call, after an intended pause. */
    void restart() {
        started = false;
    }

    /** Ticks that started a step or more after their time. */
    long lateTicks() {
        return lateTicks;
    }

    /** Ticks that were dropped because their time had passed in a stall. */
    long droppedTicks() {
        return droppedTicks;
    }
}
