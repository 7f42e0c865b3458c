package tickbus.simulator.peeler;

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
import tickbus.simulator.DeviceDriverFolder;
import tickbus.simulator.DriverFolder;
import tickbus.simulator.Simulator;
import tickbus.simulator.TimeSource;

/** The whole line with its two PLC programs, stepped: on simulation time, so that no clock plays a part. */
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

    @Test
    void anAxisThatFailsStopsItsPlcAndTheLineGoesOnAfterwards() {
        untilCores(1, 90);
        line.fail(AxisName.TRANSFER_ARM, true);
        seconds(5);
        double place = line.position(AxisName.TRANSFER_ARM);
        assertEquals(0, line.speed(AxisName.CENTRING_X_LEFT));
        line.fail(AxisName.TRANSFER_ARM, false);
        untilCores(3, 180);
        assertTrue(place >= 0);
        assertEquals(List.of(), line.mishaps());
    }
}
