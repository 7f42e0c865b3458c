package tickbus.sdsp;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import DeviceDrivers.FieldbusDriver;
import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.CompletableFuture;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.api.io.TempDir;
import tickbus.FieldbusException;
import tickbus.Tickbus;

/** A Java simulator that takes part in a run through the drop-in driver: one word in its driver.cfg. */
@Tag("native")
@Timeout(120)
class SimulatorTest {
    private static final int STEPS = 200;

    private static final String RUN = """
        [sync]
        listen  = "127.0.0.1:20060"
        step    = "10ms"
        clients = ["hoist", "plc"]
        until   = "2s"
        """;

    @TempDir
    Path folder;

    /** The values that the simulator wrote and got in each tick. */
    private record Tick(double height, double lift) {}

    /** Lifts below 100 mm. */
    private static final class Plc implements Participant {
        final List<Long> heights = new ArrayList<>();

        @Override
        public Declaration declare() {
            return new Declaration("plc", 1, List.of(new Variable("lift", DataType.BOOL)), List.of("height"));
        }

        @Override
        public void initial(long[] writes) {}

        @Override
        public void run(long sequence, long nanos, long[] reads, long[] writes) {
            heights.add(reads[0]);
            writes[0] = lifts(reads[0]) ? 1 : 0;
        }

        static boolean lifts(double height) {
            return height < 100;
        }
    }

    private FieldbusDriver open(Sync sync, String type) throws IOException {
        return new FieldbusDriver(config(sync, type));
    }

    private Path config(Sync sync, String type) throws IOException {
        return Files.writeString(folder.resolve("driver.cfg"), """
            [driver]
            id = 1
            name = "hoist"

            [fieldbus]
            kind = "sdsp"
            address = "127.0.0.1:%d"

            [[signal]]
            name = "lift"
            address = "%%QX0.0"

            [[signal]]
            name = "height"
            address = "%%IW2"
            type = "%s"
            """.formatted(sync.port(), type));
    }

    /** One run; returns its trace hash. */
    private String run(List<Tick> ticks, Plc plc) throws IOException {
        try (Sync sync = new Sync(folder, RUN)) {
            CompletableFuture<Outcome> joined = sync.join(plc);
            FieldbusDriver driver = open(sync, "INT");
            double[] lift = new double[1];
            driver.connect(inputs -> lift[0] = inputs[0]);
            double height = 80;
            // The first tick is at the beginning of the first step, the last one at the end of the last.
            for (int step = 0; step <= STEPS; step++) {
                driver.simulationTime(step * 10_000_000L);
                driver.updateComponentValues(new double[] {height});
                ticks.add(new Tick(height, lift[0]));
                height += lift[0] == 1 ? 7 : -5;
            }
            driver.exit();
            Outcome outcome = joined.join();
            assertEquals(STEPS, outcome.steps());
            assertTrue(sync.await("sync: ok ").endsWith("hash=" + outcome.hashText()));
            return outcome.hashText();
        }
    }

    @Test
    void eachTickIsAStepAndTwoRunsAreEqualToTheLastBit() throws IOException {
        List<Tick> ticks = new ArrayList<>();
        Plc plc = new Plc();
        String hash = run(ticks, plc);
        for (int step = 0; step < STEPS - 1; step++) {
            assertEquals((long) ticks.get(step).height, plc.heights.get(step), "step " + step);
            // The PLC's answer is there at the end of its step.
            assertEquals(Plc.lifts(ticks.get(step).height), ticks.get(step + 1).lift == 1, "step " + step);
        }
        assertTrue(ticks.stream().anyMatch(tick -> tick.lift == 0), "it came up");
        List<Tick> again = new ArrayList<>();
        assertEquals(hash, run(again, new Plc()));
        assertEquals(ticks, again);
    }

    @Test
    void aSimulatorLearnsThatTheRunIsOver() throws IOException {
        try (Sync sync = new Sync(folder, RUN)) {
            CompletableFuture<Outcome> joined = sync.join(new Plc());
            try (Tickbus bus = Tickbus.open(config(sync, "INT"))) {
                long tick = 0;
                while (!bus.isOver()) {
                    bus.exchange(tick * 10_000_000L);
                    tick++;
                }
                // The tick at the end of the last step is the one that does not take place.
                assertEquals(STEPS + 1, tick);
            }
            assertEquals(STEPS, joined.join().steps());
        }
    }

    @Test
    void aPlcThatGivesUpEndsTheTicksWithItsReason() throws IOException {
        try (Sync sync = new Sync(folder, RUN)) {
            CompletableFuture<Outcome> joined = sync.join(new Participant() {
                @Override
                public Declaration declare() {
                    return new Plc().declare();
                }

                @Override
                public void initial(long[] writes) {}

                @Override
                public void run(long sequence, long nanos, long[] reads, long[] writes) {
                    if (sequence == 50) {
                        throw new IllegalStateException("the light curtain is broken");
                    }
                }
            });
            FieldbusDriver driver = open(sync, "INT");
            FieldbusException ended = assertThrows(FieldbusException.class, () -> {
                for (int step = 0; step < STEPS; step++) {
                    driver.simulationTime(step * 10_000_000L);
                    driver.updateComponentValues(new double[1]);
                }
            });
            assertTrue(ended.getMessage().contains("the light curtain is broken"), ended.getMessage());
            driver.exit();
            assertTrue(joined.handle((outcome, why) -> why != null).join());
        }
    }
}
