package tickbus.petri.control;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.junit.jupiter.api.Assumptions.assumeTrue;

import com.sun.management.ThreadMXBean;
import java.lang.management.ManagementFactory;
import java.nio.file.Path;
import java.time.Duration;
import java.util.List;
import java.util.function.BooleanSupplier;
import org.junit.jupiter.api.AfterEach;
import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.Tickbus;
import tickbus.petri.analysis.Reachability;
import tickbus.petri.analysis.Verdict;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Conjunction;
import tickbus.petri.run.NetState;
import tickbus.petri.run.RunningNet;
import tickbus.petri.run.Stop;

/** Nets on a link in simulation time, so that the order of the machine's ticks and the scans is fixed. */
@Tag("native")
class NetControllerTest {
    @TempDir
    Path folder;

    private Tickbus machine;
    private Tickbus plc;
    private NetController nets;
    private long nanos;

    @BeforeEach
    void open() {
        String[] ends = Line.steppedLink();
        machine = Line.open(folder, 1, ends[0]);
        plc = Line.open(folder, 2, ends[1]);
    }

    @AfterEach
    void close() {
        plc.close();
        machine.close();
    }

    private static PetriNet gripper() {
        return PetriNet.named("gripper").place("waiting", 1).place("gripping").place("holding")
            .transition("grip").input("waiting").output("gripping")
            .transition("held").input("gripping").output("holding")
            .transition("release").input("holding").output("waiting").build();
    }

    private static BoundNet bound() {
        return BoundNet.of(gripper())
            .when("grip").on("Piece at stop").rising()
            .when("held").on("Gripper closed").atLeast("Weight", 50).below("Weight", 100)
            .when("release").off("Piece at stop").falling().is("Weight", 0)
            .during("gripping").set("Gripper").during("holding").set("Gripper").set("Brake");
    }

    /** The machine sends, the nets are scanned, and the machine receives. */
    private int scan() {
        nanos += 1_000_000;
        machine.send();
        int fired = nets.scan(nanos);
        machine.receive(nanos);
        return fired;
    }

    private void bind(BoundNet... bound) {
        nets = NetController.of(plc, bound);
        // An end is on the link from its first tick.
        machine.receive(0);
        nets.scan(0);
    }

    private boolean out(String signal) {
        return machine.signal(signal).getBoolean();
    }

    @Test
    void ofTwoMarkedPlacesTheOneBoundLastGivesTheValue() {
        PetriNet net = PetriNet.named("both").place("a", 1).place("b", 1).place("c").transition("t").input("a").output("c").build();
        bind(BoundNet.of(net).when("t").on("Piece at stop").during("b").set("Pieces", 5).during("a").set("Pieces", 3));
        scan();
        assertEquals(3, machine.signal("Pieces").get());
        machine.signal("Piece at stop").setBoolean(true);
        scan();
        assertEquals(5, machine.signal("Pieces").get());
    }

    @Test
    void aNetReadsSensorsAndSetsOutputsInOneExchange() {
        bind(bound());
        scan();
        assertFalse(out("Gripper"));
        assertFalse(out("Brake"), "on in driver.cfg only while nobody sends");
        machine.signal("Piece at stop").setBoolean(true);
        assertEquals(1, scan());
        assertTrue(out("Gripper"));
        machine.signal("Gripper closed").setBoolean(true);
        for (int weight : new int[] {49, 100}) {
            machine.signal("Weight").set(weight);
            assertEquals(0, scan(), "held at " + weight);
        }
        machine.signal("Weight").set(50);
        assertEquals(1, scan());
        assertTrue(out("Gripper") && out("Brake"));
        machine.signal("Piece at stop").setBoolean(false);
        assertEquals(0, scan(), "weight");
        machine.signal("Weight").set(0);
        assertEquals(0, scan(), "the edge was in the scan before");
        machine.signal("Piece at stop").setBoolean(true);
        scan();
        machine.signal("Piece at stop").setBoolean(false);
        assertEquals(1, scan());
        assertFalse(out("Gripper") || out("Brake"));
        assertEquals(plc.statistics().get("ticks"), Long.toString(nets.scans()));
    }

