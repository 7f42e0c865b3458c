package tickbus;

import java.time.Duration;
import java.util.concurrent.locks.LockSupport;
import java.util.function.LongConsumer;
import java.util.function.LongSupplier;

/**
 * Paces a loop by the computer's clock, for a PLC in real time: one turn per period, the first one at once.
 *
 * <pre>{@code
 * Pace pace = Pace.every(Duration.ofMillis(10));
 * while (simulating) {
 *     bus.receive(pace.await());
 *     machine.step();
 *     bus.send();
 * }
 * }</pre>
 *
 * <p>A late turn does not delay the next one. Missed turns, as on a busy computer, are skipped: a burst would only carry
 * outdated values. {@link #lagNanos} and {@link #missed} report both. For one thread.
 */
public final class Pace {
    private final long period;
    private final LongSupplier clock;
    private final LongConsumer sleep;
    private boolean begun;
    private long begin;
    private long turn;
    private long lag;
    private long missed;

    Pace(Duration period, LongSupplier clock, LongConsumer sleep) {
        if (period.isNegative() || period.isZero()) {
            throw new IllegalArgumentException("the period is " + period + "; it must be above 0");
        }
        this.period = period.toNanos();
        this.clock = clock;
        this.sleep = sleep;
    }

    /**
     * A pace that begins with the first {@link #await}.
     *
     * @param period of a turn
     * @return the pace
     * @throws IllegalArgumentException if the period is not above 0
     */
    public static Pace every(Duration period) {
        return new Pace(period, System::nanoTime, LockSupport::parkNanos);
    }

    /**
     * Waits until the next turn is due.
     *
     * @return when the turn was due, in nanoseconds since the first turn: the simulation's time, if it keeps pace with the
     * clock
     * @throws InterruptedException if this thread is interrupted
     */
    public long await() throws InterruptedException {
        if (begun) {
            turn++;
        } else {
            begun = true;
            begin = clock.getAsLong();
        }
        long late = clock.getAsLong() - begin - turn * period;
        while (late < 0) {
            sleep.accept(-late);
            if (Thread.interrupted()) {
                throw new InterruptedException();
            }
            late = clock.getAsLong() - begin - turn * period;
        }
        turn += late / period;
        missed = late / period;
        lag = late % period;
        return turn * period;
    }

    /**
     * How late the last turn began.
     *
     * @return nanoseconds
     */
    public long lagNanos() {
        return lag;
    }

    /**
     * How many turns before the last one were skipped.
     *
     * @return counts from 0
     */
    public long missed() {
        return missed;
    }
}
