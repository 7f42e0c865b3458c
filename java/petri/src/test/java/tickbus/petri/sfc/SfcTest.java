package tickbus.petri.sfc;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.RandomAccessFile;
import java.nio.file.Files;
import java.nio.file.Path;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.petri.analysis.Reachability;
import tickbus.petri.net.NetException;

/** Charts as nets: the example of docs/petri.md, the net that results, and every mistake at its place. */
class SfcTest {
    private static final String TANK = """
        PROGRAM tank
          VAR full AT %IX0.1 : BOOL; n : INT; spare : TIME; END_VAR
          VAR_OUTPUT valve : BOOL; END_VAR
          INITIAL_STEP idle: END_STEP
          STEP fill: valve(N); END_STEP
          TRANSITION start FROM idle TO fill := NOT full; END_TRANSITION
          TRANSITION FROM fill TO idle := full; END_TRANSITION
        END_PROGRAM
        """;

    private static String section() throws Exception {
        String doc = Files.readString(Path.of("../../docs/petri.md"));
        return doc.substring(doc.indexOf("## Sequential function charts"));
    }

    @Test
    void theExampleOfTheDocumentationRuns(@TempDir Path folder) throws Exception {
        String section = section();
        int from = section.indexOf("PROGRAM");
        Path file = Files.writeString(folder.resolve("tank.st"), section.substring(from, section.indexOf("```", from)));
        assertTrue(section.contains("SfcController tank = Sfc.read(Path.of(\"tank.st\")).start();"));
        SfcController tank = Sfc.read(file).start();
        tank.set("start", 1);
        tank.scan(0);
        assertEquals(1, tank.get("valve"));
        tank.set("full", 1);
        tank.scan(10_000_000);
        assertEquals("{stir}", tank.marking().toString());
        assertEquals(1, tank.get("batches"));
        tank.scan(1_990_000_000L);
        assertEquals("{stir}", tank.marking().toString());
        tank.scan(2_010_000_000L);
        assertEquals("{idle}", tank.marking().toString());
        assertEquals(0, tank.get("motor"));
        Reachability graph = Reachability.explore(Sfc.read(file).net(), 100);
        assertEquals("YES YES", graph.isSafe() + " " + graph.isLive());
    }

    @Test
    void aTimeOfManyDigitsIsRefusedAtOnce() {
        String text = TANK.replace(":= full", ":= fill.T > T#" + "1".repeat(1_000_000));
        NetException wrong = assertThrows(NetException.class, () -> Sfc.parse("tank.st", text));
        assertTrue(wrong.getMessage().contains("a time of 1000000 characters"), wrong.getMessage());
    }

    @Test
    void aLongExpressionIsRefusedAndDoesNotEndTheStack() {
        String text = TANK.replace(":= full", ":= full" + " OR full".repeat(2_001));
        NetException wrong = assertThrows(NetException.class, () -> Sfc.parse("tank.st", text));
        assertTrue(wrong.getMessage().contains("more than 2000 operators"), wrong.getMessage());
        Sfc.parse("tank.st", TANK.replace(":= full", ":= full" + " OR full".repeat(2_000))).start().scan(0);
    }

    @Test
    void aStepIsAPlace() {
        Sfc chart = Sfc.parse("tank.st", TANK);
        assertEquals("net tank: 2 places, 2 transitions, 4 arcs, [1, 0]", chart.net().toString());
        assertEquals("fill to idle", chart.net().transition(1).name());
        assertTrue(chart.net().transition(0).priority() > chart.net().transition(1).priority());
    }

    @Test
    void oneScanIsOneEvolution() {
        SfcController chart = Sfc.parse("c.st", "PROGRAM c INITIAL_STEP a: END_STEP STEP b: END_STEP STEP d: END_STEP "
            + "TRANSITION FROM a TO b := TRUE; END_TRANSITION TRANSITION FROM b TO d := TRUE; END_TRANSITION "
            + "TRANSITION FROM d TO a := TRUE; END_TRANSITION END_PROGRAM").start();
        for (String step : new String[] {"{b}", "{d}", "{a}", "{b}"}) {
            assertEquals(1, chart.scan(0));
            assertEquals(step, chart.marking().toString());
        }
    }

    @Test
    void anEarlierTransitionWinsWithoutPriorities() {
        SfcController chart = Sfc.parse("c.st", "PROGRAM c INITIAL_STEP a: END_STEP STEP b: END_STEP STEP d: END_STEP "
            + "TRANSITION FROM a TO b := TRUE; END_TRANSITION TRANSITION FROM a TO d := TRUE; END_TRANSITION END_PROGRAM").start();
        chart.scan(0);
        assertEquals("{b}", chart.marking().toString());
    }

    @Test
    void aStepThatIsEnteredByTheWayNeverLosesAnActiveVariable() {
        SfcController chart = Sfc.parse("c.st", "PROGRAM c VAR lamp : BOOL; END_VAR STEP b: lamp(N); END_STEP "
            + "INITIAL_STEP a: lamp(N); END_STEP TRANSITION FROM a TO b := TRUE; END_TRANSITION END_PROGRAM").start();
        chart.scan(0);
        assertEquals("{b} 1", chart.marking() + " " + chart.get("lamp"));
    }

