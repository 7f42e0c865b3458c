package tickbus.machines.demo;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.ByteArrayOutputStream;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.util.List;
import org.junit.jupiter.api.Test;
import tickbus.simulator.Arguments;
import tickbus.simulator.TimeSource;

class DemoRunTest {
    private static final Verdict VERDICT = new Verdict("demo");

    private final DemoRun run = new DemoRun(VERDICT);

    private static Stalls stall(long nanos) {
        Stalls stalls = new Stalls(TimeSource.system(), 1);
        stalls.silent(nanos);
        return stalls;
    }

    @Test
    void aFailureWithoutAStallIsTheVerdict() {
        String failed = VERDICT.failed("stale");
        assertFalse(run.repeats(failed, stall(0)));
        assertEquals(failed, run.verdict(failed));
        assertEquals(List.of(), run.notes());
    }

    @Test
    void aSuccessIsTheVerdictInSpiteOfAStall() {
        String ok = VERDICT.ok("cycles=3");
        assertFalse(run.repeats(ok, stall(1_000_000_000)));
        assertEquals(ok, run.verdict(ok));
    }

    @Test
    void afterFiveStalledFailuresNothingCanBeSaid() {
        String failed = VERDICT.failed("stale");
        for (int attempt = 1; attempt < 5; attempt++) {
            assertTrue(run.repeats(failed, stall(200_000_000)));
        }
        assertEquals("attempt 4 does not count, because this machine stood still for 200 ms: " + failed, run.notes().get(3));
        assertFalse(run.repeats(failed, stall(200_000_000)));
        String said = run.verdict(failed);
        assertTrue(said.contains("in each of 5 attempts, so nothing can be said; the last attempt ended: stale"), said);
    }

    @Test
    void aWrongCommandLineGetsItsMistakeTheUsageAndAVerdict() {
        var out = new ByteArrayOutputStream();
        var err = new ByteArrayOutputStream();
        int code = DemoRun.start(new String[] {"--cylces", "3"}, "usage: demo\n",
                args -> new Arguments(args, List.of("--cycles"), List.of()), VERDICT, options -> 0,
                new PrintStream(out, true, StandardCharsets.UTF_8), new PrintStream(err, true, StandardCharsets.UTF_8));
        assertEquals(Verdict.USAGE, code);
        assertTrue(err.toString(StandardCharsets.UTF_8).contains("--cylces"), err.toString(StandardCharsets.UTF_8));
        assertTrue(err.toString(StandardCharsets.UTF_8).endsWith("usage: demo\n"));
        assertTrue(out.toString(StandardCharsets.UTF_8).startsWith("demo: failed reason="));
    }
}