    @Test
    void aWatchShowsWhichSignalHoldsATransitionBack() {
        bind(bound());
        machine.signal("Piece at stop").setBoolean(true);
        scan();
        machine.signal("Piece at stop").setBoolean(false);
        scan();
        machine.signal("Piece at stop").setBoolean(true);
        machine.signal("Gripper closed").setBoolean(true);
        machine.signal("Weight").set(120);
        nets.watch().ask();
        scan();
        assertTrue(nets.watch().isThere());
        NetState state = nets.watch().state(0);
        RunningNet shown = nets.watch().nets().get(0);
        assertEquals(NetState.Phase.HELD, state.phase(1));
        List<Conjunction.Part> parts = ((Conjunction) shown.condition(1)).parts();
        assertEquals(List.of("Gripper closed on", "Weight ≥ 50", "Weight < 100"), parts.stream().map(Conjunction.Part::text).toList());
        assertEquals(2, state.failed(1));
        assertEquals("Weight", parts.get(2).input());
        assertEquals(120, state.input(shown.inputNames().indexOf("Weight")));
        assertEquals(1, state.output(shown.outputNames().indexOf("Gripper")));
        assertEquals("", nets.watch().note());
    }

    @Test
    void theClockOfTheNetsStandsStillWhileAnInputIsOn() {
        PetriNet late = PetriNet.named("late").place("a", 1).place("b").transition("go").input("a").output("b")
            .delay(Delay.fixed(5_000_000)).build();
        nets = NetController.of(plc, BoundNet.of(late)).stopClockWhile("Piece at stop");
        machine.receive(0);
        nets.scan(0);
        scan();
        machine.signal("Piece at stop").setBoolean(true);
        for (int i = 0; i < 20; i++) {
            assertEquals(0, scan());
        }
        machine.signal("Piece at stop").setBoolean(false);
        int scans = 0;
        while (scan() == 0) {
            scans++;
        }
        assertTrue(scans >= 3 && scans <= 5, scans + " scans of 1 ms after one before the stop");
        assertThrows(IllegalArgumentException.class, () -> nets.stopClockWhile("Gripper"));
        assertThrows(IllegalArgumentException.class, () -> nets.stopClockWhile("Piece"));
    }

    @Test
    void anInputThatIsOnFromTheBeginningHasNoEdge() {
        bind(bound());
        machine.signal("Piece at stop").setBoolean(true);
        assertEquals(0, scan());
        assertEquals("{waiting}", nets.coordinator("gripper").marking().toString());
    }

    @Test
    void aStaleLineFiresNothing() {
        nets = NetController.of(plc, BoundNet.of(gripper()).when("grip").off("Piece at stop").when("held").on("Gripper closed"));
        assertEquals(0, nets.scan(1));
        assertEquals(1, nets.staleScans());
        machine.receive(0);
        assertEquals(1, scan(), "it fires as soon as the machine sends");
    }

    @Test
    void entryExitAndFiringActionsKeepWhatTheySet() {
        bind(BoundNet.of(gripper()).when("grip").on("Piece at stop").when("held").on("Gripper closed")
            .when("release").off("Piece at stop")
            .entry("gripping").set("Gripper").exit("holding").clear("Gripper")
            .firing("held").set("Brake").run((in, out) -> out.set("Pieces", out.get("Pieces") + in.get("Weight")))
            .entry("waiting").clear("Brake").writes("Pieces"));
        machine.signal("Weight").set(7);
        machine.signal("Piece at stop").setBoolean(true);
        scan();
        machine.signal("Gripper closed").setBoolean(true);
        scan();
        assertTrue(out("Gripper") && out("Brake"));
        assertEquals(7, machine.signal("Pieces").get());
        machine.signal("Piece at stop").setBoolean(false);
        scan();
        assertFalse(out("Gripper") || out("Brake"));
        assertEquals(7, machine.signal("Pieces").get());
    }

