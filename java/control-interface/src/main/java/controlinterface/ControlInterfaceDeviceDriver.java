package controlinterface;

import java.util.List;
import java.util.Map;
import java.util.Objects;

/**
 * Base class of every device driver that a simulator loads from its {@code DeviceDriver} folder.
 *
 * <p>The simulator creates one instance for each {@code .cfg} file in the folder by the public constructor
 * that takes the file's {@link java.nio.file.Path}, registers itself with {@link #connect}, and then calls
 * {@link #simulationTime}, {@link #updateHardwareInputs} and {@link #updateComponentValues} once per tick. All calls come
 * from one thread.
 *
 * <p>Our reading of the interface that the 2003 thesis describes; the original class is not public.
 */
public abstract class ControlInterfaceDeviceDriver {
    private HardwareInputListener listener = inputs -> { };

    /** For subclasses. */
    protected ControlInterfaceDeviceDriver() {
    }

    /**
     * Asks, before the machine's step, for what the hardware says now. A driver that can tell it answers with
     * {@link #deliverHardwareInputs} before it returns, and then only sends in the {@link #updateComponentValues} of
     * this tick: so the machine answers the hardware within one tick. A driver that leaves this as it is delivers in
     * {@code updateComponentValues}, as in 2003; a simulator need not call it.
     *
     * @throws RuntimeException if the hardware failed for good; the simulator then ends the run
     */
    public void updateHardwareInputs() {
    }

    /**
     * One tick: takes the simulation's values, exchanges them with the hardware, and answers with
     * {@link #deliverHardwareInputs} before it returns, unless it did so in the {@link #updateHardwareInputs} of this
     * tick.
     *
     * @param value one value per component that the simulation writes, in component order; 0 and 1 for
     *     Booleans. The array belongs to the simulator and is used again at the next tick.
     * @throws RuntimeException if the hardware failed for good; the simulator then ends the run
     */
    public abstract void updateComponentValues(double[] value);

    /**
     * The driver's answer: hands one tick's values to the simulator. Does nothing before {@link #connect}.
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
     * Tells the driver what time it is in the simulation; called before each
     * {@link #updateHardwareInputs} with the time at the beginning of the tick, and before each
     * {@link #updateComponentValues} with that at its end. Drivers that keep no simulation time leave it as it is.
     *
     * @param nanos nanoseconds since the simulation began, never falling
     */
    public void simulationTime(long nanos) {
    }

    /**
     * The components, fixed for the driver's life. The order within each direction is the order of the
     * values in {@link #updateComponentValues} and {@link #deliverHardwareInputs}.
     *
     * @return an unmodifiable list
     */
    public abstract List<HardwareComponent> components();

    /**
     * The number that the driver's {@code .cfg} file gives it.
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
     * What the driver counted so far. May be slow; not for every tick.
     *
     * @return names and values as text, in an order fit for printing; empty if the driver counts nothing
     */
    public Map<String, String> statistics() {
        return Map.of();
    }

    /** Closes the hardware. The simulator calls it once at its end; further calls do nothing. */
    public abstract void exit();
}
