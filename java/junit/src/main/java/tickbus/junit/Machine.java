package tickbus.junit;

import java.util.List;

/**
 * A model of the machine that the PLC controls, as detailed as the tests need.
 *
 * <pre>{@code
 * final class Lift implements Machine {
 *     private double height;
 *
 *     @Override
 *     public void step(Plc plc, long simulationNanos) {
 *         if (plc.isOn("LA1 run")) {
 *             height = Math.min(height + 0.5, 250);
 *         }
 *         plc.set("LA1 position", height);
 *     }
 * }
 * }</pre>
 */
@FunctionalInterface
public interface Machine {
    /**
     * Called once, before the first tick: looks up signals ({@link Plc#signal}) and sets initial values.
     *
     * @param plc the PLC that this machine is connected to
     */
    default void connect(Plc plc) {
    }

    /**
     * The faults that this machine can have, which a fault of the kind {@code model} names. Asked once, after {@link #connect}.
     *
     * @return their names; empty for a machine without faults
     */
    default List<String> faults() {
        return List.of();
    }

    /**
     * A fault of this machine begins, changes its value, or ends; takes effect in the next {@link #step}.
     *
     * @param name one of the names in {@link #faults}
     * @param value the fault's value; 0 when it has ended
     */
    default void fault(String name, double value) {
    }

    /**
     * One tick: reads the PLC's commands ({@code %Q}), moves on, and sets the sensors ({@code %I}). Must not let time pass
     * itself.
     *
     * @param plc the PLC
     * @param simulationNanos the time at the end of this step, in nanoseconds since the test began;
     *     {@link Plc#stepNanos} more than before
     */
    void step(Plc plc, long simulationNanos);
}
