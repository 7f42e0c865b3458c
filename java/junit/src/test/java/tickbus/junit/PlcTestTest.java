package tickbus.junit;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertInstanceOf;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Optional;
import java.util.stream.Stream;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import org.junit.platform.engine.TestExecutionResult;
import org.junit.platform.engine.discovery.DiscoverySelectors;
import org.junit.platform.launcher.LauncherDiscoveryRequest;
import org.junit.platform.launcher.TestExecutionListener;
import org.junit.platform.launcher.TestIdentifier;
import org.junit.platform.launcher.core.LauncherDiscoveryRequestBuilder;
import org.junit.platform.launcher.core.LauncherFactory;
import org.opentest4j.AssertionFailedError;

/** The extension, as JUnit runs it over {@link Samples}. */
@Tag("native")
class PlcTestTest {
    private static final Map<String, TestExecutionResult> RED = run(Samples.Red.class);

    /** Runs the tests of a class; the results by the names of the methods, without their parameters. */
    private static Map<String, TestExecutionResult> run(Class<?> samples) {
        LauncherDiscoveryRequest request = LauncherDiscoveryRequestBuilder.request()
            .selectors(DiscoverySelectors.selectClass(samples)).build();
        Map<String, TestExecutionResult> results = new LinkedHashMap<>();
        LauncherFactory.create().execute(request, new TestExecutionListener() {
            @Override
            public void executionFinished(TestIdentifier test, TestExecutionResult result) {
                boolean failedAlone = test.isContainer() && result.getThrowable().isPresent();
                if (test.isTest() || failedAlone) {
                    results.put(test.getDisplayName().replaceAll("\\(.*", ""), result);
                }
            }
        });
        return results;
    }

    private static Throwable failure(String method) {
        Optional<Throwable> thrown = RED.get(method).getThrowable();
        return thrown.orElseThrow(() -> new AssertionError(method + " did not fail"));
    }

    @Test
    void goodTestsPass() {
        Map<String, TestExecutionResult> results = run(Samples.Green.class);
        results.forEach((method, result) -> assertEquals(Optional.empty(), result.getThrowable(), method));
        assertEquals(14, results.size(), () -> results.keySet().toString());
    }

    @Test
    void aFailureNamesTickTimeSignalExpectedSeenAndTheLastChanges() {
        AssertionFailedError failure = assertInstanceOf(AssertionFailedError.class, failure("await"));
        assertEquals("tick 25 (50ms): 'Speed' is 3 mm/s, expected above 3 within 20 ticks (40ms) of tick 5\n"
            + "  last changes of 'Speed' (%QW2): 0 mm/s → 2 mm/s at tick 1 (2ms) → 3 mm/s at tick 4 (8ms)",
            failure.getMessage());
        assertEquals("above 3", failure.getExpected().getValue());
        assertEquals("3 mm/s", failure.getActual().getValue());
    }

    @ParameterizedTest
    @CsvSource(delimiter = '|', value = {
        "expect    | tick 0 (0s): 'Run' is off, expected on",
        "during    | tick 1 (2ms): 'Run' is on, expected off for 500 ticks (1s) from tick 0",
        "never     | tick 4 (8ms): 'Run' is on, expected not on at every tick since tick 0",
        "swallowedOfNone   | driver 'Line' has no signal 'Strat'; did you mean 'Start'?",
        "edge      | tick 6 (12ms): 'Run' is on without one, expected a rising edge within 5 ticks (10ms) of tick 1",
        "both      | tick 1 (2ms): 'Speed' is 0 mm/s, expected 4 within 1 tick (2ms) of tick 0",
        "words     | tick 2 (4ms): \"the cow is in the barn\" is false, expected true within 2 ticks (4ms) of tick 0",
        "forgotten | await('Run' on) was given no limit, so that it never waited; add .within(…)",
        "otherAssertion      | of the test's own",
        "unknownSignal       | driver 'Line' has no signal 'Rnu'; did you mean 'Run'?",
        "notOurs             | signal 'Run' at %QX0.0 is written by the other end",
        "noLimit             | a limit of 0 ticks; give it at least 1, or use expect(…)",
        "shortLimit          | a limit of 1ms is shorter than one tick of 2ms",
        "backwards           | -1 ticks; time does not run backwards",
        "machineThatTicks    | a machine must not let time pass in its own step",
        "machineThatNeedsSomething | @PlcTest(machine = Needy.class): it has no constructor without parameters",
        "noStep              | @PlcTest(step = \"0s\"): a tick takes more than no time",
        "badStep             | @PlcTest(step = …): \"soon\" is no duration",
        "noSuchFile          | @PlcTest(config = \"lien.cfg\"): there is no file ",
        "badOption           | @PlcTest(options = \"speed\"): write each option as \"key=value\"",
        "plantOnASocket      | reached",
    })
    void failuresSayWhatHappened(String method, String told) {
        String message = failure(method).getMessage();
        assertTrue(message.startsWith(told), message);
    }

