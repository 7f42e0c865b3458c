package tickbus.machines.rig.plc;

import static tickbus.junit.Condition.above;
import static tickbus.junit.Condition.on;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.nio.file.StandardOpenOption;
import java.util.Arrays;
import java.util.Locale;
import org.junit.jupiter.api.Test;
import tickbus.junit.Plc;
import tickbus.junit.PlcTest;
import tickbus.junit.Recording;

/**
 * Ticks per second that a test can reach: the rig behind its control table, its PLC program, and the test kit.
 *
 * <p>With {@code make bench}, which names a file for the results in {@code tickbus.bench.out}, it runs for seconds;
 * otherwise it only checks that it works.
 */
@RigTest
class RigSpeedTest {
    private static final String OUT = System.getProperty("tickbus.bench.out", "");
    private static final long TICKS = OUT.isEmpty() ? 20_000 : 1_000_000;
    /** The first rounds let the JIT compile; the result is the median of the others. */
    private static final int WARM_UP = OUT.isEmpty() ? 0 : 2;
    private static final int ROUNDS = OUT.isEmpty() ? 1 : 5;

    @PlcTest(recording = Recording.NEVER)
    void producesForALongTimeInAShortOne(Plc plc) throws IOException {
        measure("junit.ticks", plc);
    }

    @Test
    void producesAlmostAsFastWithARecorder(Plc plc) throws IOException {
        measure("junit.ticks.recorded", plc);
    }

    private static void measure(String figure, Plc plc) throws IOException {
        plc.await(on("Ready lamp")).within("25s");
        plc.press("Start button");
        plc.never(on("Fault lamp"));
        plc.tick(WARM_UP * TICKS);
        double[] ticksPerSecond = new double[ROUNDS];
        for (int round = 0; round < ROUNDS; round++) {
            long begin = System.nanoTime();
            plc.tick(TICKS);
            ticksPerSecond[round] = TICKS * 1e9 / (System.nanoTime() - begin);
        }
        plc.expect(above("Cycles", 2));
        if (!OUT.isEmpty()) {
            Arrays.sort(ticksPerSecond);
            String line = String.format(Locale.ROOT, "java %s %.0f%n", figure, ticksPerSecond[ROUNDS / 2]);
            Files.writeString(Path.of(OUT), line, StandardOpenOption.CREATE, StandardOpenOption.APPEND);
        }
    }
}
