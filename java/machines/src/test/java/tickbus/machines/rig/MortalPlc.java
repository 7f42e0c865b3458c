package tickbus.machines.rig;

import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.Direction;
import controlinterface.HardwareComponent;
import java.util.List;
import java.util.Set;
import java.util.function.Supplier;

/**
 * A driver whose PLC can be switched off and on in simulation time: while it is off, the simulation gets the last
 * values until they are stale, and then fail-safe values, as from a bus whose peer has died.
 */
final class MortalPlc extends ControlInterfaceDeviceDriver {
    static final long MAX_AGE = 250_000_000L;
    private static final Set<String> FAIL_SAFE_ON = Set.of("SC1", "SC2");

    private final Supplier<ControlInterfaceDeviceDriver> maker;
    private final List<HardwareComponent> components;
    private final double[] failSafe;
    private final double[] last;
    private ControlInterfaceDeviceDriver driver;
    private long now;
    private long offSince;

    MortalPlc(Supplier<ControlInterfaceDeviceDriver> maker) {
        this.maker = maker;
        on();
        components = driver.components();
        failSafe = components.stream().filter(c -> c.direction() == Direction.READ_BY_SIMULATION)
                .mapToDouble(c -> FAIL_SAFE_ON.contains(c.name()) ? 1 : 0).toArray();
        last = failSafe.clone();
    }

    /** Switches on a PLC without any memory of an earlier one. */
    void on() {
        driver = maker.get();
        driver.connect(inputs -> {
            System.arraycopy(inputs, 0, last, 0, last.length);
            deliverHardwareInputs(inputs);
        });
    }

    void off() {
        driver.exit();
        driver = null;
        offSince = now;
    }

    @Override
    public void simulationTime(long nanos) {
        now = nanos;
    }

    @Override
    public void updateComponentValues(double[] value) {
        if (driver == null) {
            deliverHardwareInputs(now - offSince > MAX_AGE ? failSafe.clone() : last.clone());
            return;
        }
        driver.simulationTime(now);
        driver.updateComponentValues(value);
    }

    @Override
    public List<HardwareComponent> components() {
        return components;
    }

    @Override
    public int id() {
        return 4711;
    }

    @Override
    public String name() {
        return "PLC that can be switched off";
    }

    @Override
    public void exit() {
        if (driver != null) {
            driver.exit();
        }
    }
}
