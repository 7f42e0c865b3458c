package tickbus.petri.command;

import java.math.BigDecimal;
import java.util.Map;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import tickbus.petri.net.Delay;

/** Times as people write them: a number with a unit. */
final class Times {
    private static final Pattern TIME = Pattern.compile("(\\d{1,18}(?:\\.\\d{1,9})?)\\s*(ns|us|ms|s|min)");
    private static final Map<String, Long> UNITS =
        Map.of("ns", 1L, "us", 1_000L, "ms", 1_000_000L, "s", 1_000_000_000L, "min", 60_000_000_000L);

    private Times() {
    }

    /** Nanoseconds; an {@link IllegalArgumentException} says what was expected. */
    static long nanos(String text) {
        Matcher parts = TIME.matcher(text.strip());
        if (parts.matches()) {
            try {
                return new BigDecimal(parts.group(1)).multiply(BigDecimal.valueOf(UNITS.get(parts.group(2)))).longValueExact();
            } catch (ArithmeticException notWhole) {
                // Too long, or parts of a nanosecond.
            }
        }
        throw new IllegalArgumentException("'" + text.strip() + "' is no time; expected a number with a unit, such as 500us, 2ms "
            + "or 1.5s, in whole nanoseconds");
    }

    /** A delay: {@code 2s}, {@code exp 2s}, {@code 1s..3s}. */
    static Delay delay(String text) {
        String bare = text.strip();
        if (bare.startsWith("exp ")) {
            return Delay.exponential(nanos(bare.substring(4)));
        }
        int dots = bare.indexOf("..");
        return dots < 0 ? Delay.fixed(nanos(bare)) : Delay.uniform(nanos(bare.substring(0, dots)), nanos(bare.substring(dots + 2)));
    }
}
