package tickbus;

import java.nio.LongBuffer;
import java.util.ArrayList;
import java.util.Collections;
import java.util.List;

/**
 * A handle on one signal of an open driver.
 *
 * <p>Get it once by {@link Tickbus#signal(String)} and keep it; getters and setters neither allocate nor look
 * anything up. They work on the memory shared with the driver: a value set here is sent to the PLC with the next {@link
 * Tickbus#send()} or {@link Tickbus#exchange()}; a value read here came with the last {@link Tickbus#receive()} or {@code
 * exchange()}. They belong to the ticking thread, and throw {@link FieldbusException} with {@link Status#CLOSED} once the
 * driver is closed.
 */
public final class Signal {
    /** Beyond this, not every integer is a double. */
    private static final long EXACT = 1L << 53;
    /** The double 1.0. */
    private static final long ONE = 0x3FF0_0000_0000_0000L;

    private final Tickbus bus;
    private final LongBuffer slots;
    private final Layout.Entry entry;
    /** Null if the slot holds a double. */
    private final IntegerKind integer;
    /**
     * The signal's slot if it can be read, or written, as a double without further checks; else -1. One comparison thus
     * covers all checks of the common case.
     */
    private int getAt;
    private int setAt;
    /** The slot of the edges if they can be read; else -1. */
    private int edgesAt;

    Signal(Tickbus bus, LongBuffer slots, Layout.Entry entry) {
        this.bus = bus;
        this.slots = slots;
        this.entry = entry;
        if (entry.integer()) {
            this.integer = entry.type().equals("LINT") ? IntegerKind.SIGNED : IntegerKind.UNSIGNED;
        } else {
            this.integer = null;
        }
        this.getAt = entry.integer() ? -1 : entry.slot();
        this.setAt = entry.written() ? getAt : -1;
        this.edgesAt = entry.edgesSlot();
    }

    /** The signals of a driver. Without streams and lambdas, which take 17 ms in a JVM that has just started. */
    static List<Signal> all(Tickbus bus, Layout layout) {
        LongBuffer slots = layout.slots();
        List<Signal> all = new ArrayList<>();
        for (Layout.Entry entry : layout.signals()) {
            all.add(new Signal(bus, slots, entry));
        }
        return Collections.unmodifiableList(all);
    }

    /**
     * The signal's value.
     *
     * @return the value in the signal's unit, 0 or 1 for a BOOL; for an unscaled 64-bit integer the nearest
     *     double
     */
    public double get() {
        int at = getAt;
        return at >= 0 ? Double.longBitsToDouble(slots.get(at)) : getOther();
    }

    private double getOther() {
        bus.mustBeOpen();
        return integer.toDouble(slots.get(entry.slot()));
    }

    /**
     * Sets the signal, to be sent with the next exchange or {@link Tickbus#send()}.
     *
     * <p>The native library scales, rounds half away from zero, and saturates at the limits of the type's range.
     *
     * @param value the value in the signal's unit; for a BOOL everything except 0 is true
     * @throws IllegalStateException if the PLC writes this signal
     * @throws IllegalArgumentException if the value is not a finite number
     */
    public void set(double value) {
        int at = setAt;
        if (at >= 0 && Double.isFinite(value)) {
            slots.put(at, Double.doubleToRawLongBits(value));
        } else {
            setOther(value);
        }
    }

    private void setOther(double value) {
        mustBeSettable();
        if (!Double.isFinite(value)) {
            throw new IllegalArgumentException(
                "signal '" + name() + "' cannot be set to " + value + "; a finite number is needed");
        }
        // The value is finite here, so conversion never uses the fail-safe value.
        slots.put(entry.slot(), bus.conversions().slot(integer, value, 0));
    }

    /**
     * The signal's value as a Boolean.
     *
     * @return false if the value is 0
     */
    public boolean getBoolean() {
        int at = getAt;
        // The shift drops the sign bit, the only one set in a negative zero.
        return at >= 0 ? slots.get(at) << 1 != 0 : getOtherBoolean();
    }

    private boolean getOtherBoolean() {
        bus.mustBeOpen();
        return slots.get(entry.slot()) != 0;
    }

    /**
     * Sets the signal to 1 or 0.
     *
     * @param value true for 1
     * @throws IllegalStateException if the PLC writes this signal
     */
    public void setBoolean(boolean value) {
        int at = setAt;
        if (at >= 0) {
            slots.put(at, value ? ONE : 0);
        } else {
            setOther(value ? 1 : 0);
        }
    }

