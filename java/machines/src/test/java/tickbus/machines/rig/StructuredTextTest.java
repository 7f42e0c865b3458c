package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import DeviceDrivers.FieldbusDriver;
import controlinterface.ControlInterfaceDeviceDriver;
import controlinterface.HardwareComponent;
import java.io.IOException;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.function.BooleanSupplier;
import java.util.function.DoubleSupplier;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.condition.EnabledIfEnvironmentVariable;
import org.junit.jupiter.api.io.TempDir;
import tickbus.simulator.DriverSet;
import tickbus.simulator.Simulator;
import tickbus.simulator.TimeSource;

/**
 * The rig's program in Structured Text, compiled, runs in parallel with the built-in one: their outputs must be equal
 * in every tick. Stepped, in simulation time.
 */
@Tag("native")
@EnabledIfEnvironmentVariable(named = StructuredTextTest.PROGRAM, matches = ".+",
        disabledReason = "plc/rig/rig.st is not compiled: there is no iec2c")
class StructuredTextTest {
    static final String PROGRAM = "TICKBUS_RIG_PROGRAM";

    private static final long STEP = 2_000_000L;
    private static final long SECOND = 1_000_000_000L;

    @TempDir
    Path folder;

    private final Rig rig = new Rig();
    private Simulator simulator;

    /** Two PLCs with the same inputs; their outputs must agree. */
    private static final class Twins extends ControlInterfaceDeviceDriver {
        private final List<FieldbusDriver> drivers;
        private final List<double[]> given = new ArrayList<>();
        private long ticks;

        Twins(FieldbusDriver... drivers) {
            this.drivers = List.of(drivers);
            for (FieldbusDriver driver : drivers) {
                driver.connect(inputs -> given.add(inputs.clone()));
            }
        }

        @Override
        public void simulationTime(long nanos) {
            drivers.forEach(driver -> driver.simulationTime(nanos));
        }

        @Override
        public void updateComponentValues(double[] value) {
            given.clear();
            drivers.forEach(driver -> driver.updateComponentValues(value.clone()));
            ticks++;
            assertArrayEquals(given.get(0), given.get(1), () -> "tick " + ticks);
            deliverHardwareInputs(given.get(0));
        }

        @Override
        public List<HardwareComponent> components() {
            return drivers.get(0).components();
        }

        @Override
        public int id() {
            return 4711;
        }

        @Override
        public String name() {
            return "twins";
        }

        @Override
        public void exit() {
            drivers.forEach(FieldbusDriver::exit);
        }
    }

    private FieldbusDriver driver(String name, String... program) throws IOException {
        List<String> lines = new ArrayList<>(List.of(program));
        lines.addAll(List.of("cycle = \"2ms\"", "mode = \"stepped\""));
        return new FieldbusDriver(Cfg.write(folder.resolve(name), lines.toArray(String[]::new)));
    }

    private void until(String what, BooleanSupplier over) {
        long limit = simulator.simulationNanos() + 60 * SECOND;
        while (!over.getAsBoolean()) {
            simulator.tick();
            assertTrue(simulator.simulationNanos() < limit, () -> "waited in vain for " + what);
        }
    }

    private void lamp(String name) {
        DoubleSupplier lamp = simulator.probe("machine:panel." + name);
        until("the lamp " + name, () -> lamp.getAsDouble() != 0);
    }

    private void press(Button button) {
        rig.press(button);
    }

    @Test
    void everyTickIsThatOfTheBuiltInProgram() throws IOException {
        Path program = Path.of(System.getenv(PROGRAM)).toAbsolutePath();
        Twins twins = new Twins(driver("built-in", "program = \"rig\"", "scan = \"10ms\""),
                driver("compiled", "program = \"" + program + "\"", "program_options = { alive = \"%IX3.0\" }"));
        try (Simulator all = new Simulator(new DriverSet(List.of(twins)), rig, Path.of("rig.table"), STEP,
                TimeSource.system())) {
            simulator = all;
            DoubleSupplier cycles = all.probe("machine:panel.cycles");
            lamp("ready");
            press(Button.START);
            until("two cycles", () -> cycles.getAsDouble() == 2);
            rig.jamNext(Lift.LA2);
            lamp("fault");
            rig.clearJam();
            press(Button.RESET);
            lamp("running");
            until("two more", () -> cycles.getAsDouble() >= 4);
            press(Button.STOP);
            lamp("parked");
            press(Button.START);
            lamp("ready");
            assertEquals(1, rig.counters().faults(), () -> rig.counters().toString());
            assertTrue(twins.ticks > 10_000, () -> "only " + twins.ticks + " ticks");
        }
    }
}
