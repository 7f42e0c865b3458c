package tickbus.junit;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.stream.Stream;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import org.junit.platform.engine.DiscoverySelector;
import org.junit.platform.engine.TestExecutionResult;
import org.junit.platform.engine.discovery.DiscoverySelectors;
import org.junit.platform.launcher.TestExecutionListener;
import org.junit.platform.launcher.TestIdentifier;
import org.junit.platform.launcher.core.LauncherDiscoveryRequestBuilder;
import org.junit.platform.launcher.core.LauncherFactory;

/** Sweeps, as JUnit runs those of {@link SweepSamples}. */
@Tag("native")
class FaultSweepTest {
    @TempDir
    private Path reports;

    /** Runs a sweep; the failures by the names of the runs, empty for a run that passed. */
    private Map<String, String> run(Class<?> samples, String method, String... parameters) {
        return run(DiscoverySelectors.selectMethod(samples, method, Plc.class), parameters);
    }

    private Map<String, String> run(DiscoverySelector selector, String... parameters) {
        LauncherDiscoveryRequestBuilder request = LauncherDiscoveryRequestBuilder.request()
            .selectors(selector)
            .configurationParameter("tickbus.reports", reports.toString());
        for (String parameter : parameters) {
            String[] pair = parameter.split("=", 2);
            request.configurationParameter(pair[0], pair[1]);
        }
        Map<String, String> results = new LinkedHashMap<>();
        LauncherFactory.create().execute(request.build(), new TestExecutionListener() {
            @Override
            public void executionFinished(TestIdentifier test, TestExecutionResult result) {
                if (test.isTest() || result.getThrowable().isPresent()) {
                    results.put(test.getDisplayName(), result.getThrowable().map(Throwable::getMessage).orElse(""));
                }
            }
        });
        return results;
    }

    private String matrix(String sweep) throws IOException {
        return Files.readString(reports.resolve(sweep + ".txt"));
    }

    @Test
    void eachFaultAtEachMomentIsATestWithTheVerdictThatATestFileGives() throws IOException {
        Map<String, String> results = run(SweepSamples.Lift.class, "rises");
        assertEquals(25, results.size(), results::toString);
        assertEquals("without a fault", results.keySet().iterator().next());
        assertEquals("", results.get("without a fault"));
        assertEquals("", results.get("Start stuck-off @ runs"));
        assertEquals("continues differently: \"Run\" is on after 2ms already, without the fault after 12ms",
            results.get("Start stuck-on @ at rest"));
        assertEquals("stands still: \"Speed\" stays 5 mm/s, 6 mm/s without the fault", results.get("Height frozen @ moves"));
        assertTrue(results.get("Height noise 0.5 200 @ runs").startsWith("breaks a \"never\": \"Speed < 0\" after "));
        for (String table : List.of(
            "\nstuck-off     at rest runs    moves\nStart         DIFFERS 8ms     8ms\n",
            "\nlate 6ms      at rest runs    moves\nStart         ok      ok      ok\nHeight        ok      ok      ok\n",
            "\nHeight        NEVER   NEVER   NEVER\n",
            "\nline-down     at rest runs    moves\nthe line      STILL   STILL   STILL\n",
            "sweep: runs=24 told=")) {
            assertTrue(matrix("SweepSamples.Lift.rises").contains(table), table + matrix("SweepSamples.Lift.rises"));
        }
    }

    @Test
    void thePageOpensTheRecordingsOfTheRunsThatFailed() throws IOException {
        run(SweepSamples.Recorded.class, "rises");
        String page = Files.readString(reports.resolve("SweepSamples.Recorded.rises.html"));
        String report = "tickbus.junit.SweepSamples.Recorded.rises-6.html";
        assertTrue(Files.exists(reports.resolve(report)), report);
        assertTrue(page.contains("<a class=\"run red\" href=\"" + report + "\" title=\"stands still: "), page);
        assertTrue(page.contains("mvn test '-Dtest=tickbus.junit.SweepSamples$Recorded#rises' '-Dtickbus.only={}'"), page);
        assertFalse(Files.exists(reports.resolve("tickbus.junit.SweepSamples.Recorded.rises-1.vcd")), "it passed");
    }

    @Test
    void theExpectationsOfTheScenarioDoNotCountUnderAFault() throws IOException {
        Map<String, String> results = run(SweepSamples.Careless.class, "rises");
        assertEquals(25, results.size(), results::toString);
        results.forEach((name, failure) -> assertFalse(failure.contains("it runs"), name + ": " + failure));
        // An assertion of its own that fails ends its actions: without a Run, the lift stays where it is.
        assertTrue(matrix("SweepSamples.Careless.rises").contains("\nStart         STILL   8ms     8ms\n"),
            matrix("SweepSamples.Careless.rises"));
    }

    @Test
    void whatAClassDoesBeforeEachTestIsPartOfTheScenario() throws IOException {
        Map<String, String> results = run(SweepSamples.Prepared.class, "rises");
        assertEquals(5, results.size(), results::toString);
        // Under this fault the method before the test would wait forever.
        assertEquals("stands still: \"Run\" stays off, on without the fault", results.get("Start stuck-off @ at rest"));
        results = run(SweepSamples.Prepared.class, "assumes");
        assertEquals(25, results.size(), results::toString);
        results.forEach((name, failure) -> assertFalse(failure.contains("it runs"), name + ": " + failure));
        assertTrue(matrix("SweepSamples.Prepared.assumes").contains("sweep: runs=24 told="));
    }

    @Test
    void aDelayedSensorReachesThePlcLateAndTheScenarioAtOnce() {
        String failure = run(SweepSamples.Lift.class, "watches").get("Start late 6ms @ at rest");
        assertEquals("continues differently: \"Run\" is off (and 1 more) after 14ms, on without the fault", failure);
    }

