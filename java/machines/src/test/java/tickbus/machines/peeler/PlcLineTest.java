package tickbus.machines.peeler;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Path;
import java.util.List;
import org.junit.jupiter.api.AfterEach;
import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import tickbus.machines.demo.DriverFolder;
import tickbus.simulator.DeviceDriverFolder;
import tickbus.simulator.Simulator;
import tickbus.simulator.TimeSource;

/** The whole line with its two PLC programs, stepped: in simulation time, so that no clock is involved. */
@Tag("native")
class PlcLineTest {
    private static final long TICK = 2_000_000L;

    @TempDir
    Path folder;

    private final Peeler line = new Peeler();
    private Simulator simulator;

    @BeforeEach
    void open() throws IOException {
        DriverFolder.ofPeelingLine(folder, name -> "kind = \"loopback\"\nprogram = \"" + name
                + "\"\nscan = \"10ms\"\ncycle = \"10ms\"\nmode = \"stepped\"");
        simulator = new Simulator(DeviceDriverFolder.scan(folder).open(), line, Path.of("peeler.table"), TICK,
                TimeSource.system());
    }

    @AfterEach
    void close() {
        simulator.close();
    }

    private void seconds(double seconds) {
        long end = simulator.ticks() + (long) (seconds * 1e9 / TICK);
        while (simulator.ticks() < end) {
            simulator.tick();
        }
    }

    private void untilCores(int count, double seconds) {
        long end = simulator.ticks() + (long) (seconds * 1e9 / TICK);
        while (line.wood().coreCount() < count) {
            assertTrue(simulator.ticks() < end, () -> line.wood().coreCount() + " blocks within " + seconds
                    + " s; mishaps: " + line.mishaps());
            simulator.tick();
        }
    }

    @Test
    void fourBlocksOfFourShapesArePeeledAndNoWoodIsLost() {
        untilCores(4, 240);
        assertEquals(List.of(), line.mishaps());
        Wood wood = line.wood();
        assertEquals(0, wood.unpeeledCount());
        assertEquals(wood.chucked(), wood.veneer() + wood.torn() + wood.chipped() + wood.cores() + line.held(), 1e-9);
        assertEquals(1.5e-3 * Block.LENGTH / 1000 * wood.ribbon(), wood.veneer(), 0.01 * wood.veneer());
        assertTrue(wood.torn() < 0.05 * wood.veneer(), "torn: " + wood.torn());
    }

    /**
     * The PLC stops all axes, and restarts with the state that the sensors show; a half-peeled block is discarded.
     */
    @ParameterizedTest
    @CsvSource({"TRANSFER_CLAMP_RIGHT, 37.47, 0", "CENTRING_X_LEFT, 18.2, 0", "LINEAR_FEEDER, 43.22, 0",
        "TRANSFER_ARM, 11.5, 0", "SPINDLE_ROTATION, 18.47, 1", "KNIFE_CARRIAGE, 24, 1"})
    void anAxisThatFailsStopsItsPlcAndTheLineGoesOnWhenItIsMended(AxisName axis, double when, int givenUp) {
        seconds(when);
        line.fail(axis, true);
        assertEquals(List.of(axis), line.failed());
        seconds(2);
        assertEquals(0, line.speed(axis));
        line.fail(axis, false);
        assertEquals(List.of(), line.failed());
        untilCores(3, 120);
        assertEquals(List.of(), line.mishaps());
        assertEquals(givenUp, line.wood().unpeeledCount());
    }
}
