package tickbus.simulator;

import java.util.concurrent.CountDownLatch;
import java.util.concurrent.TimeUnit;

/**
 * Ends a run properly when the JVM is told to end, by Ctrl-C or by a signal: tells the run, and keeps the JVM from
 * ending until the run has closed its drivers.
 *
 * <p>The drivers are closed by the thread that ticks them, never by the JVM's shutdown thread, because a driver must
 * not be closed during an exchange. If a driver hangs, the JVM ends even so after a grace period.
 */
public final class ShutdownGuard implements AutoCloseable {
    private static final long GRACE_SECONDS = 5;

    private final CountDownLatch told = new CountDownLatch(1);
    private final CountDownLatch done = new CountDownLatch(1);
    private final Thread hook;
    private volatile boolean triggered;

    /** Guards a run from now on; create it before the drivers are opened. */
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
     * Whether the JVM is ending. The run asks before every tick.
     *
     * @return true once it was told to
     */
    public boolean triggered() {
        return triggered;
    }

    /**
     * Waits for the JVM to begin to end.
     *
     * @param millis how long to wait for that
     * @return true as soon as it was told to, false after the time
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
            // The JVM is ending already, and the hook is running; it was just released.
        }
    }
}