    @Test
    void theFaultsOfAMachineAreInItsSweep() throws IOException {
        assertEquals(Map.of("without a fault", "", "wire model @ Run", ""), run(SweepSamples.Model.class, "rises"));
        assertTrue(matrix("SweepSamples.Model.rises").contains(" told=1 "), matrix("SweepSamples.Model.rises"));
        String failure = run(SweepSamples.Model.class, "unknownFault").get("without a fault");
        assertTrue(failure.contains("the model has no fault \"wier\"; did you mean \"wire\"?"), failure);
    }

    @Test
    void testsThatRunAtOnceDoNotDisturbTheOrderOfARun() {
        Map<String, String> results = run(SweepSamples.Lift.class, "rises", "junit.jupiter.execution.parallel.enabled=true",
            "junit.jupiter.execution.parallel.mode.default=concurrent");
        assertEquals(run(SweepSamples.Lift.class, "rises"), results);
        assertEquals("without a fault", results.keySet().iterator().next());
    }

    @Test
    void aRunAloneIsNotChosenByItsId() {
        String method = "[engine:junit-jupiter]/[class:" + SweepSamples.Lift.class.getName()
            + "]/[test-template:rises(tickbus.junit.Plc)]";
        Map<String, String> results = run(
            DiscoverySelectors.selectUniqueId(method + "/[test-template-invocation:#5]"));
        assertEquals(1, results.size(), results::toString);
        assertTrue(results.get("rises(Plc)").contains("need the run without a fault"), results::toString);
    }

    @Test
    void aSweepThatIsNotJudgedLeavesNoResultsOfAnEarlierOne() throws IOException {
        for (String end : List.of(".txt", ".html")) {
            Files.writeString(reports.resolve("SweepSamples.Wrong.failsWithoutAFault" + end), "of an earlier run");
        }
        run(SweepSamples.Wrong.class, "failsWithoutAFault");
        try (Stream<Path> left = Files.list(reports)) {
            assertEquals(List.of(), left.toList());
        }
    }

    @Test
    void oneRunIsMadeByItsNameAndSeveralByAPartOfIt() {
        assertEquals(List.of("without a fault", "Height frozen @ runs"),
            List.copyOf(run(SweepSamples.Lift.class, "rises", "tickbus.only=Height frozen @ runs").keySet()));
        assertEquals(4, run(SweepSamples.Lift.class, "rises", "tickbus.only=Height frozen").size());
        String none = run(SweepSamples.Lift.class, "rises", "tickbus.only=Height forzen").get("rises(Plc)");
        assertEquals("-Dtickbus.only=Height forzen: no run of the sweep SweepSamples.Lift.rises has this in its name;"
            + " the first one is \"Start stuck-on @ at rest\"", none);
    }

    @Test
    void acceptedVerdictsPassAndAnyOtherFails() throws IOException {
        Path file = Path.of("accepted", "SweepSamples.Lift.rises.toml");
        try {
            // Not all runs are made, so nothing is written.
            String part = run(SweepSamples.Lift.class, "rises", "tickbus.accept=true", "tickbus.only=frozen")
                .get("rises(Plc)");
            assertTrue(part.contains("21 of 24 runs were not made or could not be judged, so nothing was accepted"), part);
            assertFalse(Files.exists(file));

            Map<String, String> results = run(SweepSamples.Lift.class, "rises", "tickbus.accept=true");
            results.forEach((name, failure) -> assertEquals("", failure, name));
            assertTrue(Files.readString(file).contains("which \"-Dtickbus.accept=true\" has written"));
            run(SweepSamples.Lift.class, "rises").forEach((name, failure) -> assertEquals("", failure, name));

            String changed = Files.readString(file).replace("\"still   still   still\"", "\"still   told    still\"");
            Files.writeString(file, changed);
            assertEquals("stands still: \"Speed\" stays 0 mm/s, 5 mm/s without the fault\naccepted: told",
                run(SweepSamples.Lift.class, "rises").get("Height frozen @ runs"));

            Files.writeString(file, changed.replace("Height frozen", "Height forzen"));
            String wrong = run(SweepSamples.Lift.class, "rises").get("without a fault");
            assertTrue(wrong.contains("the sweep has no fault \"Height forzen\"; did you mean \"Height frozen\"?"), wrong);
        } finally {
            Files.deleteIfExists(file);
        }
    }

    @ParameterizedTest
    @CsvSource(delimiter = '|', value = {
        "unknownSignal        | SweepSamples.Wrong.unknownSignal:1:12: there is no signal \"Strat\"; did you mean \"Start\"?",
        "unknownKind          | SweepSamples.Wrong.unknownKind:1:10: ",
        "unknownKind          | did you mean \"stuck-o",
        "noFaultsOfTheModel   | none of the signals can have the fault \"model\"; the machine has declared no faults: remove it",
        "momentThatNeverComes | the moment \"far up\" never comes in the scenario, which lasts 70ms without a fault; "
            + "let the scenario go that far, or remove the moment",
        "scenarioInTheKeys    | unknown key \"scenario\"",
        "toldWithoutAFault    | \"Speed == 5\" holds without a fault, so it tells nothing; "
            + "write what the program does only after a fault",
        "failsWithoutAFault   | the scenario fails without a fault, so nothing was judged: tick 35 (70ms): 'Speed' is 6 mm/s,"
            + " expected 7",
        "failsWithoutAFault   | let the scenario pass as a @Test first",
    })
    void badInputSaysWhatAndWhatToDo(String method, String told) {
        Map<String, String> results = run(SweepSamples.Wrong.class, method);
        assertEquals(1, results.size(), results::toString);
        String failure = results.get("without a fault");
        assertTrue(failure.contains(told), failure);
    }
}
