package tickbus.machines.demo;

import java.util.concurrent.locks.LockSupport;
import java.util.function.BooleanSupplier;
import java.util.function.Supplier;

/** Polls for an action of a process or a thread that gives a test no event to wait for. */
public final class Eventually {
    private static final long PATIENCE = 30_000_000_000L;

    private Eventually() {
    }

    /** The value, once there is one; a failure has {@code what}. */
    public static <T> T get(String what, Supplier<T> value) {
        long begin = System.nanoTime();
        T found = value.get();
        while (found == null) {
            if (System.nanoTime() - begin > PATIENCE) {
                throw new AssertionError("waited 30 s in vain for " + what);
            }
            LockSupport.parkNanos(1_000_000);
            found = value.get();
        }
        return found;
    }

    /** Returns once this is true. */
    public static void is(String what, BooleanSupplier reached) {
        get(what, () -> reached.getAsBoolean() ? true : null);
    }
}
