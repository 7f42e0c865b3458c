package tickbus.petri.net;

import java.math.BigDecimal;

/**
 * The waiting time of a timed transition, in nanoseconds. A new delay is drawn each time the transition becomes enabled.
 *
 * @param kind the meaning of {@code first} and {@code second}
 * @param first the fixed delay, the mean, or the least delay
 * @param second the greatest delay of {@link Kind#UNIFORM}; otherwise 0
 */
public record Delay(Kind kind, long first, long second) {
    /** No delay: the transition is immediate. */
    public static final Delay NONE = new Delay(Kind.NONE, 0, 0);

    /** The distribution of a delay. */
    public enum Kind {
        /** Immediate. */
        NONE,
        /** Always the same. */
        FIXED,
        /** Exponentially distributed about a mean. */
        EXPONENTIAL,
        /** Equally distributed between two bounds, both included. */
        UNIFORM
    }

    /** Checks the figures: an {@link IllegalArgumentException} names the figure that is out of range. */
    public Delay {
        if (first < 0 || second < 0) {
            throw new IllegalArgumentException("a delay of " + Math.min(first, second) + " ns; expected 0 or more");
        }
        if (kind == Kind.UNIFORM && second < first) {
            throw new IllegalArgumentException("a delay between " + first + " and " + second
                + " ns; expected the least first");
        }
        if (kind != Kind.UNIFORM && second != 0 || kind == Kind.NONE && first != 0) {
            throw new IllegalArgumentException(kind + " with the figures " + first + " and " + second
                + "; expected 0 for a figure that it does not have");
        }
    }

    /** Always {@code nanos}. */
    public static Delay fixed(long nanos) {
        return new Delay(Kind.FIXED, nanos, 0);
    }

    /** Exponentially distributed; {@code mean} in nanoseconds. */
    public static Delay exponential(long mean) {
        return new Delay(Kind.EXPONENTIAL, mean, 0);
    }

    /** Equally distributed from {@code least} to {@code greatest} nanoseconds, both included. */
    public static Delay uniform(long least, long greatest) {
        return new Delay(Kind.UNIFORM, least, greatest);
    }

    /** Nanoseconds as seconds, with the unit. */
    public static String seconds(long nanos) {
        return new BigDecimal(nanos).movePointLeft(9).stripTrailingZeros().toPlainString() + " s";
    }
}
