package tickbus.machines.rig;

import controlinterface.ControlInterfaceDeviceDriver;
import java.util.List;
import tickbus.machines.demo.Plc;

/**
 * A PLC that the demo cannot start or stop: hosted by the driver itself, which reports its counts in its statistics,
 * or independent.
 */
final class HostedPlc implements Plc {
    private final ControlInterfaceDeviceDriver driver;

    HostedPlc(ControlInterfaceDeviceDriver driver) {
        this.driver = driver;
    }

    @Override
    public boolean restartable() {
        return false;
    }

    @Override
    public void start() {
        // The driver switches the PLC.
    }

    @Override
    public void kill() {
        throw new UnsupportedOperationException("this PLC lives in the simulator's process");
    }

    @Override
    public Counts counts() {
        return Counts.of(driver.statistics(), System.nanoTime());
    }

    @Override
    public List<String> news() {
        return List.of();
    }

    @Override
    public long longestSilenceNanos() {
        return 0;
    }

    @Override
    public String name() {
        return "in the driver";
    }

    @Override
    public void check() {
        // The link shows if the PLC ends.
    }

    @Override
    public void close() {
        // The driver closes the PLC.
    }
}
