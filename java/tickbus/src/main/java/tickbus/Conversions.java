package tickbus;

/**
 * Converts doubles to the 64-bit integers that some slots hold, and counts those that did not fit, as the native
 * library does for all other types.
 */
final class Conversions {
    // Only written by the ticking thread; read by any thread that asks for statistics.
    private volatile long saturated;
    private volatile long notANumber;

    /** The bits of the slot for a value: the nearest number that fits; the fail-safe value for NaN. */
    long slot(IntegerKind kind, double value, long failSafe) {
        if (Double.isNaN(value)) {
            notANumber++;
            return failSafe;
        }
        if (!kind.holds(value)) {
            saturated++;
        }
        return kind.fromDouble(value);
    }

    long saturated() {
        return saturated;
    }

    long notANumber() {
        return notANumber;
    }
}