    @Test
    void everyMistakeHasItsPlace() {
        assertMistake("NOT full;", "full AND n;", "tank.st:6: column 46: AND between BOOL and NUMBER; expected two of one type");
        assertMistake("NOT full;", "n;", "tank.st:6: column 41: this is NUMBER; expected BOOL");
        assertMistake("NOT full;", "ful;", "tank.st:6: column 41: there is no variable or step 'ful'; there are [full, n, spare, valve]");
        assertMistake("NOT full;", "idle.Y;", "tank.st:6: column 46: a step has no 'Y'; it has X and T");
        assertMistake("NOT full;", "TON(full, T#1s);", "tank.st:6: column 41: a call of 'TON'; functions and function blocks are not read");
        assertMistake("NOT full;", "n > 2.5;", "tank.st:6: column 45: '2.5'; expected a whole number, because charts with REAL are not read");
        assertMistake("NOT full;", "(".repeat(101) + "full", "tank.st:6: column 141: more than 100 brackets or signs within each other");
        assertMistake("TO fill", "TO filll", "tank.st:6: column 33: there is no step 'filll'; there are [idle, fill]");
        assertMistake("valve(N)", "full(N)", "tank.st:5: column 14: 'full' is no ACTION, and no variable of type BOOL that a program may write");
        assertMistake("valve(N)", "valve(X)", "tank.st:5: column 20: there is no qualifier 'X'; there are [N, S, R, L, D, P, P0, P1, SD, DS, SL]");
        assertMistake("valve(N)", "valve(L)", "tank.st:5: column 21: ')'; expected ,");
        assertMistake("valve(N)", "valve(L, T#1x)", "tank.st:5: column 23: T#1x is no time; expected one such as T#1m30s, at most 292 years");
        assertMistake("INITIAL_STEP", "STEP", "tank.st:8: column 1: the program has no INITIAL_STEP; expected a sequential function chart");
        assertMistake("STEP fill", "INITIAL_STEP fill", "tank.st:5: column 16: a second INITIAL_STEP; expected one in a chart");
        assertMistake("n : INT", "n : REAL", "tank.st:2: column 34: 'REAL' is not read; expected one of "
            + "[BOOL, DINT, INT, LINT, SINT, TIME, UDINT, UINT, USINT]");
        assertMistake("n : INT", "full : INT", "tank.st:2: column 30: full is declared twice");
        assertMistake("END_PROGRAM", "", "tank.st:9: column 1: the end of the file; expected END_PROGRAM");
        assertMistake("STEP fill:", "(* STEP fill:", "tank.st:5: column 3: '(' begins no word; the comment has no end");
        assertMistake("NOT full;", "€;", "tank.st:6: column 41: '€' begins no word");
        assertMistake("STEP fill:", "ACTION fill: full := TRUE; END_ACTION STEP fill:",
            "tank.st:5: column 16: full is an input; expected a variable that a program may write");
        assertMistake("STEP fill:", "ACTION act: IF full THEN n := 1; END_ACTION STEP fill:",
            "tank.st:5: column 36: 'END_ACTION'; expected an assignment to a variable, or IF; nothing else is read in actions");
    }

    @Test
    void aTransitionToManyStepsHasAShortName() {
        StringBuilder steps = new StringBuilder();
        StringBuilder names = new StringBuilder("s0");
        for (int i = 0; i < 10_000; i++) {
            steps.append("STEP s").append(i).append(": END_STEP ");
            names.append(i == 0 ? "" : ", s" + i);
        }
        Sfc chart = Sfc.parse("c.st", "PROGRAM c INITIAL_STEP a: END_STEP " + steps + "TRANSITION FROM a TO (" + names
            + ") := TRUE; END_TRANSITION TRANSITION FROM (" + names + ") TO a := TRUE; END_TRANSITION END_PROGRAM");
        assertTrue(chart.net().transition(0).name().endsWith("s18, s19, …"), chart.net().transition(0).name());
        SfcController run = chart.start();
        assertEquals("1 1", run.scan(0) + " " + run.scan(1));
        assertEquals(chart.net().arcs().size(), Sfc.parse("c.xml", chart.plcopen()).net().arcs().size());
    }

    @Test
    void largeFilesAndLongNamesAreRefused(@TempDir Path folder) throws Exception {
        assertMistake("STEP fill", "STEP f" + "i".repeat(200), "tank.st:5: column 8: a name of 201 characters; expected at most 200");
        assertMistake("valve(N);", ";".repeat(4_000_000), "tank.st:5: column 3999983: more than 4000000 words");
        Path file = folder.resolve("large.xml");
        try (RandomAccessFile large = new RandomAccessFile(file.toFile(), "rw")) {
            large.setLength((16L << 20) + 1);
        }
        assertEquals(file + ": 16777217 bytes; expected at most 16777216",
            assertThrows(NetException.class, () -> Sfc.read(file)).getMessage());
    }

    private static void assertMistake(String right, String wrong, String message) {
        assertTrue(TANK.contains(right));
        NetException thrown = assertThrows(NetException.class, () -> Sfc.parse("tank.st", TANK.replaceFirst(java.util.regex.Pattern.quote(right), wrong)));
        assertEquals(message, thrown.getMessage());
    }

    @Test
    void aClockThatGoesBackStopsTheChart() {
        SfcController chart = Sfc.parse("tank.st", TANK).start();
        chart.scan(10);
        assertEquals(0, chart.scan(5));
        assertTrue(chart.stop().isPresent());
        assertThrows(IllegalArgumentException.class, () -> chart.get("nothing"));
        chart.set("FULL", 1);
        assertEquals(1, chart.get("full"));
    }
}
