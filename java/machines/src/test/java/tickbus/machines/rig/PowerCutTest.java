package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertAll;
import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import DeviceDrivers.FieldbusDriver;
import java.io.IOException;
import java.nio.file.Path;
import java.util.List;
import java.util.function.BooleanSupplier;
import java.util.function.DoubleSupplier;
import java.util.stream.DoubleStream;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.ValueSource;
import tickbus.simulator.DriverSet;
import tickbus.simulator.Simulator;
import tickbus.simulator.TimeSource;

/**
 * Cuts the power of the built-in PLC program at one moment after another of a cycle, and restarts it without memory: the rig
 * must stop safely, drop nothing, and continue. Stepped, in simulation time.
 */
@Tag("native")
class PowerCutTest {
    private static final long STEP = 2_000_000L;
    private static final long MILLI = 1_000_000L;

    /** The approximate duration of a cycle. */
    private static final long CYCLE = 4_200 * MILLI;

    @TempDir
    Path folder;

    private Rig rig = new Rig();
    private MortalPlc plc;
    private Simulator simulator;
    private long endedWithoutPlc;
    private String moment = "the start";

    private void run(long nanos) {
        long end = simulator.simulationNanos() + nanos;
        until("time to pass", () -> simulator.simulationNanos() >= end);
    }

    private void until(String what, BooleanSupplier over) {
        long limit = simulator.simulationNanos() + 40_000 * MILLI;
        while (!over.getAsBoolean()) {
            simulator.tick();
            assertTrue(!rig.notOk(), () -> moment + ": " + rig.faults());
            assertTrue(simulator.simulationNanos() < limit, () -> moment + ": waited in vain for " + what);
        }
    }

    private void startAndRun(int cycles) {
        DoubleSupplier ready = simulator.probe("machine:panel.ready");
        DoubleSupplier counted = simulator.probe("machine:panel.cycles");
        until("Ready", () -> ready.getAsDouble() != 0);
        rig.press(Button.START);
        double end = counted.getAsDouble() + cycles;
        until(cycles + " cycles", () -> counted.getAsDouble() == end);
    }

    private void cut(long off) {
        long cycles = rig.counters().cycles();
        plc.off();
        run(off);
        if (off > 2 * MortalPlc.MAX_AGE) {
            double[] stood = where();
            run(500 * MILLI);
            assertAll(
                    () -> assertTrue(!rig.moving(), () -> moment + ": something moves without a PLC"),
                    () -> assertArrayEquals(stood, where(), moment));
        }
        // With the last word, step 6 can end before the data are stale.
        endedWithoutPlc += rig.counters().cycles() - cycles;
        plc.on();
    }

    private double[] where() {
        return DoubleStream.concat(
                DoubleStream.of(rig.position(Lift.LA1), rig.position(Lift.LA2), rig.wheel1Angle(), rig.wheel2Angle()),
                rig.bottles().stream().mapToDouble(b -> b.id() * 1e4 + b.height())).toArray();
    }

    private void sweep(long every, long off) throws IOException {
        Path cfg = Cfg.write(folder, "program = \"rig\"", "scan = \"10ms\"", "cycle = \"2ms\"",
                "mode = \"stepped\"");
        plc = new MortalPlc(() -> new FieldbusDriver(cfg));
        try (Simulator all = new Simulator(new DriverSet(List.of(plc)), rig, Path.of("rig.table"), STEP,
                TimeSource.system())) {
            simulator = all;
            int cuts = 0;
            for (long at = 0; at < CYCLE; at += every) {
                startAndRun(1);
                run(at);
                moment = "cut " + at / MILLI + " ms into a cycle, in step " + rig.step() + ", for " + off / MILLI
                        + " ms";
                cut(off);
                cuts++;
            }
            startAndRun(2);
            Counters counters = rig.counters();
            assertEquals(0, counters.faults() + counters.fallen() + counters.collisions() + counters.removed()
                    + counters.lampErrors(), counters::toString);
            assertEquals(counters.fed(), counters.delivered() + rig.bottles().size(), counters::toString);
            assertEquals(cuts + 2, counters.cycles() - endedWithoutPlc, counters::toString);
            assertTrue(counters.treated() >= cuts && counters.treated() <= counters.fed(), counters::toString);
        }
    }

    /** The rig is left in any state, and the PLC is late by any time: the delay need not be a multiple of the 10 ms scan. */
    @ParameterizedTest
    @ValueSource(strings = {"10ms", "37ms"})
    void homingEndsWellFromAnyPosition(String scan) throws IOException {
        Path cfg = Cfg.write(folder, "program = \"rig\"", "scan = \"" + scan + "\"", "cycle = \"2ms\"",
                "mode = \"stepped\"");
        for (int wheel2 = 0; wheel2 < 360; wheel2 += 7) {
            moment = "a start with wheel 2 at " + wheel2 + " degrees";
            rig = new Rig((wheel2 * 3 + 11) % 360, wheel2, wheel2 % 5 * 40, wheel2 % 3 * 60);
            plc = new MortalPlc(() -> new FieldbusDriver(cfg));
            try (Simulator all = new Simulator(new DriverSet(List.of(plc)), rig, Path.of("rig.table"), STEP,
                    TimeSource.system())) {
                simulator = all;
                startAndRun(1);
            }
        }
    }

    @Test
    void aLongPowerCutAtAnyMomentStopsTheRigSafe() throws IOException {
        sweep(20 * MILLI, 1_500 * MILLI);
    }

    @Test
    void aPowerCutThatEndsAsTheDataBecomeStaleDropsNothing() throws IOException {
        sweep(50 * MILLI, MortalPlc.MAX_AGE + 4 * MILLI);
    }

    @Test
    void aPowerCutTooShortForStaleDataDropsNothing() throws IOException {
        sweep(50 * MILLI, 30 * MILLI);
    }
}
