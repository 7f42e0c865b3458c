package tickbus.petri.sfc;

/**
 * A variable of a chart.
 *
 * @param name as written
 * @param type in capitals, such as {@code BOOL}, {@code INT} or {@code TIME}
 * @param location such as {@code %IX0.0}; empty without one
 * @param isInput true if it is written by the surroundings alone: a {@code VAR_INPUT}, or one at {@code %I}
 * @param initial 0 or 1 for a BOOL, nanoseconds for a TIME
 */
public record Variable(String name, String type, String location, boolean isInput, long initial) {
    Kind kind() {
        return type.equals("BOOL") ? Kind.BOOL : type.equals("TIME") ? Kind.TIME : Kind.NUMBER;
    }

    /** The value as the type keeps it: a number that is too large wraps around, as in a PLC. */
    long wrapped(long value) {
        return switch (type) {
            case "SINT" -> (byte) value;
            case "INT" -> (short) value;
            case "DINT" -> (int) value;
            case "USINT" -> value & 0xFF;
            case "UINT" -> value & 0xFFFF;
            case "UDINT" -> value & 0xFFFF_FFFFL;
            default -> value;
        };
    }
}
