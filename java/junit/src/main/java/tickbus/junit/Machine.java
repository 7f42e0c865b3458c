package tickbus.junit;

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
     * One tick: reads the PLC's commands ({@code %Q}), moves on, and sets the sensors ({@code %I}). Must not let time pass
     * itself.
     *
     * @param plc the PLC
     * @param simulationNanos the time at the end of this step, in nanoseconds since the test began;
     *     {@link Plc#stepNanos} more than before
     */
    void step(Plc plc, long simulationNanos);
}