    @Test
    void whatThrowsStopsItsNetAloneWithFailSafeOutputs() {
        PetriNet lamp = PetriNet.named("lamp").place("off", 1).place("on").transition("light").input("off").output("on").build();
        bind(BoundNet.of(gripper()).when("held").that(in -> in.get("Waight") > 3).during("gripping").set("Gripper")
                .during("holding").set("Brake"),
            BoundNet.of(lamp).when("light").on("Gripper closed").during("on").set("Pieces", 3));
        scan();
        machine.signal("Gripper closed").setBoolean(true);
        scan();
        Stop stop = nets.stops().get(0);
        assertEquals("condition of transition held", stop.element());
        assertTrue(stop.message().contains("there is no input 'Waight'"), stop.message());
        assertFalse(out("Gripper"));
        assertTrue(out("Brake"), "its fail-safe value");
        assertTrue(nets.stopped());
        assertEquals(3, machine.signal("Pieces").get(), "the other net continues");
        assertEquals(1, nets.stops().size());
    }

    @Test
    void anActionThatSetsWhatItDoesNotOwnStopsItsNet() {
        bind(BoundNet.of(gripper()).entry("gripping").run((in, out) -> out.set("Brake", 1)).during("holding").set("Gripper"));
        scan();
        assertEquals("entry action of place gripping", nets.stops().get(0).element());
    }

    private BoundNet[] handshake() {
        PetriNet asks = PetriNet.named("cell").place("rest", 1).place("asks")
            .transition("ask").input("rest").output("asks").transition("thank").input("asks").output("rest").build();
        PetriNet works = PetriNet.named("station").place("idle", 1).place("works").place("done")
            .transition("begin").input("idle").output("works").transition("end").input("works").output("done")
            .transition("again").input("done").output("idle").build();
        return new BoundNet[] {
            BoundNet.of(asks).when("ask").marked("station", "idle").when("thank").marked("station", "done"),
            BoundNet.of(works).when("begin").marked("cell", "asks").when("end").on("Piece at stop")
                .when("again").unmarked("cell", "asks")};
    }

    @Test
    void netsWaitForEachOthersPlacesAndTheirCompositionSaysWhatTheyCanDo() {
        BoundNet[] both = handshake();
        PetriNet whole = Composition.of("whole", both);
        Reachability graph = Reachability.explore(whole, 1000);
        assertEquals(Verdict.YES, graph.isDeadlockFree());
        assertEquals(5, graph.size());
        bind(both);
        machine.signal("Piece at stop").setBoolean(true);
        int[] tokens = new int[5];
        for (int i = 0; i < 20; i++) {
            scan();
            System.arraycopy(nets.coordinator("cell").marking().toArray(), 0, tokens, 0, 2);
            System.arraycopy(nets.coordinator("station").marking().toArray(), 0, tokens, 2, 3);
            assertTrue(graph.find(whole.marking(tokens)) >= 0, "the nets left the markings of their composition");
        }
        assertEquals(List.of(), nets.stops());
    }

    @Test
    void aCompositionFindsTheDeadlockThatNoNetHasAlone() {
        BoundNet[] both = handshake();
        both[1] = BoundNet.of(both[1].net()).when("begin").marked("cell", "asks").when("again").unmarked("cell", "rest");
        Reachability graph = Reachability.explore(Composition.of("whole", both), 1000);
        assertEquals(List.of("cell.ask", "station.begin", "station.end", "cell.thank"), graph.deadlock().orElseThrow().firings());
    }

