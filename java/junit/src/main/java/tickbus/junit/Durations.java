package tickbus.junit;

import java.math.BigDecimal;
import java.util.regex.Matcher;
import java.util.regex.Pattern;

/** Durations as driver.cfg writes them, {@code "2ms"}, and in whole nanoseconds. */
final class Durations {
    private static final Pattern FORM = Pattern.compile("(\\d+(?:\\.\\d+)?)\\s*(ns|us|ms|s|min|h)");
    private static final String[] UNITS = {"s", "ms", "us"};

    private Durations() {
    }

    /** Nanoseconds, 0 or more; throws {@link IllegalArgumentException} if the text is not a duration. */
    static long parse(String text) {
        Matcher matcher = FORM.matcher(text.strip());
        if (!matcher.matches()) {
            throw new IllegalArgumentException("\"" + text + "\" is no duration; write a number and a unit, such as"
                + " \"10ms\" (units: ns, us, ms, s, min, h)");
        }
        try {
            return new BigDecimal(matcher.group(1)).multiply(BigDecimal.valueOf(unit(matcher.group(2))))
                .toBigInteger().longValueExact();
        } catch (ArithmeticException e) {
            throw new IllegalArgumentException("\"" + text + "\" is longer than 292 years; write a shorter duration", e);
        }
    }

    private static long unit(String name) {
        return switch (name) {
            case "ns" -> 1L;
            case "us" -> 1_000L;
            case "ms" -> 1_000_000L;
            case "s" -> 1_000_000_000L;
            case "min" -> 60_000_000_000L;
            default -> 3_600_000_000_000L;
        };
    }

    /** With a suitable unit: {@code 2ms}, {@code 1.5s}. */
    static String text(long nanos) {
        for (String unit : UNITS) {
            if (nanos >= unit(unit)) {
                return BigDecimal.valueOf(nanos).divide(BigDecimal.valueOf(unit(unit))).stripTrailingZeros()
                    .toPlainString() + unit;
            }
        }
        return nanos == 0 ? "0s" : nanos + "ns";
    }
}
