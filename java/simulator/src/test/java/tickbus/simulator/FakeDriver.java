package tickbus.simulator;

import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.Direction;
import controlinterface.HardwareComponent;
import controlinterface.MachineFaultListener;
import java.util.ArrayList;
import java.util.List;

/** A driver with chosen components that records received values and delivers prepared ones. */
public final class FakeDriver extends ControlInterfaceDeviceDriver {
    private final int id;
    private final List<HardwareComponent> components = new ArrayList<>();
    /** Next answer, one value per component read. */
    public double[] answer;
    /** The values received last. */
    public final double[] got;
    /** The last simulation time. */
    public long time = -1;
    /** Calls of {@link #exit}. */
    public int exits;
    /** True if the driver delivers before the machine's step, false if after sending. */
    public boolean deliversFirst;
    /** Thrown by the next tick, if any. */
    public RuntimeException failTick;
    /** The names of the machine's faults, and the listener for them. */
    public List<String> faults = List.of();
    public MachineFaultListener faultListener;
    /** Thrown when the machine passes its faults, if any. */
    public RuntimeException failFaults;
    /** Thrown by {@link #exit}, if any. */
    public RuntimeException failExit;

    /** Writes and reads are names of components, all LREAL. */
    public FakeDriver(int id, List<String> written, List<String> read) {
        this.id = id;
        written.forEach(name -> components.add(
                new HardwareComponent(name, Direction.WRITTEN_BY_SIMULATION, "LREAL", "")));
        read.forEach(name -> components.add(new HardwareComponent(name, Direction.READ_BY_SIMULATION, "LREAL", "mm")));
        got = new double[written.size()];
        answer = new double[read.size()];
    }

    /** Writes one BOOL, and reads another one. */
    public FakeDriver(int id, String lamp, String button) {
        this.id = id;
        components.add(new HardwareComponent(lamp, Direction.WRITTEN_BY_SIMULATION, "BOOL", ""));
        components.add(new HardwareComponent(button, Direction.READ_BY_SIMULATION, "BOOL", ""));
        got = new double[1];
        answer = new double[1];
    }

    @Override
    public void simulationTime(long nanos) {
        time = nanos;
    }

    @Override
    public void connectFaults(List<String> names, MachineFaultListener listener) {
        if (failFaults != null) {
            throw failFaults;
        }
        faults = names;
        faultListener = listener;
    }

    @Override
    public void updateHardwareInputs() {
        if (deliversFirst) {
            deliverHardwareInputs(answer);
        }
    }

    @Override
    public void updateComponentValues(double[] value) {
        if (failTick != null) {
            throw failTick;
        }
        System.arraycopy(value, 0, got, 0, value.length);
        if (!deliversFirst) {
            deliverHardwareInputs(answer);
        }
    }

    @Override
    public List<HardwareComponent> components() {
        return components;
    }

    @Override
    public int id() {
        return id;
    }

    @Override
    public String name() {
        return "fake " + id;
    }

    @Override
    public void exit() {
        exits++;
        if (failExit != null) {
            throw failExit;
        }
    }
}
