package tickbus;

/**
 * A handle on one signal of an open driver.
 *
 * <p>Get it once by {@link Tickbus#signal(String)} and keep it; getters and setters neither allocate nor
 * look anything up. They work on this side's copy of the process image: what is set goes to the PLC with the
 * next {@link Tickbus#exchange()}, what is got came with the last one. They belong to the thread that ticks
 * the driver, and throw {@link FieldbusException} with {@link Status#CLOSED} once it is closed.
 */
public final class Signal {
    /** Beyond this, not every whole number is a double. */
    private static final long EXACT = 1L << 53;

    private final Tickbus bus;
    private final long[] slots;
    private final Layout.Entry entry;
    private final int slot;
    private final boolean written;
    /** Null where the slot holds a double. */
    private final IntegerKind integer;

    Signal(Tickbus bus, long[] slots, Layout.Entry entry) {
        this.bus = bus;
        this.slots = slots;
        this.entry = entry;
        this.slot = entry.slot();
        this.written = entry.written();
        if (!entry.integer()) {
            this.integer = null;
        } else {
            this.integer = entry.type().equals("LINT") ? IntegerKind.SIGNED : IntegerKind.UNSIGNED;
        }
    }

    /**
     * The signal's value.
     *
     * @return the value in the signal's unit, 0 or 1 for a BOOL; for an unscaled 64-bit integer the nearest
     *     double
     */
    public double get() {
        bus.mustBeOpen();
        return value(slots[slot]);
    }

    /**
     * Sets the signal, to be sent with the next exchange.
     *
     * <p>The native library scales, rounds half away from zero, and saturates at the ends of the type's range.
     *
     * @param value the value in the signal's unit; for a BOOL all but 0 is true
     * @throws IllegalStateException if the PLC writes this signal
     * @throws IllegalArgumentException if the value is not a finite number
     */
    public void set(double value) {
        bus.mustBeOpen();
        mustBeWritten();
        if (!Double.isFinite(value)) {
            throw new IllegalArgumentException(
                "signal '" + name() + "' cannot be set to " + value + "; a finite number is needed");
        }
        put(value);
    }

    /**
     * The signal's value as a Boolean.
     *
     * @return false if the value is 0
     */
    public boolean getBoolean() {
        bus.mustBeOpen();
        // Zero has all bits clear in a double, too, but for the sign of a negative zero.
        return slots[slot] << (integer == null ? 1 : 0) != 0;
    }

    /**
     * Sets the signal to 1 or 0.
     *
     * @param value true for 1
     * @throws IllegalStateException if the PLC writes this signal
     */
    public void setBoolean(boolean value) {
        bus.mustBeOpen();
        mustBeWritten();
        if (integer == null) {
            slots[slot] = value ? 0x3FF0_0000_0000_0000L : 0;
        } else {
            slots[slot] = value ? 1 : 0;
        }
    }

    /**
     * The signal's value as an integer.
     *
     * @return exact for every unscaled integer type; an LWORD or ULINT is to be read as unsigned. Of other
     *     values the nearest integer, halves away from zero.
     */
    public long getLong() {
        bus.mustBeOpen();
        long bits = slots[slot];
        return integer != null ? bits : IntegerKind.SIGNED.fromDouble(Double.longBitsToDouble(bits));
    }

    /**
     * Sets the signal to an integer, exactly.
     *
     * @param value the value in the signal's unit; an LWORD or ULINT reads it as unsigned
     * @throws IllegalStateException if the PLC writes this signal
     * @throws IllegalArgumentException if the value is beyond ±2<sup>53</sup> and the signal is not an
     *     unscaled 64-bit integer
     */
    public void setLong(long value) {
        bus.mustBeOpen();
        mustBeWritten();
        if (integer != null) {
            slots[slot] = value;
            return;
        }
        if (value < -EXACT || value > EXACT) {
            throw new IllegalArgumentException("signal '" + name() + "' of type " + type() + " cannot hold " + value
                + " exactly; only unscaled LWORD, LINT and ULINT signals go beyond 2^53");
        }
        slots[slot] = Double.doubleToRawLongBits(value);
    }

    /**
     * How many edges came with the last exchange, of the kind that {@code latch} in driver.cfg names.
     *
     * @return zero and above
     * @throws IllegalStateException if the signal is not latched, or the simulation writes it
     */
    public long edges() {
        bus.mustBeOpen();
        if (!isLatched()) {
            throw new IllegalStateException(written
                ? "signal '" + name() + "' is written by this end; edges are counted of signals that the other end writes"
                : "signal '" + name() + "' counts no edges; add `latch = \"rising\"` to it in driver.cfg");
        }
        return (long) Double.longBitsToDouble(slots[entry.edgesSlot()]);
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
     * @return empty if there is none
     */
    public String unit() {
        return entry.unit();
    }

    /**
     * The station that the signal belongs to.
     *
     * @return empty where driver.cfg names no stations
     */
    public String station() {
        return entry.station();
    }

    /**
     * Whether this end writes the signal: a {@code %I} when we are the machine.
     *
     * @return false if this end reads it
     */
    public boolean isWritten() {
        return written;
    }

    /**
     * Whether {@link #edges()} are counted.
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

    /** What a slot of this signal means. */
    double value(long bits) {
        return integer == null ? Double.longBitsToDouble(bits) : integer.toDouble(bits);
    }

    /** Sets without a check of direction or value. */
    void put(double value) {
        slots[slot] = integer == null ? Double.doubleToRawLongBits(value) : integer.fromDouble(value);
    }

    int slot() {
        return slot;
    }

    private void mustBeWritten() {
        if (!written) {
            throw new IllegalStateException("signal '" + name() + "' at " + address()
                + " is written by the other end; only signals that this end writes can be set");
        }
    }
}
