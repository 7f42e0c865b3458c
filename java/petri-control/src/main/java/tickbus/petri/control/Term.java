package tickbus.petri.control;

import tickbus.petri.Condition;

/**
 * One part of a condition, as it was written.
 *
 * @param kind what it asks for
 * @param name the signal; for a place, the net that it belongs to
 * @param place the place, for {@link Kind#MARKED} and {@link Kind#UNMARKED}
 * @param value what the signal is compared with
 * @param code the user's own condition, for {@link Kind#CODE}
 */
record Term(Kind kind, String name, String place, double value, Condition code) {
    enum Kind {
        ON, OFF, RISING, FALLING, AT_LEAST, BELOW, EQUAL, MARKED, UNMARKED, CODE;

        boolean isOfPlace() {
            return this == MARKED || this == UNMARKED;
        }
    }

    static Term of(Kind kind, String signal, double value) {
        return new Term(kind, signal, null, value, null);
    }

    Term as(Kind other) {
        return new Term(other, name, place, value, code);
    }
}
