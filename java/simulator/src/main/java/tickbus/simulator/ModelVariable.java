package tickbus.simulator;

import java.util.Objects;
import java.util.function.DoubleSupplier;

/**
 * A variable of a machine model that no control needs, but an observer wants to see: a position, a speed, a count.
 *
 * @param name unique among the machine's variables, never blank
 * @param unit physical unit; empty for a number without a unit
 * @param value gives the value as of the last step, 0 or 1 for a Boolean; allocates nothing
 */
public record ModelVariable(String name, String unit, DoubleSupplier value) {
    /**
     * Checks that no part is missing.
     *
     * @throws NullPointerException if any part is null
     * @throws IllegalArgumentException if the name is blank
     */
    public ModelVariable {
        Objects.requireNonNull(unit, "unit");
        Objects.requireNonNull(value, "value");
        if (name.isBlank()) {
            throw new IllegalArgumentException("a variable of the model needs a name; this one's is blank");
        }
    }
}
