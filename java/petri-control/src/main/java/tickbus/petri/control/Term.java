package tickbus.petri.control;

import java.math.BigDecimal;
import java.time.Duration;
import tickbus.petri.net.Delay;
import tickbus.petri.run.Condition;
import tickbus.petri.run.Conjunction;

/**
 * One part of a condition, as written by the user.
 *
 * @param kind of the comparison
 * @param name the signal; for a place, its net
 * @param place the place, for {@link Kind#MARKED}, {@link Kind#MARKED_FOR} and {@link Kind#UNMARKED}
 * @param value the limit or value that the signal is compared with; for {@link Kind#MARKED_FOR}, nanoseconds
 * @param code the user's own condition, for {@link Kind#CODE}
 */
record Term(Kind kind, String name, String place, double value, Condition code) {
    enum Kind {
        ON, OFF, RISING, FALLING, AT_LEAST, BELOW, EQUAL, MARKED, MARKED_FOR, UNMARKED, CODE;

        boolean isEdge() {
            return this == RISING || this == FALLING;
        }

        boolean isOfPlace() {
            return this == MARKED || this == MARKED_FOR || this == UNMARKED;
        }
    }

    static Term of(Kind kind, String signal, double value) {
        return new Term(kind, signal, null, value, null);
    }

    /** As views show it. */
    Conjunction.Part part() {
        String text = switch (kind) {
            case ON -> name + " on";
            case OFF -> name + " off";
            case RISING -> name + " rising";
            case FALLING -> name + " falling";
            case AT_LEAST -> name + " ≥ " + number();
            case BELOW -> name + " < " + number();
            case EQUAL -> name + " = " + number();
            case MARKED -> name + ": " + place + " marked";
            case MARKED_FOR -> name + ": " + place + " marked for " + Delay.seconds((long) value);
            case UNMARKED -> name + ": " + place + " not marked";
            case CODE -> "a condition in code";
        };
        boolean ofPlace = kind.isOfPlace();
        return new Conjunction.Part(text, ofPlace || kind == Kind.CODE ? null : name, ofPlace ? name : null, place);
    }

    private String number() {
        return Double.isFinite(value) ? BigDecimal.valueOf(value).stripTrailingZeros().toPlainString() : Double.toString(value);
    }

    Term since(Duration time) {
        return new Term(Kind.MARKED_FOR, name, place, time.toNanos(), null);
    }

    Term as(Kind other) {
        return new Term(other, name, place, value, code);
    }
}
