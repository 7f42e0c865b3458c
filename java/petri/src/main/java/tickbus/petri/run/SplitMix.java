package tickbus.petri.run;

import tickbus.petri.net.Delay;

/** SplitMix64: a seed gives the same draws on every machine and JDK, and a draw allocates nothing. */
final class SplitMix {
    private long state;

    SplitMix(long seed) {
        state = seed;
    }

    private long next() {
        state += 0x9E3779B97F4A7C15L;
        long z = state;
        z = (z ^ z >>> 30) * 0xBF58476D1CE4E5B9L;
        z = (z ^ z >>> 27) * 0x94D049BB133111EBL;
        return z ^ z >>> 31;
    }

    /** From 0 to {@code bound} - 1. */
    int below(int bound) {
        return (int) ((next() >>> 32) * bound >>> 32);
    }

    /** From 0, less than 1. */
    double fraction() {
        return (next() >>> 11) * 0x1p-53;
    }

    /** Greater than 0, at most 1. */
    double unit() {
        return ((next() >>> 11) + 1) * 0x1p-53;
    }

    /** The duration of a delay, in nanoseconds. */
    long draw(Delay delay) {
        return switch (delay.kind()) {
            case NONE -> 0;
            case FIXED -> delay.first();
            // A draw is never 0, so the logarithm is finite; the cast saturates.
            case EXPONENTIAL -> (long) (-delay.first() * Math.log(unit()));
            case UNIFORM ->
                Math.min(delay.second(), delay.first() + (long) (fraction() * (delay.second() - delay.first() + 1.0)));
        };
    }
}
