package tickbus.machines.rig.plc;

import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.Direction;
import controlinterface.HardwareComponent;
import java.nio.file.Path;
import java.util.List;
import tickbus.Signal;
import tickbus.junit.Machine;
import tickbus.junit.Plc;
import tickbus.machines.rig.Rig;
import tickbus.simulator.DriverSet;
import tickbus.simulator.ModelFault;
import tickbus.simulator.Simulator;
import tickbus.simulator.TimeSource;

/**
 * The rig behind its control table, as the simulator runs it, stepped by a {@link Plc} of the test kit.
 *
 * <p>For your own machine, just implement {@link Machine} and set its sensors there. This model already has its own
 * simulator, so the whole simulator is stepped, with the {@link Plc} in place of its driver.
 */
public final class SimulatedRig implements Machine {
    private static final Path CONTROL_TABLE = Path.of("rig.table");

    private final Rig rig;
    private Line line;
    private Simulator simulator;

    /** A rig as found at power-up. */
    public SimulatedRig() {
        this(new Rig());
    }

    SimulatedRig(Rig rig) {
        this.rig = rig;
    }

    /** The model, for states without a signal: bottles, jams. */
    Rig rig() {
        return rig;
    }

    @Override
    public void connect(Plc plc) {
        line = new Line(plc);
        simulator = new Simulator(new DriverSet(List.of(line)), rig, CONTROL_TABLE, plc.stepNanos(),
                TimeSource.system());
    }

    @Override
    public List<String> faults() {
        return rig.modelFaults().stream().map(ModelFault::name).toList();
    }

    @Override
    public void fault(String name, double value) {
        rig.fault(name, value);
    }

    @Override
    public void step(Plc plc, long simulationNanos) {
        line.deliver();
        simulator.tick();
    }

    /** The simulator's driver: its components are the signals of the PLC. The test kit makes the exchange. */
    private static final class Line extends ControlInterfaceDeviceDriver {
        private final Plc plc;
        private final Signal[] written;
        private final Signal[] read;
        private final double[] inputs;

        Line(Plc plc) {
            this.plc = plc;
            written = plc.signals().stream().filter(Signal::isWritten).toArray(Signal[]::new);
            read = plc.signals().stream().filter(signal -> !signal.isWritten()).toArray(Signal[]::new);
            inputs = new double[read.length];
        }

        /** The PLC's commands at the end of the last tick. */
        void deliver() {
            for (int i = 0; i < read.length; i++) {
                inputs[i] = read[i].get();
            }
            deliverHardwareInputs(inputs);
        }

        @Override
        public void updateComponentValues(double[] value) {
            for (int i = 0; i < written.length; i++) {
                written[i].set(value[i]);
            }
        }

        @Override
        public List<HardwareComponent> components() {
            return plc.signals().stream().map(signal -> new HardwareComponent(signal.name(),
                    signal.isWritten() ? Direction.WRITTEN_BY_SIMULATION : Direction.READ_BY_SIMULATION,
                    signal.type(), signal.unit())).toList();
        }

        @Override
        public int id() {
            return plc.id();
        }

        @Override
        public String name() {
            return "PLC under test";
        }

        @Override
        public void exit() {
            // The test kit closes the line.
        }
    }
}
