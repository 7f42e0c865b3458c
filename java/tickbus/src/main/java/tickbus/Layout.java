package tickbus;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.DoubleBuffer;
import java.nio.LongBuffer;
import java.util.ArrayList;
import java.util.List;

/**
 * The shared buffer, and the driver's description of it. The native library fills it once, while a driver is being opened,
 * and calls the methods by name.
 *
 * <p>The buffer is a header of 8-byte words in native byte order, followed by the slots: one per signal, then one for
 * the edges of each latched signal that the simulation reads.
 */
final class Layout {
    /** The version of the buffer's layout that this class implements. */
    static final long VERSION = 2;
    static final int WORD_VERSION = 0;
    static final int WORD_SEQUENCE = 2;
    static final int WORD_AGE = 3;
    static final int WORD_SIMULATION_TIME = 4;
    static final int WORD_GRANTED = 5;
    static final int WORD_SLOT_COUNT = 7;
    static final int WORD_SATURATED = 8;
    static final int WORD_NOT_A_NUMBER = 9;
    /** The first slot. */
    static final int SLOTS = 11;

    /** One signal, as the native library describes it. */
    record Entry(
        String name, String address, String type, String unit, String station, boolean written, boolean integer,
        int slot, int edgesSlot) {
    }

    private final List<Entry> signals = new ArrayList<>();
    private LongBuffer words;
    private DoubleBuffer doubles;
    private int id;
    private String name = "";

    /** Called by the native library: memory for the shared buffer, all zero. */
    ByteBuffer allocate(int bytes) {
        ByteBuffer buffer = ByteBuffer.allocateDirect(bytes).order(ByteOrder.nativeOrder());
        words = buffer.asLongBuffer();
        doubles = buffer.asDoubleBuffer();
        return buffer;
    }

    /** Memory for a driver that is described but not opened. */
    void allocateAlone() {
        int slots = signals.size();
        for (Entry signal : signals) {
            slots += signal.edgesSlot() >= 0 ? 1 : 0;
        }
        allocate((SLOTS + slots) * Long.BYTES);
        words.put(WORD_SLOT_COUNT, slots);
    }

    /** Called by the native library. */
    void driver(int id, String name) {
        this.id = id;
        this.name = name;
    }

    /** Called by the native library, in slot order. */
    void signal(String name, String address, String type, String unit, String station, boolean written,
        boolean integer, int slot, int edgesSlot) {
        signals.add(new Entry(name, address, type, unit, station, written, integer, slot, edgesSlot));
    }

    LongBuffer words() {
        return words;
    }

    /** The slots as raw bits. */
    LongBuffer slots() {
        return words.slice(SLOTS, slotCount());
    }

    /** The slots as doubles. All are doubles except unscaled 64-bit integers. */
    DoubleBuffer doubles() {
        return doubles.slice(SLOTS, slotCount());
    }

    private int slotCount() {
        return (int) words.get(WORD_SLOT_COUNT);
    }

    int id() {
        return id;
    }

    String name() {
        return name;
    }

    List<Entry> signals() {
        return signals;
    }

    /** Throws if the native library and these classes differ in version. */
    void check() {
        long version = words.get(WORD_VERSION);
        if (version != VERSION) {
            throw new FieldbusException(Status.LIBRARY, "the native library has version " + version
                + " of the shared buffer, these classes have version " + VERSION
                + "; use the jar and the native library of one release");
        }
    }
}