    @ParameterizedTest
    @CsvSource(delimiter = '|', value = {
        "noSuchProgram       | there is no program \"rigg\"; did you mean \"rig\"?",
        "nobodyAtTheOtherEnd | the bus \"socket\" of the driver.cfg has no mode; name a PLC program to be at the other end",
    })
    void mistakesOfTheBusAreTold(String method, String told) {
        String message = failure(method).getMessage();
        assertTrue(message.contains(told), message);
    }

    @ParameterizedTest
    @CsvSource({"swallowed, 6 (12ms)", "alwaysUnswallowed, 5 (10ms)"})
    void whatWasSwallowedIsNamedWithTheStepsAndTheCure(String method, String tick) {
        assertEquals("tick " + tick + ": expected nothing swallowed: \"Start\" changed and changed back once between two"
            + " scans of 10ms; the PLC saw none of it: set latch = \"rising\" for it, or tick slower (count_swallowed ="
            + " false turns this message off); the first at tick 5 (10ms)\n  last changes of 'Start' (%IX0.0): off → on at"
            + " tick 4 (8ms) → off at tick 5 (10ms)", failure(method).getMessage());
    }

    @Test
    void everyFailureSaysWhereTheTestStood() {
        Throwable[] notes = failure("otherAssertion").getSuppressed();
        assertEquals(1, notes.length);
        assertTrue(notes[0].toString().startsWith("the test stood at tick 12 (24ms)"), notes[0].toString());
    }

    @Test
    void aFailedTestLeavesItsRecordingAndAGoodOneNone() throws IOException {
        String note = failure("otherAssertion").getSuppressed()[0].toString();
        Path recording = Path.of(note.replaceAll(".*; recording: |; report: .*", ""));
        Path report = Path.of(note.replaceAll(".*; report: ", ""));
        assertEquals("tickbus.junit.Samples.Red.otherAssertion.vcd", recording.getFileName().toString());
        assertTrue(Files.readString(recording).contains("#24"), "the last tick is in " + recording);
        assertTrue(Files.readString(report).contains("of the test&#39;s own")
            || Files.readString(report).contains("of the test's own"), "the failure is on " + report);
        Files.writeString(recording.resolveSibling("tickbus.junit.Samples.Green.conditionsJoin.html"), "of an earlier run");
        run(Samples.Green.class);
        try (Stream<Path> kept = Files.list(recording.getParent())) {
            assertEquals(List.of(), kept.filter(file -> file.toString().contains("Green")).toList());
        }
    }

    @Test
    void everySampleIsLookedAt() {
        assertEquals(26, RED.size(), () -> RED.keySet().toString());
    }

    @Test
    void anAnnotationWithoutAFileIsNoHelp() {
        String message = run(Samples.NoConfig.class).get("test").getThrowable().orElseThrow().getMessage();
        assertTrue(message.startsWith("@PlcTest names no driver.cfg"), message);
    }

    @Test
    void aPlcLivesForOneTest() {
        String message = run(Samples.ForTheWholeClass.class).values().iterator().next().getThrowable().orElseThrow()
            .getMessage();
        assertTrue(message.contains("a Plc lives for one test"), message);
    }
}
