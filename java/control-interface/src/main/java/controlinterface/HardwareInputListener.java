package controlinterface;

/** Whoever wants the values that a driver read from its hardware: the simulator. */
@FunctionalInterface
public interface HardwareInputListener {
    /**
     * Takes one tick's values.
     *
     * @param inputs one value per component that the simulation reads, in component order; 0 and 1 for
     *     Booleans. The array belongs to the driver and is used again at the next tick: copy what you keep.
     */
    void hardwareInputs(double[] inputs);
}
