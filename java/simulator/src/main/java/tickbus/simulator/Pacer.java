package tickbus.simulator;

/**
 * Deadlines of real-time mode: start, start + step, start + 2 steps, and so on.
 *
 * <p>Deadlines are counted from the start and not from the tick before, so nothing drifts. A tick that is
 * late by less than a step is followed by the next at that one's own time. After a longer stall the
 * deadlines that passed meanwhile are dropped, and ticks go on at the times of the same grid: nothing
 * catches up in a burst. Each tick advances the simulation by one step, so simulation time then lags behind
 * the clock by what was dropped.
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

    /** Begins a new grid at the next call, after a pause that was meant. */
    void restart() {
        started = false;
    }

    /** Ticks that started a step or more after their time. */
    long lateTicks() {
        return lateTicks;
    }

    /** Ticks that never started because their time passed in a stall. */
    long droppedTicks() {
        return droppedTicks;
    }
}
