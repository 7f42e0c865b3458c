package tickbus.junit;

import java.math.BigDecimal;
import tickbus.Signal;

/** The recent history of a signal, for failure messages. Allocates nothing on a tick. */
final class Watch {
    /** The number of changes that are remembered. */
    private static final int KEPT = 8;

    private final Signal signal;
    private final boolean bit;
    /** True if the type has values that a double cannot represent. */
    private final boolean wide;
    private final long[] ticks = new long[KEPT];
    private final double[] from = new double[KEPT];
    private final double[] to = new double[KEPT];
    private double value;
    private long exact;
    private long changes;
    private long rises;
    private long falls;

    Watch(Signal signal) {
        this.signal = signal;
        this.bit = signal.type().equals("BOOL");
        this.wide = switch (signal.type()) {
            case "LWORD", "LINT", "ULINT" -> true;
            default -> false;
        };
        this.value = signal.get();
        this.exact = wide ? signal.getLong() : 0;
    }

    Signal signal() {
        return signal;
    }

    boolean isBit() {
        return bit;
    }

    void look(long tick) {
        double now = signal.get();
        if (now != value || wide && signal.getLong() != exact) {
            change(tick, now);
        }
    }

    private void change(long tick, double now) {
        int place = (int) (changes % KEPT);
        ticks[place] = tick;
        from[place] = value;
        to[place] = now;
        changes++;
        if (value == 0) {
            rises++;
        } else if (now == 0) {
            falls++;
        }
        value = now;
        exact = wide ? signal.getLong() : 0;
    }

    /** How often the signal changed from 0 to another value. */
    long rises() {
        return rises;
    }

    /** How often the signal changed to 0. */
    long falls() {
        return falls;
    }

    /** The signal's current value, for people. */
    String text() {
        return text(signal.get());
    }

    String text(double of) {
        if (bit) {
            return of == 0 ? "off" : "on";
        }
        return number(of) + (signal.unit().isEmpty() ? "" : " " + signal.unit());
    }

    /** A number for people: no exponent if it is short, no fraction if it is an integer. */
    static String number(double of) {
        boolean plain = Double.isFinite(of) && Math.abs(of) < 1e15 && (of == 0 || Math.abs(of) >= 1e-6);
        return plain ? new BigDecimal(Double.toString(of)).stripTrailingZeros().toPlainString() : Double.toString(of);
    }

    /** The last changes, as one line. */
    String history(long stepNanos) {
        StringBuilder text = new StringBuilder("last changes of ").append(quoted()).append(" (")
            .append(signal.address()).append("): ");
        if (changes == 0) {
            return text.append("none, it is ").append(text()).append(" since the test began").toString();
        }
        long first = Math.max(0, changes - KEPT);
        text.append(first == 0 ? "" : "… ").append(text(from[(int) (first % KEPT)]));
        for (long change = first; change < changes; change++) {
            int place = (int) (change % KEPT);
            text.append(" → ").append(text(to[place])).append(" at tick ").append(ticks[place]).append(" (")
                .append(Durations.text(ticks[place] * stepNanos)).append(")");
        }
        return text.toString();
    }

    String quoted() {
        return "'" + signal.name() + "'";
    }
}