    @Test
    void allMistakesAreNamedAtOnce() {
        PetriNet other = PetriNet.named("other").place("p", 1).transition("t").input("p").build();
        BindingException wrong = assertThrows(BindingException.class, () -> NetController.of(plc,
            BoundNet.of(gripper()).when("grip").on("Piece at stopp").when("held").on("Brake").when("held").on("Weight")
                .when("release").marked("othr", "p").when("lift").marked("other", "q")
                .during("holding").set("Gripper").exit("holding").clear("Gripper").entry("standing").set("Weight")
                .during("gripping").set("Pieces", Double.NaN),
            BoundNet.of(other).rising().when("t").rising().marked("other", "p").firing("t").set("Gripper").writes("Wait")));
        for (String expected : List.of(
                "net gripper: transition held: its condition is bound twice; put all of it behind one when(...)",
                "net gripper: transition grip: driver 'Gripper' has no signal 'Piece at stopp'; did you mean 'Piece at stop'?",
                "net gripper: transition held: signal 'Brake' at %QX0.1 is an output; a condition looks at what this end reads",
                "net gripper: transition release: there is no net 'othr'; there are [gripper, other]",
                "net gripper: there is no transition 'lift'; there are [grip, held, release]",
                "net other: there is no place 'q'; there are [p]",
                "net gripper: there is no place 'standing'; there are [gripping, holding, waiting]",
                "net gripper: entry of place standing: signal 'Weight' at %IW2 is an input; an action sets what this end writes",
                "net gripper: output 'Gripper' is set during a place and also by an entry, an exit, a firing or code of your own; "
                    + "do it in one way",
                "net gripper: place gripping: output 'Pieces' is set to NaN; a finite number is needed",
                "net other: rising() belongs to no signal; write it behind on(...)",
                "net other: transition t: place p is of this net; draw a test or an inhibitor arc, or say for how long by atLeast(...)",
                "output 'Gripper' is written by the nets gripper and other; let one write it, and the other tell that one by a place")) {
            assertTrue(wrong.mistakes().contains(expected), expected + " in\n" + wrong.getMessage());
        }
        assertTrue(wrong.mistakes().stream().anyMatch(text -> text.startsWith("net other: writes: driver 'Gripper' has no signal 'Wait'")));
        assertEquals(15, wrong.mistakes().size(), wrong.getMessage());
    }

    @Test
    void anOutputThatAPlaceHoldsAndCodeSetsIsRefused() {
        BindingException wrong = assertThrows(BindingException.class, () -> NetController.of(plc,
            BoundNet.of(gripper()).during("holding").set("Gripper").firing("grip").run((in, out) -> { }).writes("Gripper")));
        assertEquals(List.of("net gripper: output 'Gripper' is set during a place and also by an entry, an exit, a firing or code "
            + "of your own; do it in one way"), wrong.mistakes());
    }

    @Test
    void inRealTimeItAsksOnceBeforeEachScanAndItsTimeGoesOnWithTheNextRun() {
        nets = NetController.of(plc, bound());
        int[] asked = new int[1];
        for (int run = 1; run <= 2; run++) {
            long end = 5L * run;
            nets.run(2_000_000, () -> {
                asked[0]++;
                machine.exchange(asked[0]);
                return nets.scans() < end;
            });
            assertEquals(end, nets.scans());
            assertEquals(end + run, asked[0], "once for each scan, and once for the end of each run");
        }
    }

    @Test
    void theMachinesEndAndADriverThatHasTickedAreRefused() {
        assertTrue(assertThrows(BindingException.class, () -> NetController.of(machine, BoundNet.of(gripper()))).getMessage()
            .contains("nets need role = \"controller\" in [fieldbus]"));
        plc.receive(0);
        assertTrue(assertThrows(BindingException.class, () -> NetController.of(plc, BoundNet.of(gripper()))).getMessage()
            .contains("has ticked already"));
    }

    @Test
    void steadyScansMakeNoGarbage() {
        assumeTrue(ManagementFactory.getThreadMXBean() instanceof ThreadMXBean, "this JVM counts no allocations");
        ThreadMXBean threads = (ThreadMXBean) ManagementFactory.getThreadMXBean();
        BoundNet[] both = handshake();
        both[1].firing("end").run((in, out) -> out.set(0, in.get(2))).writes("Pieces").during("works").set("Gripper");
        both[0].during("asks").set("Brake");
        bind(both);
        machine.signal("Piece at stop").setBoolean(true);
        long allocated = Long.MAX_VALUE;
        int fired = 0;
        // The JVM itself allocates a little as it compiles; a scan that allocates would do so in every round.
        for (int round = 0; round < 5; round++) {
            long before = threads.getCurrentThreadAllocatedBytes();
            for (int i = 0; i < 20_000; i++) {
                fired += scan();
            }
            allocated = Math.min(allocated, threads.getCurrentThreadAllocatedBytes() - before);
        }
        assertEquals(0, allocated, fired + " firings");
        assertTrue(fired > 100_000, fired + " firings");
        // The hook for the end of the JVM allocates once in a run of 20,000 scans.
        long run = allocatedByRun(threads);
        assertTrue(run < 10_000, run + " bytes");
    }

