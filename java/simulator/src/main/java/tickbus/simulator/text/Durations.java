package tickbus.simulator.text;

import java.math.BigDecimal;
import java.util.Locale;
import java.util.regex.Matcher;
import java.util.regex.Pattern;

/** Durations as people write them, {@code "2ms"}, and in the simulator's unit, whole nanoseconds. */
public final class Durations {
    private static final Pattern FORM = Pattern.compile("(\\d+(?:\\.\\d+)?)\\s*(ns|us|ms|s|min)");

    private Durations() {
    }

    /**
     * Reads a duration.
     *
     * @param text a number and one of the units ns, us, ms, s, min: {@code 2ms}, {@code 0.5s}
     * @return nanoseconds, 0 or more
     * @throws IllegalArgumentException if the text is not a duration, is finer than a nanosecond, or is longer
     *     than about 292 years
     */
    public static long parse(String text) {
        Matcher matcher = FORM.matcher(text.strip());
        if (!matcher.matches()) {
            throw new IllegalArgumentException(
                    "\"" + text + "\" is no duration; write a number and a unit, such as 2ms, 0.5s or 1min");
        }
        try {
            return new BigDecimal(matcher.group(1)).multiply(BigDecimal.valueOf(unit(matcher.group(2))))
                    .longValueExact();
        } catch (ArithmeticException e) {
            throw new IllegalArgumentException(
                    "the duration \"" + text + "\" does not fit into whole nanoseconds of 64 bits", e);
        }
    }

    private static long unit(String name) {
        return switch (name) {
            case "ns" -> 1L;
            case "us" -> 1_000L;
            case "ms" -> 1_000_000L;
            case "s" -> 1_000_000_000L;
            default -> 60_000_000_000L;
        };
    }

    /**
     * Formats a duration with a suitable unit.
     *
     * @param nanos nanoseconds
     * @return such as {@code 2ms} or {@code 1.5s}; reads back as the same value
     */
    public static String text(long nanos) {
        for (String unit : new String[] {"s", "ms", "us"}) {
            if (nanos != 0 && Math.abs(nanos) >= unit(unit)) {
                return BigDecimal.valueOf(nanos).divide(BigDecimal.valueOf(unit(unit)))
                        .stripTrailingZeros().toPlainString() + unit;
            }
        }
        return nanos + "ns";
    }

    /**
     * Formats a point in simulation time for a column of such points.
     *
     * @param nanos nanoseconds since the simulation began
     * @return seconds with three decimals, right aligned to nine characters: {@code "   12.345"}
     */
    public static String seconds(long nanos) {
        return String.format(Locale.ROOT, "%9.3f", nanos / 1e9);
    }
}
