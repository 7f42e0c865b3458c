package tickbus;

/** The events of a driver, on their way from the native library to the handler. */
final class Events {
    /** The most events fetched by one native call. */
    private static final int EVENTS = 64;
    /** The most events handed over by one call: as many as the driver's ring holds. */
    private static final int MOST = 4096;
    /** Longs per event: signal, slot, time. */
    private static final int WORDS = 3;

    private final Tickbus bus;
    /** Fetched events; those from {@code next} to {@code end} have not been handed over yet. */
    private long[] fetched;
    private int next;
    private int end;

    Events(Tickbus bus) {
        this.bus = bus;
    }

    /** Forgets the fetched events. */
    void drop() {
        next = 0;
        end = 0;
    }

    /** Hands over pending events, and returns their number; throws {@link FieldbusException}. */
    int poll(EventHandler handler) {
        int total = 0;
        // The handler may close the driver.
        while (total < MOST && !bus.isClosed() && (next < end || take())) {
            int at = next;
            next += WORDS;
            total++;
            Signal signal = bus.signals().get((int) fetched[at]);
            handler.event(signal, signal.value(fetched[at + 1]), fetched[at + 2]);
        }
        return total;
    }

    /** Fetches events; false if nothing has happened. Like {@link Patience#untilIdle}, which would allocate. */
    private boolean take() {
        if (fetched == null) {
            fetched = new long[EVENTS * WORDS];
        }
        while (true) {
            try {
                end = Tickbus.eventsNative(bus.handle(), fetched) * WORDS;
                next = 0;
                return end > 0;
            } catch (FieldbusException e) {
                Patience.waitAfter(e);
            }
        }
    }
}
