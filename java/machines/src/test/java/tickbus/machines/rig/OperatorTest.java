package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertAll;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.ByteArrayOutputStream;
import java.io.IOException;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.function.Consumer;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.simulator.DriverSet;
import tickbus.simulator.TickMode;

/** The demo's script with a PLC in the same class loader: its actions, and all the failures that it must detect. */
class OperatorTest {
    private static final Path TABLE = Path.of("rig.table");

    @TempDir
    Path folder;

    private String output;
    private PlcDriver plc;

    private int play(int cycles, Consumer<PlcDriver> sabotage) throws IOException {
        plc = new PlcDriver(TABLE);
        sabotage.accept(plc);
        return play(cycles, TABLE, HostedPlc::new);
    }

    /** The same with a PLC that is killed and restarted. */
    private int playWithOutage(int cycles, Consumer<PlcDriver> sabotage) throws IOException {
        plc = new PlcDriver(TABLE);
        sabotage.accept(plc);
        return play(cycles, TABLE, driver -> plc.new Power());
    }

    private int play(int cycles, Path table, Demo.PlcMaker maker) {
        DemoOptions options = new DemoOptions(folder, table, folder.resolve("demo/report.txt"), null, null, null,
                TickMode.BEST_EFFORT, 2_000_000, cycles, 120_000_000_000L, false);
        ByteArrayOutputStream bytes = new ByteArrayOutputStream();
        PrintStream out = new PrintStream(bytes, true, StandardCharsets.UTF_8);
        int code = Demo.run(options, () -> new DriverSet(List.of(plc)), maker, out, out);
        output = bytes.toString(StandardCharsets.UTF_8);
        return code;
    }

    private String verdict() {
        return output.strip().substring(output.strip().lastIndexOf('\n') + 1);
    }

    private void fails(String reason) {
        assertAll(
                () -> assertTrue(verdict().startsWith("demo: failed reason="), output),
                () -> assertTrue(verdict().contains(reason), verdict()),
                () -> assertEquals(1, plc.exits, "driver closed once"),
                () -> assertTrue(report().contains(verdict())));
    }

    private String report() throws IOException {
        return Files.readString(folder.resolve("demo/report.txt"));
    }

    @Test
    void threeCyclesWithOneJam() throws IOException {
        assertEquals(0, play(3, plc -> { }), () -> output);
        assertTrue(verdict().matches("demo: ok cycles=3 jams=1 restarts=0 ticks=\\d+ missed_edges=0 stale_ticks=0 report=.*"
                + "report.txt"), verdict());
        assertEquals(1, plc.exits);
        assertTrue(Files.readString(folder.resolve("demo/rig.svg")).contains("<svg"));
        String report = report();
        for (String part : List.of("Configuration", "Timeline", "takes the stuck bottle away", "phase recover",
                "Rising edges at both ends", "IM1 index", "Faults", "Counters", "bottles treated",
                "Statistics of driver 4711")) {
            assertTrue(report.contains(part), () -> part + " is missing in\n" + report);
        }
    }

    @Test
    void oneCycleJamsInTheFirst() throws IOException {
        assertEquals(0, play(1, plc -> { }), () -> output);
        assertTrue(verdict().startsWith("demo: ok cycles=1 jams=1 "), verdict());
    }

    @Test
    void aLogDoesNotFlood() throws IOException {
        play(3, plc -> { });
        assertTrue(output.lines().count() < 80, output);
    }

    @Test
    void aPlcThatIsKilledComesBackAndGoesOn() throws IOException {
        assertEquals(0, playWithOutage(3, plc -> { }), () -> output);
        assertTrue(verdict().matches("demo: ok cycles=3 jams=1 restarts=1 ticks=\\d+ missed_edges=0"
                + " stale_ticks=[1-9]\\d* report=.*"), verdict());
        String report = report();
        for (String part : List.of("The outage", "rig stood still after", "with bottle", "kills the PLC",
                "starts the PLC again", "Life 1 of the PLC, until: killed", "Life 2 of the PLC",
                "stale ticks in the outage")) {
            assertTrue(report.contains(part), () -> part + " is missing in\n" + report);
        }
    }