    /**
     * Sets the signal to 1 or 0; the same as {@link #setBoolean}.
     *
     * @param value true for 1
     * @throws IllegalStateException if the PLC writes this signal
     */
    public void set(boolean value) {
        setBoolean(value);
    }

    /**
     * The signal's value as an integer.
     *
     * @return exact for every unscaled integer type; read an LWORD or ULINT as unsigned. For other values the nearest
     * integer, halves away from zero.
     */
    public long getLong() {
        bus.mustBeOpen();
        long bits = slots.get(entry.slot());
        return integer != null ? bits : IntegerKind.SIGNED.fromDouble(Double.longBitsToDouble(bits));
    }

    /**
     * Sets the signal to an integer, exactly.
     *
     * @param value the value in the signal's unit; unsigned for an LWORD or ULINT
     * @throws IllegalStateException if the PLC writes this signal
     * @throws IllegalArgumentException if the value is beyond ±2<sup>53</sup> and the signal is not an
     *     unscaled 64-bit integer
     */
    public void setLong(long value) {
        mustBeSettable();
        if (integer != null) {
            slots.put(entry.slot(), value);
            return;
        }
        if (value < -EXACT || value > EXACT) {
            throw new IllegalArgumentException("signal '" + name() + "' of type " + type() + " cannot hold " + value
                + " exactly; only unscaled LWORD, LINT and ULINT signals go beyond 2^53");
        }
        slots.put(entry.slot(), Double.doubleToRawLongBits(value));
    }

    /**
     * How many edges, of the kind that {@code latch} in driver.cfg names, came with the last exchange or {@link
     * Tickbus#receive()}.
     *
     * @return 0 or more
     * @throws IllegalStateException if the signal is not latched, or the simulation writes it
     */
    public long edges() {
        int at = edgesAt;
        if (at < 0) {
            throw noEdges();
        }
        return (long) Double.longBitsToDouble(slots.get(at));
    }

    private IllegalStateException noEdges() {
        bus.mustBeOpen();
        return new IllegalStateException(isWritten()
            ? "signal '" + name() + "' is written by this end; edges are counted of signals that the other end writes"
            : "signal '" + name() + "' counts no edges; add `latch = \"rising\"` to it in driver.cfg");
    }

    /**
     * The signal's name.
     *
     * @return unique in its driver
     */
    public String name() {
        return entry.name();
    }

    /**
     * The address in the process image.
     *
     * @return in IEC form, such as {@code %QX1.0}
     */
    public String address() {
        return entry.address();
    }

    /**
     * The IEC data type.
     *
     * @return such as {@code BOOL} or {@code INT}
     */
    public String type() {
        return entry.type();
    }

    /**
     * The engineering unit.
     *
     * @return empty for a signal without one
     */
    public String unit() {
        return entry.unit();
    }

    /**
     * The station that the signal belongs to.
     *
     * @return empty if driver.cfg names no stations
     */
    public String station() {
        return entry.station();
    }

    /**
     * Returns whether this end writes the signal: a {@code %I} if this end is the machine.
     *
     * @return true if this end writes the signal, false if it reads it
     */
    public boolean isWritten() {
        return entry.written();
    }

    /**
     * Returns whether {@link #edges()} are counted.
     *
     * @return true for a signal with {@code latch} that this end reads
     */
    public boolean isLatched() {
        return entry.edgesSlot() >= 0;
    }

    /** Name, address and type. */
    @Override
    public String toString() {
        return name() + " (" + address() + " " + type() + ")";
    }

    /** The value that this signal's slot represents. */
    double value(long bits) {
        return integer == null ? Double.longBitsToDouble(bits) : integer.toDouble(bits);
    }

    /** Null if the slot holds a double. */
    IntegerKind integer() {
        return integer;
    }

    int slot() {
        return entry.slot();
    }

    /** Makes all getters and setters throw. */
    void close() {
        getAt = -1;
        setAt = -1;
        edgesAt = -1;
    }

    private void mustBeSettable() {
        bus.mustBeOpen();
        if (!isWritten()) {
            throw new IllegalStateException("signal '" + name() + "' at " + address()
                + " is written by the other end; only signals that this end writes can be set");
        }
    }
}
