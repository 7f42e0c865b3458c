package tickbus.simulator;

import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.HardwareComponent;
import controlinterface.Direction;
import java.io.Closeable;
import java.io.IOException;
import java.util.List;
import tickbus.simulator.text.Columns;

/** The drivers of one simulation, open until closed. */
public final class DriverSet implements AutoCloseable {
    private final List<ControlInterfaceDeviceDriver> drivers;
    private final Closeable loader;
    private boolean closed;

    /**
     * Takes drivers that are already open.
     *
     * @param drivers with different ids
     */
    public DriverSet(List<? extends ControlInterfaceDeviceDriver> drivers) {
        this(drivers, () -> { });
    }

    DriverSet(List<? extends ControlInterfaceDeviceDriver> drivers, Closeable loader) {
        this.drivers = List.copyOf(drivers);
        this.loader = loader;
    }

    /**
     * The drivers.
     *
     * @return in the order of their files' names
     */
    public List<ControlInterfaceDeviceDriver> drivers() {
        return drivers;
    }

    /**
     * Lists the hardware components for people.
     *
     * @return a headline per driver, and a table of its components
     */
    public String list() {
        StringBuilder text = new StringBuilder();
        for (ControlInterfaceDeviceDriver driver : drivers) {
            text.append(text.isEmpty() ? "" : "\n").append("driver ").append(driver.id()).append("  ")
                    .append(driver.name()).append("\n");
            Columns table = new Columns("component", "type", "unit", "direction");
            for (HardwareComponent component : driver.components()) {
                table.row(driver.id() + ":" + component.name(), component.type(), component.unit(),
                        component.direction() == Direction.READ_BY_SIMULATION
                                ? "source, read by the simulation"
                                : "destination, written by the simulation");
            }
            text.append(table.text("  "));
        }
        return text.toString();
    }

    /**
     * Calls every driver's {@code exit()}, even if an earlier one failed. Further calls do nothing.
     *
     * @throws DriverFailure the first failure, with the others attached
     */
    @Override
    public void close() {
        if (closed) {
            return;
        }
        closed = true;
        DriverFailure failure = null;
        for (ControlInterfaceDeviceDriver driver : drivers) {
            try {
                driver.exit();
            } catch (RuntimeException | LinkageError e) {
                DriverFailure now = new DriverFailure("driver " + driver.id() + " failed to close", e);
                if (failure == null) {
                    failure = now;
                } else {
                    failure.addSuppressed(now);
                }
            }
        }
        try {
            loader.close();
        } catch (IOException e) {
            // The JVM closes the class loader's open jar files; nothing depends on that.
            if (failure != null) {
                failure.addSuppressed(e);
            }
        }
        if (failure != null) {
            throw failure;
        }
    }
}