    private long allocatedByRun(ThreadMXBean threads) {
        long[] end = new long[1];
        BooleanSupplier more = () -> {
            machine.send();
            nanos += 1_000_000;
            machine.receive(nanos);
            return !nets.stopped() && nets.scans() < end[0];
        };
        long allocated = Long.MAX_VALUE;
        for (int round = 0; round < 5; round++) {
            end[0] = nets.scans() + 20_000;
            long before = threads.getCurrentThreadAllocatedBytes();
            nets.run(1, more);
            allocated = Math.min(allocated, threads.getCurrentThreadAllocatedBytes() - before);
        }
        return allocated;
    }

    private static BoundNet timed() {
        PetriNet watch = PetriNet.named("watch").place("quiet", 1).place("slow")
            .transition("too long").input("quiet").output("slow").build();
        return BoundNet.of(watch).when("too long").marked("gripper", "gripping").atLeast(Duration.ofMillis(3)).during("slow").set("Pieces", 7);
    }

    @Test
    void aTransitionWaitsUntilAPlaceHasBeenMarkedForATime() {
        BoundNet own = BoundNet.of(gripper()).when("grip").on("Piece at stop")
            .when("held").marked("gripping").atLeast(Duration.ofMillis(5)).when("release").off("Piece at stop");
        // The watch is scanned first, and sees the gripper as of the scan before.
        bind(timed(), own);
        machine.signal("Piece at stop").set(1);
        assertEquals(1, scan());
        for (int i = 1; i < 3; i++) {
            assertEquals(0, scan());
        }
        assertEquals(1, scan());
        assertEquals(7, machine.signal("Pieces").get());
        assertEquals(0, scan());
        assertEquals(1, scan());
        assertEquals("{holding}", nets.coordinator("gripper").marking().toString());
        List<Conjunction.Part> parts = ((Conjunction) nets.coordinator("gripper").condition(1)).parts();
        assertEquals("gripper: gripping marked for 0.005 s", parts.get(0).text());
    }

    @Test
    void theTimeOfANetThatIsScannedLaterBeginsWithItsFirstScan() {
        BoundNet first = BoundNet.of(PetriNet.named("first").place("a", 1).place("b").transition("t").input("a").output("b").build())
            .when("t").marked("gripper", "waiting").atLeast(Duration.ofMillis(2));
        bind(first, BoundNet.of(gripper()).when("grip").on("Piece at stop"));
        nanos = 1_000_000_000;
        assertEquals(0, scan());
        assertEquals(0, scan());
        assertEquals(1, scan());
    }

    @Test
    void aMarkedTimeBelongsToAPlaceAndIsATestArcForTheAnalysis() {
        BindingException wrong = assertThrows(BindingException.class, () -> NetController.of(plc, BoundNet.of(gripper())
            .when("grip").atLeast(Duration.ofMillis(1)).marked("waiting").when("held").marked("gripping").atLeast(Duration.ZERO)));
        assertTrue(wrong.getMessage().contains("atLeast(PT0.001S) belongs to no place; write it behind marked(...)"), wrong.getMessage());
        assertTrue(wrong.getMessage().contains("place waiting is of this net; draw a test or an inhibitor arc, or say for how long by "
            + "atLeast(...)"), wrong.getMessage());
        assertTrue(wrong.getMessage().contains("place gripping marked for at least PT0S; expected more than 0"), wrong.getMessage());
        BoundNet own = BoundNet.of(gripper()).when("held").marked("gripping").atLeast(Duration.ofMillis(5))
            .when("grip").marked("holding").atLeast(Duration.ofMillis(5));
        PetriNet whole = Composition.of("all", own, timed());
        assertEquals(1, whole.arcs().stream().filter(arc -> arc.kind() == ArcKind.TEST
            && arc.place() == whole.place("gripper.gripping").index()).count());
        assertEquals(1, whole.arcs().stream().filter(arc -> arc.kind() == ArcKind.TEST
            && arc.place() == whole.place("gripper.holding").index()).count());
    }

    @Test
    void exactDelaysFollowEachOtherBetweenScans() {
        PetriNet chain = PetriNet.named("chain").place("a", 1).place("b").place("c")
            .transition("t").delay(500_000).input("a").output("b").transition("u").delay(400_000).input("b").output("c").build();
        bind(BoundNet.of(chain).exactDelays());
        scan();
        assertEquals(2, scan());
    }
}
