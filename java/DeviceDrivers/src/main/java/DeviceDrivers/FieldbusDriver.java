package DeviceDrivers;

import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.Direction;
import controlinterface.HardwareComponent;
import controlinterface.MachineFaultListener;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import tickbus.FaultHandler;
import tickbus.FieldbusException;
import tickbus.Signal;
import tickbus.Tickbus;

/**
 * Connects a simulator to a PLC's fieldbus, as one {@code .cfg} file describes.
 *
 * <p>The components are the signals in the order of the file; then {@code <name>.edges}, the number of edges in this tick,
 * for each latched signal that the PLC writes; then {@code bus.age} in seconds, infinite until data arrive, {@code
 * bus.sequence} and {@code bus.status}: 0 fresh, 1 unchanged, 2 stale.
 *
 * <p>All calls must come from one thread, as the control interface requires.
 */
public final class FieldbusDriver extends ControlInterfaceDeviceDriver {
    private static final double SECONDS_PER_NANO = 1e-9;

    private final Tickbus bus;
    private final List<HardwareComponent> components;
    private final Signal[] latched;
    private final double[] inputs;
    /** Gets the faults of the machine; null for a machine without faults. */
    private FaultHandler faults;
    private boolean timed;
    private long simulationNanos;
    /** True if this tick's inputs were delivered before the simulation's step. */
    private boolean received;

    /**
     * Opens the driver that a file describes.
     *
     * @param cfg the driver.cfg
     * @throws FieldbusException as {@link Tickbus#open}
     */
    public FieldbusDriver(Path cfg) {
        this(Tickbus.open(cfg));
    }

    /**
     * Describes the driver of a file without opening it: for a simulator that only lists the components.
     *
     * @param cfg the driver.cfg
     * @return a driver that has components, id and name, and cannot tick
     * @throws FieldbusException as {@link Tickbus#look}
     */
    public static FieldbusDriver look(Path cfg) {
        return new FieldbusDriver(Tickbus.look(cfg));
    }

    private FieldbusDriver(Tickbus bus) {
        this.bus = bus;
        // Without streams and lambdas, as in Signal.
        List<Signal> counting = new ArrayList<>();
        List<HardwareComponent> all = new ArrayList<>();
        int written = 0;
        for (Signal signal : bus.signals()) {
            Direction direction = signal.isWritten() ? Direction.WRITTEN_BY_SIMULATION : Direction.READ_BY_SIMULATION;
            all.add(new HardwareComponent(signal.name(), direction, signal.type(), signal.unit()));
            written += signal.isWritten() ? 1 : 0;
            if (signal.isLatched()) {
                counting.add(signal);
            }
        }
        for (Signal signal : counting) {
            all.add(read(signal.name() + ".edges", "UDINT", ""));
        }
        all.add(read("bus.age", "LREAL", "s"));
        all.add(read("bus.sequence", "ULINT", ""));
        all.add(read("bus.status", "INT", ""));
        components = List.copyOf(all);
        latched = counting.toArray(new Signal[0]);
        inputs = new double[all.size() - written];
    }

    private static HardwareComponent read(String name, String type, String unit) {
        return new HardwareComponent(name, Direction.READ_BY_SIMULATION, type, unit);
    }

    /**
     * One tick, at the time last given by {@link #simulationTime}.
     *
     * @throws IllegalArgumentException if there are more or fewer values than components to write
     * @throws FieldbusException if the fieldbus failed for good, or the driver was closed by {@link #exit}
     */
    @Override
    public void updateComponentValues(double[] value) {
        bus.setAll(value);
        if (received) {
            received = false;
            bus.send();
        } else {
            deliver(timed ? bus.exchange(simulationNanos) : bus.exchange());
        }
    }

    /**
     * Receives from the fieldbus; {@link #updateComponentValues} then only sends.
     *
     * @throws FieldbusException if the fieldbus failed for good, or the driver was closed by {@link #exit}
     */
    @Override
    public void updateHardwareInputs() {
        int status = timed ? bus.receive(simulationNanos) : bus.receive();
        received = true;
        deliver(status);
    }

    /**
     * {@inheritDoc}
     *
     * @throws FieldbusException if driver.cfg has a fault of the kind {@code model} with another name
     */
    @Override
    public void connectFaults(List<String> names, MachineFaultListener listener) {
        bus.declareFaults(names);
        faults = listener::machineFault;
    }

    private void deliver(int status) {
        if (faults != null) {
            bus.pollFaults(faults);
        }
        int at = bus.getAll(inputs);
        for (Signal signal : latched) {
            inputs[at++] = signal.edges();
        }
        long age = bus.ageNanos();
        inputs[at++] = age == Long.MAX_VALUE ? Double.POSITIVE_INFINITY : age * SECONDS_PER_NANO;
        inputs[at++] = bus.sequence();
        inputs[at] = status;
        deliverHardwareInputs(inputs);
    }

    @Override
    public void simulationTime(long nanos) {
        timed = true;
        simulationNanos = nanos;
    }

    @Override
    public List<HardwareComponent> components() {
        return components;
    }

    @Override
    public int id() {
        return bus.id();
    }

    @Override
    public String name() {
        return bus.name();
    }

    @Override
    public Map<String, String> statistics() {
        return bus.statistics();
    }

    @Override
    public void exit() {
        bus.close();
    }
}
