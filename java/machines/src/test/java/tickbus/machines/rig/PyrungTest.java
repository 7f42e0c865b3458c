package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.junit.jupiter.api.Assumptions.assumeTrue;

import DeviceDrivers.FieldbusDriver;
import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.TimeUnit;
import java.util.function.BooleanSupplier;
import java.util.function.DoubleSupplier;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.api.condition.DisabledOnOs;
import org.junit.jupiter.api.condition.OS;
import org.junit.jupiter.api.io.TempDir;
import tickbus.machines.demo.Eventually;
import tickbus.simulator.DriverSet;
import tickbus.simulator.Simulator;
import tickbus.simulator.TickMode;
import tickbus.simulator.TimeSource;

/**
 * The rig with a third-party PLC: the soft PLC pyrung runs the rig's program in ladder logic, {@code
 * tests/peers/rig_ladder.py}, and connects to the machine as a Modbus client. In real time, as pyrung requires.
 */
@Tag("native")
@DisabledOnOs(value = OS.WINDOWS, disabledReason = "the environments of the tests are those of Unix")
@Timeout(240)
class PyrungTest {
    private static final Path ROOT = Path.of("../..").toAbsolutePath().normalize();
    private static final Path PYTHON = ROOT.resolve("target/peers/pyrung/bin/python");
    private static final Path LADDER = ROOT.resolve("tests/peers/rig_ladder.py");

    private static final long STEP = 2_000_000L;
    private static final long SECOND = 1_000_000_000L;

    /** Long enough for a machine that is busy with other tests. */
    private static final long PATIENCE = 60 * SECOND;

    @TempDir
    Path folder;

    private final Rig rig = new Rig();
    private final List<Integer> phases = new ArrayList<>();
    private Simulator simulator;
    private FieldbusDriver driver;
    private Process plc;
    private Path told;

    private void until(String what, BooleanSupplier over) {
        long limit = simulator.simulationNanos() + PATIENCE;
        DoubleSupplier phase = simulator.probe("machine:panel.phase");
        simulator.run(TickMode.REAL_TIME, () -> {
            int now = (int) phase.getAsDouble();
            if (phases.isEmpty() || phases.get(phases.size() - 1) != now) {
                phases.add(now);
            }
            assertTrue(plc.isAlive(), () -> "the PLC ended: " + ladder());
            assertTrue(simulator.simulationNanos() < limit, () -> "waited in vain for " + what + "; phases " + phases
                    + ", faults " + rig.faults() + ", driver " + driver.statistics() + "; " + ladder());
            return !over.getAsBoolean();
        });
    }

    private void lamp(String name) {
        DoubleSupplier lamp = simulator.probe("machine:panel." + name);
        until("the lamp " + name, () -> lamp.getAsDouble() != 0);
    }

    private String ladder() {
        try {
            return Files.readString(told);
        } catch (IOException e) {
            return e.toString();
        }
    }

    private String address() {
        return Eventually.get("an address", () -> driver.statistics().get("address"));
    }

    @Test
    void aLadderProgramOnASoftPlcHomesTheRigRunsItAndParksIt() throws IOException, InterruptedException {
        assumeTrue(Files.isExecutable(PYTHON), "pyrung is not installed (tools/peers installs it)");
        told = folder.resolve("ladder.log");
        // This test runs in real time, whatever else this computer has to do.
        driver = new FieldbusDriver(Cfg.writeBus(folder.resolve("drivers"), "modbus-server",
                "address = \"127.0.0.1:0\"", "max_age = \"2s\""));
        try (Simulator all = new Simulator(new DriverSet(List.of(driver)), rig, Path.of("rig.table"), STEP,
                TimeSource.system())) {
            simulator = all;
            plc = new ProcessBuilder(PYTHON.toString(), LADDER.toString(), "--address", address())
                    .redirectErrorStream(true).redirectOutput(told.toFile()).start();
            DoubleSupplier cycles = all.probe("machine:panel.cycles");
            lamp("ready");
            rig.press(Button.START);
            lamp("running");
            until("two cycles", () -> cycles.getAsDouble() >= 2);
            rig.press(Button.STOP);
            lamp("parked");
        } finally {
            if (plc != null) {
                plc.destroy();
                assertTrue(plc.waitFor(20, TimeUnit.SECONDS), "the PLC ends on request");
            }
        }
        // Initialise, home, ready, run, finalise, parked; before the first data from the PLC there is no phase.
        assertEquals(List.of(0, 1, 2, 3, 6, 7), phases, this::ladder);
        assertEquals(0, rig.counters().faults(), () -> rig.faults().toString());
        assertEquals(0, rig.counters().fallen());
        assertTrue(rig.counters().cycles() >= 2, () -> rig.counters().toString());
        assertTrue(ladder().contains("phase=run cycles=2"), this::ladder);
    }
}
