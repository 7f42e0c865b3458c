package controlinterface;

import java.util.List;
import java.util.Map;
import java.util.Objects;

/**
 * Base class of every device driver that a simulator loads from its {@code DeviceDriver} folder.
 *
 * <p>For each {@code .cfg} file in the folder, the simulator creates one instance by the public constructor that takes the
 * file's {@link java.nio.file.Path}. It registers itself with {@link #connect}, and then calls {@link #simulationTime},
 * {@link #updateHardwareInputs} and {@link #updateComponentValues} once per tick. All calls come from one thread.
 *
 * <p>Our reading of the interface that the 2003 thesis describes; the original class is not public.
 */
public abstract class ControlInterfaceDeviceDriver {
    private HardwareInputListener listener = inputs -> { };

    /** For subclasses. */
    protected ControlInterfaceDeviceDriver() {
    }

    /**
     * Asks, before the machine's step, for the current values of the hardware. A driver that has them calls {@link
     * #deliverHardwareInputs} before it returns. In this tick's {@link #updateComponentValues} it then only sends, so that
     * the machine answers the hardware within one tick. A driver that does not override this method delivers in {@code
     * updateComponentValues}, as in 2003; a simulator need not call it.
     *
     * @throws RuntimeException if the hardware failed for good; the simulator then ends the run
     */
    public void updateHardwareInputs() {
    }

    /**
     * One tick: takes the simulation's values, exchanges them with the hardware, and calls {@link
     * #deliverHardwareInputs} before it returns, unless it did so in the {@link #updateHardwareInputs} of this tick.
     *
     * @param value one value per component that the simulation writes, in component order; 0 and 1 for
     * Booleans. The array belongs to the simulator and is reused at the next tick.
     * @throws RuntimeException if the hardware failed for good; the simulator then ends the run
     */
    public abstract void updateComponentValues(double[] value);

    /**
     * The driver's answer: passes the values of one tick to the simulator. Does nothing before {@link #connect}.
     *
     * @param inputs one value per component that the simulation reads, in component order
     */
    protected final void deliverHardwareInputs(double[] inputs) {
        listener.hardwareInputs(inputs);
    }

    /**
     * Registers the simulator; a later call replaces the listener.
     *
     * @param listener gets the values of every tick
     */
    public final void connect(HardwareInputListener listener) {
        this.listener = Objects.requireNonNull(listener, "listener");
    }

    /**
     * Passes the simulation time to the driver: before each {@link #updateHardwareInputs} the time at the beginning of the
     * tick, before each {@link #updateComponentValues} the time at its end. A driver that does not use simulation time need
     * not override this method.
     *
     * @param nanos nanoseconds since the simulation began, never decreasing
     */
    public void simulationTime(long nanos) {
    }

    /**
     * Passes the faults that the machine model can have, before the first tick. A driver that injects faults calls the listener
     * when one of these begins or ends: in {@link #updateHardwareInputs}, before it delivers, or else in {@link
     * #updateComponentValues}. A driver without faults need not override this method.
     *
     * @param names the faults' names
     * @param listener gets the faults
     * @throws RuntimeException if the driver is to inject a fault that has none of these names
     */
    public void connectFaults(List<String> names, MachineFaultListener listener) {
    }

    /**
     * The components, fixed for the driver's life. The order within each direction is the order of the
     * values in {@link #updateComponentValues} and {@link #deliverHardwareInputs}.
     *
     * @return an unmodifiable list
     */
    public abstract List<HardwareComponent> components();

    /**
     * The number in the driver's {@code .cfg} file.
     *
     * @return the id, unique among the drivers in the folder
     */
    public abstract int id();

    /**
     * A name for people.
     *
     * @return the name, never null
     */
    public abstract String name();

    /**
     * The driver's counters. Can be slow; do not call it on every tick.
     *
     * @return names and values as text, in an order fit for printing; empty if the driver counts nothing
     */
    public Map<String, String> statistics() {
        return Map.of();
    }

    /** Closes the hardware. The simulator calls it once when it ends; further calls do nothing. */
    public abstract void exit();
}
