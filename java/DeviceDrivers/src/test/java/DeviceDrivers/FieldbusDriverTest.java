package DeviceDrivers;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import controlinterface.Direction;
import controlinterface.HardwareComponent;
import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.FieldbusException;
import tickbus.Status;

class FieldbusDriverTest {
    private static final long TICK = 1_000_000;

    @TempDir
    Path directory;

    private FieldbusDriver open() throws IOException {
        return new FieldbusDriver(file(""));
    }

    private Path file(String more) throws IOException {
        return Files.writeString(directory.resolve("rig.cfg"), """
            [driver]
            id = 7
            name = "Mirror"

            [fieldbus]
            kind = "loopback"
            program = "mirror"
            mode = "stepped"
            scan = "1ms"

            [[signal]]
            name = "lamp"
            address = "%QX0.0"
            latch = "rising"

            [[signal]]
            name = "button"
            address = "%IX0.0"

            [[signal]]
            name = "speed"
            address = "%QW2"
            type = "INT"
            unit = "mm/s"

            [[signal]]
            name = "measured speed"
            address = "%IW2"
            type = "INT"
            unit = "mm/s"
            """ + more);
    }

    @Test
    void theMachineGetsItsFaultsBeforeTheValuesOfTheTick() throws IOException {
        FieldbusDriver driver = new FieldbusDriver(file("""
            [[fault]]
            kind  = "model"
            name  = "leak"
            value = 0.4
            tick  = 2
            ticks = 1
            """));
        List<String> told = new ArrayList<>();
        driver.connectFaults(List.of("wear", "leak"), (name, value) -> told.add(name + "=" + value));
        driver.connect(inputs -> told.add("tick"));
        for (int i = 1; i <= 3; i++) {
            driver.simulationTime(i * TICK);
            driver.updateHardwareInputs();
            driver.updateComponentValues(new double[2]);
        }
        assertEquals(List.of("tick", "leak=0.4", "tick", "leak=0.0", "tick"), told);
        FieldbusException wrong = assertThrows(FieldbusException.class,
            () -> driver.connectFaults(List.of("wear", "wear"), (name, value) -> { }));
        assertEquals(Status.BAD_ARGUMENT, wrong.status());
        driver.exit();
    }

    @Test
    void aDriverThatIsOnlyLookedAtOpensNothing() throws IOException {
        Path record = Files.writeString(directory.resolve("run.vcd"), "the recording of yesterday");
        Path cfg = file("[record]\nfile = \"run.vcd\"\n");
        FieldbusDriver open = new FieldbusDriver(cfg);
        FieldbusDriver looked = FieldbusDriver.look(cfg);
        assertEquals(open.components(), looked.components());
        assertEquals(7, looked.id());
        assertEquals("Mirror", looked.name());
        FieldbusException refused = assertThrows(FieldbusException.class,
            () -> looked.updateComponentValues(new double[2]));
        assertEquals(Status.NOT_OPEN, refused.status());
        looked.exit();
        open.exit();
        assertEquals("the recording of yesterday", Files.readString(record));
    }

    @Test
    void componentsAreSignalsThenEdgesThenTheBus() throws IOException {
        FieldbusDriver driver = open();
        assertEquals(7, driver.id());
        assertEquals("Mirror", driver.name());
        assertEquals(List.of(
            new HardwareComponent("lamp", Direction.READ_BY_SIMULATION, "BOOL", ""),
            new HardwareComponent("button", Direction.WRITTEN_BY_SIMULATION, "BOOL", ""),
            new HardwareComponent("speed", Direction.READ_BY_SIMULATION, "INT", "mm/s"),
            new HardwareComponent("measured speed", Direction.WRITTEN_BY_SIMULATION, "INT", "mm/s"),
            new HardwareComponent("lamp.edges", Direction.READ_BY_SIMULATION, "UDINT", ""),
            new HardwareComponent("bus.age", Direction.READ_BY_SIMULATION, "LREAL", "s"),
            new HardwareComponent("bus.sequence", Direction.READ_BY_SIMULATION, "ULINT", ""),
            new HardwareComponent("bus.status", Direction.READ_BY_SIMULATION, "INT", "")), driver.components());
        driver.exit();
        assertEquals(8, driver.components().size());
    }

    @Test
    void aTickAnswersWithTheInputsInComponentOrder() throws IOException {
        FieldbusDriver driver = open();
        List<double[]> delivered = new ArrayList<>();
        driver.connect(inputs -> delivered.add(inputs.clone()));
        double edges = 0;
        for (int i = 1; i <= 5; i++) {
            driver.simulationTime(i * TICK);
            driver.updateComponentValues(new double[] {1, -250});
            edges += delivered.get(i - 1)[2];
        }
        double[] last = delivered.get(4);
        assertArrayEquals(new double[] {1, -250}, new double[] {last[0], last[1]});
        assertEquals(1, edges);
        assertTrue(last[3] >= 0 && last[3] < 1, "age " + last[3]);
        assertTrue(last[4] > 0, "sequence " + last[4]);
        assertTrue(last[5] == Status.FRESH.code() || last[5] == Status.UNCHANGED.code(), "status " + last[5]);
        assertEquals("5", driver.statistics().get("ticks"));
        driver.exit();
    }

    @Test
    void aSimulatorThatAsksFirstHasTheInputsBeforeItsStep() throws IOException {
        FieldbusDriver driver = open();
        List<double[]> delivered = new ArrayList<>();
        driver.connect(inputs -> delivered.add(inputs.clone()));
        for (int i = 0; i < 5; i++) {
            driver.simulationTime(i * TICK);
            driver.updateHardwareInputs();
            assertEquals(i + 1, delivered.size(), "delivered before the step");
            driver.updateComponentValues(new double[] {1, -250});
            assertEquals(i + 1, delivered.size(), "and not again after it");
        }
        double[] last = delivered.get(4);
        assertArrayEquals(new double[] {1, -250}, new double[] {last[0], last[1]});
        assertEquals("5", driver.statistics().get("ticks"));
        driver.updateComponentValues(new double[2]);
        assertEquals(6, delivered.size(), "who does not ask is answered as before");
        driver.exit();
    }

    @Test
    void ticksWithoutSimulationTimeAreServed() throws IOException {
        FieldbusDriver driver = open();
        driver.updateComponentValues(new double[2]);
        assertThrows(IllegalArgumentException.class, () -> driver.updateComponentValues(new double[3]));
        driver.exit();
    }

    @Test
    void afterExitTicksAreRefusedAndExitIsNot() throws IOException {
        FieldbusDriver driver = open();
        driver.exit();
        driver.exit();
        FieldbusException refused = assertThrows(FieldbusException.class, () -> driver.updateComponentValues(new double[2]));
        assertEquals(Status.CLOSED, refused.status());
    }

    @Test
    void aWrongFileIsRefusedWithItsMistakes() throws IOException {
        Path wrong = Files.writeString(directory.resolve("wrong.cfg"), "[driver]\nid = \"seven\"\n");
        FieldbusException refused = assertThrows(FieldbusException.class, () -> new FieldbusDriver(wrong));
        assertEquals(Status.BAD_CONFIG, refused.status());
        assertTrue(refused.getMessage().contains("wrong.cfg:2:6: "), refused::getMessage);
    }
}
