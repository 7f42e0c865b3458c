package tickbus;

import java.util.function.Supplier;

/** Calls that wait for another thread's. */
final class Patience {
    private Patience() {
    }

    /** Makes a call again and again until no other thread is in its way. */
    static <T> T untilIdle(Supplier<T> call) {
        while (true) {
            try {
                return call.get();
            } catch (FieldbusException e) {
                waitAfter(e);
            }
        }
    }

    /** Lets a call that met another thread's be tried again; throws what is no such meeting. */
    static void waitAfter(FieldbusException e) {
        if (e.status() != Status.BUSY) {
            throw e;
        }
        Thread.onSpinWait();
    }
}
