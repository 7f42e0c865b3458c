package tickbus.simulator;

import java.util.concurrent.CountDownLatch;
import java.util.concurrent.TimeUnit;

/**
 * Ends a run properly when Ctrl-C or a signal ends the JVM: informs the run, and keeps the JVM from ending until the run has
 * closed its drivers.
 *
 * <p>The thread that ticks the drivers closes them, never the JVM's shutdown thread, because a driver must not be closed
 * during an exchange. If a driver hangs, the JVM ends after a grace period anyway.
 */
public final class ShutdownGuard implements AutoCloseable {
    private static final long GRACE_SECONDS = 5;

    private final CountDownLatch told = new CountDownLatch(1);
    private final CountDownLatch done = new CountDownLatch(1);
    private final Thread hook;
    private volatile boolean triggered;

    /** Guards a run from now on; create the guard before opening the drivers. */
    public ShutdownGuard() {
        hook = new Thread(this::end, "shutdown guard");
        Runtime.getRuntime().addShutdownHook(hook);
    }

    private void end() {
        triggered = true;
        told.countDown();
        try {
            if (!done.await(GRACE_SECONDS, TimeUnit.SECONDS)) {
                System.err.println("the drivers were not closed within " + GRACE_SECONDS + " s; ending without them");
            }
        } catch (InterruptedException e) {
            Thread.currentThread().interrupt();
        }
    }

    /**
     * Returns whether the JVM is ending. The run asks before every tick.
     *
     * @return true once the end has begun
     */
    public boolean triggered() {
        return triggered;
    }

    /**
     * Waits for the JVM to begin to end.
     *
     * @param millis how long to wait
     * @return true as soon as the JVM is ending, false after the time
     */
    public boolean triggers(long millis) {
        try {
            return told.await(millis, TimeUnit.MILLISECONDS);
        } catch (InterruptedException e) {
            Thread.currentThread().interrupt();
            return triggered;
        }
    }

    /** The run is over and its drivers are closed. */
    @Override
    public void close() {
        done.countDown();
        try {
            Runtime.getRuntime().removeShutdownHook(hook);
        } catch (IllegalStateException e) {
            // The JVM is ending already, and its hook is running; it was just released.
        }
    }
}
