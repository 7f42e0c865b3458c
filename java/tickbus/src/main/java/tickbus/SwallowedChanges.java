package tickbus;

import java.util.Collections;
import java.util.LinkedHashMap;
import java.util.Map;

/** The changes that came and went before the other side took a frame (docs/timing.md). */
public final class SwallowedChanges {
    private SwallowedChanges() {
    }

    /**
     * The number of swallowed changes of all signals, for a look after each tick: only when it has grown does {@link #of}
     * find something new. Called by the ticking thread.
     *
     * @param bus an open driver
     * @return -1 while another thread reads or closes the driver, or if it is closed
     * @throws FieldbusException {@link Status#BUSY} if another thread ticks this driver
     */
    public static long count(Tickbus bus) {
        bus.mustBeTicker();
        return countNative(bus.handle());
    }

    /**
     * The signals with swallowed changes.
     *
     * @param bus an open driver
     * @return by the signal's name: how often, between which steps, and what to do; unmodifiable, in the order of driver.cfg
     * @throws FieldbusException {@link Status#BUSY}, {@link Status#CLOSED} or {@link Status#INTERNAL}
     */
    public static Map<String, String> of(Tickbus bus) {
        String lines = linesNative(bus.handle());
        if (lines.isEmpty()) {
            return Map.of();
        }
        Map<String, String> found = new LinkedHashMap<>();
        lines.lines().forEach(line -> {
            int tab = line.indexOf('\t');
            found.put(bus.signals().get(Integer.parseInt(line.substring(0, tab))).name(), line.substring(tab + 1));
        });
        return Collections.unmodifiableMap(found);
    }

    /** Like a tick, this does not enter the JVM again. */
    static native long countNative(long handle);

    /** A line per signal, its index and a tab before the text; throws {@link FieldbusException}. */
    static native String linesNative(long handle);
}
