package tickbus;

import java.nio.LongBuffer;

/**
 * Converts doubles to the 64-bit integers that some slots hold, and counts those that did not fit, as the native
 * library does for all other types.
 */
final class Conversions {
    /** The shared buffer, whose header has the counts. */
    private final LongBuffer words;

    Conversions(LongBuffer words) {
        this.words = words;
    }

    /** The bits of the slot for a value: the nearest number that fits; the fail-safe value for NaN. */
    long slot(IntegerKind kind, double value, long failSafe) {
        if (Double.isNaN(value)) {
            count(Layout.WORD_NOT_A_NUMBER);
            return failSafe;
        }
        if (!kind.holds(value)) {
            count(Layout.WORD_SATURATED);
        }
        return kind.fromDouble(value);
    }

    private void count(int word) {
        words.put(word, words.get(word) + 1);
    }
}
