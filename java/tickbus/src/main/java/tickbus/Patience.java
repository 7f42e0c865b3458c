package tickbus;

import java.util.function.Supplier;

/** Calls that wait for another thread's call. */
final class Patience {
    private Patience() {
    }

    /** Repeats a call until no other thread is using the driver. */
    static <T> T untilIdle(Supplier<T> call) {
        while (true) {
            try {
                return call.get();
            } catch (FieldbusException e) {
                waitAfter(e);
            }
        }
    }

    /** Pauses before a refused call is repeated; rethrows every exception but BUSY. */
    static void waitAfter(FieldbusException e) {
        if (e.status() != Status.BUSY) {
            throw e;
        }
        Thread.onSpinWait();
    }
}