    @Test
    void oneCycleHasItsJamAndItsOutage() throws IOException {
        assertEquals(0, playWithOutage(1, plc -> { }), () -> output);
        assertTrue(verdict().startsWith("demo: ok cycles=1 jams=1 restarts=1 "), verdict());
    }

    @Test
    void cupsThatLetGoInTheOutageFail() throws IOException {
        assertEquals(1, playWithOutage(3, plc -> plc.dropsInOutage = true));
        fails("'SC1' is off while the data are stale; that is not its fail-safe value");
    }

    @Test
    void aLiftThatMovesInTheOutageFails() throws IOException {
        assertEquals(1, playWithOutage(3, plc -> plc.creepsInOutage = true));
        fails("'LA2 run' is on while the data are stale; that is not its fail-safe value");
    }

    @Test
    void dataThatNeverBecomeStaleFail() throws IOException {
        assertEquals(1, playWithOutage(3, plc -> plc.neverStale = true));
        fails("but its data are not stale, although max_age is 250ms");
    }

    @Test
    void anEdgeAfterTheLastCountsFails() throws IOException {
        assertEquals(1, playWithOutage(3, plc -> plc.edgeAfterDeath = true));
        fails("an edge of 'Ready lamp' came from the PLC after the last counts");
    }

    @Test
    void anEdgeLostAtTheReturnIsMissed() throws IOException {
        assertEquals(1, playWithOutage(3, plc -> plc.lostAtReturn = "LA2 bottom"));
        fails("missed edges: 1");
    }

    @Test
    void countsThatDoNotAgreeBeforeTheKillAreTold() throws IOException {
        assertEquals(1, playWithOutage(3, plc -> plc.miscounted = "Not OK"));
        fails("cycle 2 ended before the counts of both ends agreed");
        assertTrue(verdict().contains("'Not OK': 1 here, 2 at the PLC"), verdict());
    }

    @Test
    void aDrumThatHangsIsATimeOutOfItsStage() throws IOException {
        assertEquals(1, play(3, plc -> plc.deafStep = 4));
        fails("stage jam in cycle 1: waited 20s of simulation time for Not OK and the Fault lamp; the PLC is in phase"
                + " run, step 4");
    }

    @Test
    void aStaleLinkFails() throws IOException {
        assertEquals(1, play(3, plc -> plc.staleFrom = 5_000_000_000L));
        fails("the data became stale, outside the start-up and the outage");
    }

    @Test
    void aPeerThatDoesNotCountFails() throws IOException {
        assertEquals(1, play(1, plc -> plc.countless = true));
        fails("the PLC end gives no edge counts");
    }

    @Test
    void edgesCountedAtOneEndOnlyAreMissed() throws IOException {
        assertEquals(1, play(1, plc -> {
            plc.rises.put("Not OK", 1L);
            plc.rises.put("Acknowledge", 1L);
        }));
        fails("missed edges: 2");
    }

    @Test
    void aSignalThatThePeerForgotFails() throws IOException {
        assertEquals(1, play(1, plc -> plc.rises.remove("Lamp")));
        fails("no edge count for 'Lamp'");
    }

    @Test
    void aDarkLampFails() throws IOException {
        assertEquals(1, play(1, plc -> plc.lampDark = true));
        fails("the lamp differed from the motion of lift 2");
    }

    @Test
    void aDriverThatFailsEndsTheDemo() throws IOException {
        assertEquals(1, play(3, plc -> plc.throwFrom = 3_000_000_000L));
        fails("driver 4711 failed in tick 1500: the cable is cut");
    }

    @Test
    void aMissingRowOfTheControlTableFails() throws IOException {
        plc = new PlcDriver(TABLE);
        Path table = folder.resolve("short.table");
        Files.write(table, Files.readAllLines(TABLE).stream().filter(line -> !line.contains("LA1 bottom")).toList());
        assertEquals(1, play(3, table, HostedPlc::new));
        assertTrue(output.contains("no row of the control table writes 4711:LA1 bottom"), output);
        fails("stage homing");
    }

    @Test
    void aBrokenControlTableFails() throws IOException {
        plc = new PlcDriver(TABLE);
        Path table = folder.resolve("broken.table");
        Files.writeString(table, "4711:IM1 index | | | machine:im1.indx\n");
        assertEquals(1, play(3, table, HostedPlc::new));
        fails("did you mean 'machine:im1.index'?");
    }
}
