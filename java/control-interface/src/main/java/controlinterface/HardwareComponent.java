package controlinterface;

import java.util.Objects;

/**
 * One value that a driver exchanges: a signal of the hardware, as the simulator lists and connects it.
 *
 * @param name unique among the driver's components, never blank
 * @param direction who writes the value
 * @param type the value's type in the driver's own terms, such as {@code BOOL} or {@code INT}
 * @param unit physical unit; empty for a number without a unit
 */
public record HardwareComponent(String name, Direction direction, String type, String unit) {
    /**
     * Checks that no part is missing.
     *
     * @throws NullPointerException if any part is null
     * @throws IllegalArgumentException if the name is blank
     */
    public HardwareComponent {
        Objects.requireNonNull(name, "name");
        Objects.requireNonNull(direction, "direction");
        Objects.requireNonNull(type, "type");
        Objects.requireNonNull(unit, "unit");
        if (name.isBlank()) {
            throw new IllegalArgumentException("a hardware component needs a name; this one's is blank");
        }
    }

    /**
     * Returns whether the component is a signal of the hardware, and not a value about the exchange itself. By convention a
     * driver names the latter {@code bus.<value>}, and the number of a signal's edges {@code <signal>.edges}.
     *
     * @return false for such names
     */
    public boolean isSignal() {
        return !name.startsWith("bus.") && !name.endsWith(".edges");
    }
}
