package tickbus;

/** How a slot holds a 64-bit integer, which a double cannot hold exactly. */
enum IntegerKind {
    /** LINT. */
    SIGNED,
    /** LWORD and ULINT. */
    UNSIGNED;

    /** From here on every double is an integer. */
    private static final double ALL_WHOLE = 0x1p52;

    /** The number in the slot, rounded to the nearest double. */
    double toDouble(long slot) {
        if (this == SIGNED || slot >= 0) {
            return slot;
        }
        // Halved to fit; the lost bit is kept, so that rounding gives the right result.
        return (slot >>> 1 | slot & 1) * 2.0;
    }

    /** True if the value, rounded with halves away from zero, fits. */
    boolean holds(double value) {
        return this == SIGNED ? value >= -0x1p63 && value < 0x1p63 : value > -0.5 && value < 0x1p64;
    }

    /** The nearest number that fits, halves away from zero; NaN gives 0. */
    long fromDouble(double value) {
        double whole = value;
        if (Math.abs(value) < ALL_WHOLE) {
            long truncated = (long) value;
            whole = Math.abs(value - truncated) < 0.5 ? truncated : truncated + Math.signum(value);
        }
        if (this == SIGNED) {
            return (long) whole;
        }
        if (whole >= 0x1p63) {
            return whole >= 0x1p64 ? -1 : (long) (whole - 0x1p63) + Long.MIN_VALUE;
        }
        return Math.max(0, (long) whole);
    }
}
