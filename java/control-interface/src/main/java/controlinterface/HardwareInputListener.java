package controlinterface;

/** Receives the values that a driver has read from its hardware; implemented by the simulator. */
@FunctionalInterface
public interface HardwareInputListener {
    /**
     * Takes the values of one tick.
     *
     * @param inputs one value per component that the simulation reads, in component order; 0 and 1 for
     * Booleans. The array belongs to the driver and is reused at the next tick: copy what you keep.
     */
    void hardwareInputs(double[] inputs);
}
