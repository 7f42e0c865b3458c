package tickbus.petri.run;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertNotEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.atomic.AtomicInteger;
import org.junit.jupiter.api.Test;
import tickbus.petri.RandomNets;
import tickbus.petri.Samples;
import tickbus.petri.net.Delay;
import tickbus.petri.net.Marking;
import tickbus.petri.net.PetriNet;

class CoordinatorTest {
    private final List<String> heard = new ArrayList<>();

    private Action hear(String what) {
        return (in, out) -> heard.add(what);
    }

    private FiringListener names(PetriNet net) {
        return (scan, nanos, t, choices) -> heard.add(net.transition(t).name());
    }

    private static PetriNet choice() {
        return PetriNet.named("choice").place("p", 1).place("q")
            .transition("a").input("p").output("q").priority(5).transition("b").input("p").output("q")
            .transition("back").input("q").output("p").build();
    }

    @Test
    void aFalseConditionOfGreatPriorityStarvesNobody() {
        PetriNet net = choice();
        Coordinator coordinator = Coordinator.of(net).inputs("go").when("a", in -> in.isOn("go")).when("back", in -> false)
            .listener(names(net)).build();
        assertEquals(1, coordinator.scan(0));
        assertEquals(List.of("b"), heard);
    }

    @Test
    void theGreatestPriorityFiresFirst() {
        PetriNet net = choice();
        Coordinator.of(net).when("back", in -> false).listener(names(net)).build().scan(0);
        assertEquals(List.of("a"), heard);
    }

    @Test
    void aScanFiresUntilTheNetComesToRest() {
        PetriNet net = PetriNet.named("chain").place("p0", 1).place("p1").place("p2").place("p3")
            .transition("t0").input("p0").output("p1").transition("t1").input("p1").output("p2")
            .transition("t2").input("p2").output("p3").build();
        Coordinator coordinator = Coordinator.of(net).build();
        assertEquals(3, coordinator.scan(0));
        assertEquals("{p3}", coordinator.marking().toString());
        assertEquals(0, coordinator.scan(1));
    }

    @Test
    void inputsAreReadOnceAndConditionsTestedOnceInAScan() {
        AtomicInteger reads = new AtomicInteger();
        AtomicInteger tests = new AtomicInteger();
        PetriNet net = choice();
        Coordinator coordinator = Coordinator.of(net).inputs("x").reader(values -> values[0] = reads.incrementAndGet())
            .when("a", in -> tests.incrementAndGet() > 0 && in.get("x") == 1).when("b", in -> false)
            .when("back", in -> in.get("x") == 1).limit(7).build();
        coordinator.scan(0);
        assertEquals(Stop.Cause.LIVELOCK, coordinator.stop().orElseThrow().cause(), "a and back fired seven times");
        assertEquals(1, reads.get());
        assertEquals(1, tests.get());
    }

    @Test
    void actionsRunInTheirOrderAndContinuousOnesWithTheFinalMarking() {
        Coordinator coordinator = Coordinator.of(choice()).when("b", in -> false).inputs("back")
            .reader(values -> values[0] = heard.isEmpty() ? 0 : 1).when("back", in -> in.isOn("back")).limit(1)
            .onEntry("p", hear("enter p")).onExit("p", hear("leave p")).onFiring("a", hear("fire a"))
            .onEntry("q", hear("enter q")).onExit("q", hear("leave q")).during("p", hear("in p")).during("q", hear("in q"))
            .writer(values -> heard.add("write")).build();
        coordinator.scan(0);
        assertEquals(List.of("enter p", "leave p", "fire a", "enter q", "in q", "write"), heard);
        heard.clear();
        coordinator.scan(1);
        assertEquals(List.of("in q", "write"), heard);
    }

    @Test
    void theSameSeedGivesTheSameLogAndAnotherSeedAnother() {
        assertEquals(log(1, 300), log(1, 300));
        assertNotEquals(log(1, 300), log(2, 300));
        assertTrue(log(1, 300).contains(" 1 of "), log(1, 300));
    }

    private static String log(long seed, int scans) {
        PetriNet net = Samples.philosophers(5);
        FiringLog log = new FiringLog(net, 10_000);
        CoordinatorBuilder builder = Coordinator.of(net).seed(seed).inputs("even").listener(log);
        long[] scan = {0};
        builder.reader(values -> values[0] = scan[0]++ % 2);
        for (int i = 0; i < 5; i++) {
            builder.when("start" + i, in -> in.isOn(0)).when("end" + i, in -> !in.isOn(0));
        }
        Coordinator coordinator = builder.build();
        for (int i = 0; i < scans; i++) {
            coordinator.scan(i * 1_000_000L);
        }
        return log.toString();
    }

    @Test
    void chanceIsOnlyAskedInAConflict() {
        PetriNet net = PetriNet.named("apart").place("a", 3).place("b", 3).place("c", 1)
            .transition("ta").input("a").transition("tb").input("b").transition("c0").input("c").transition("c1").input("c")
            .build();
        FiringLog log = new FiringLog(net, 10);
        Coordinator.of(net).listener(log).build().scan(9);
        assertTrue(log.toString().startsWith("1 9 ta\n1 9 ta\n1 9 ta\n1 9 tb\n1 9 tb\n1 9 tb\n1 9 c"), log.toString());
        assertTrue(log.toString().endsWith(" 1 of 2\n"), log.toString());
        assertEquals(7, log.total());
    }

    @Test
    void everyOneOfAConflictIsChosenAboutAsOften() {
        PetriNet net = PetriNet.named("fair").place("p", 3000)
            .transition("a").input("p").transition("b").input("p").transition("c").input("p").build();
        int[] count = new int[3];
        Coordinator.of(net).seed(3).listener((scan, nanos, t, choices) -> count[t]++).build().scan(0);
        for (int one : count) {
            assertTrue(one > 900 && one < 1100, count[0] + " " + count[1] + " " + count[2]);
        }
    }

    @Test
    void aNetThatDoesNotComeToRestStopsAndSaysWhichTransitionsFire() {
        double[] written = new double[1];
        Coordinator coordinator = Coordinator.of(choice()).limit(100).output("motor", 0)
            .onEntry("p", (in, out) -> out.set("motor", true)).writer(values -> written[0] = values[0]).build();
        coordinator.scan(5);
        Stop stop = coordinator.stop().orElseThrow();
        assertEquals(Stop.Cause.LIVELOCK, stop.cause());
        assertTrue(stop.message().startsWith("net choice, scan 1: 100 firings in one scan"), stop.message());
        assertTrue(stop.message().contains("[a, back]"), stop.message());
        assertEquals(0, written[0]);
        assertEquals(0, coordinator.scan(6));
    }

    @Test
    void whateverThrowsStopsTheControllerInItsFailSafeOutputsAndIsNamed() {
        Condition bad = in -> {
            throw new IllegalStateException("sensor");
        };
        Action badly = (in, out) -> {
            throw new IllegalStateException("valve");
        };
        stopsAt("condition of transition a", Coordinator.of(choice()).when("a", bad));
        stopsAt("firing of transition a", Coordinator.of(choice()).onFiring("a", badly));
        stopsAt("entry action of place q", Coordinator.of(choice()).onEntry("q", badly));
        stopsAt("exit action of place p", Coordinator.of(choice()).onExit("p", badly));
        stopsAt("continuous action of place q", Coordinator.of(choice()).when("back", in -> false).during("q", badly));
        stopsAt("reader of the inputs", Coordinator.of(choice()).reader(values -> values[0] = 1));
        // The next transition's condition has been tested already when the listener is called.
        stopsAt("firing of transition a", Coordinator.of(choice()).when("a", in -> true).when("back", in -> false)
            .listener((scan, nanos, transition, choices) -> {
                throw new IllegalStateException("log");
            }));
    }

    private static void stopsAt(String element, CoordinatorBuilder builder) {
        List<double[]> written = new ArrayList<>();
        Coordinator coordinator = builder.output("gate", 0.5).onEntry("p", (in, out) -> out.set("gate", 7))
            .writer(values -> written.add(values.clone())).build();
        assertEquals(0, coordinator.scan(0));
        Stop stop = coordinator.stop().orElseThrow();
        assertEquals(Stop.Cause.THROWN, stop.cause());
        assertEquals(element, stop.element());
        assertTrue(stop.message().contains(element + " threw java.lang."), stop.message());
        coordinator.scan(1);
        assertEquals(1, written.size(), "the fail-safe values are written once");
        assertArrayEquals(new double[] {0.5}, written.get(0));
    }

    @Test
    void aWriterThatThrowsStopsTheControllerToo() {
        for (Throwable thrown : List.of(new IllegalStateException("bus"), new AssertionError("bus"))) {
            Coordinator coordinator = Coordinator.of(choice()).when("back", in -> false).writer(values -> {
                CoordinatorTest.<RuntimeException>raise(thrown);
            }).build();
            coordinator.scan(0);
            Stop stop = coordinator.stop().orElseThrow();
            assertEquals("writer of the outputs", stop.element());
            assertTrue(stop.message().contains("could not be written either"), stop.message());
        }
    }

    @SuppressWarnings("unchecked")
    private static <T extends Throwable> void raise(Throwable thrown) throws T {
        throw (T) thrown;
    }

    @Test
    void beforeTheFirstScanTheMarkingIsTheInitialOne() {
        Coordinator coordinator = Coordinator.of(choice()).build();
        assertEquals("{p}", coordinator.marking().toString());
        assertEquals(1, coordinator.tokens(0));
    }

    @Test
    void aTimedTransitionFiresWhenItHasBeenEnabledLongEnoughWithoutABreak() {
        PetriNet net = PetriNet.named("timed").place("p", 1).place("stop")
            .transition("t").input("p").inhibitor("stop", 1).delay(Delay.fixed(100))
            .transition("on").output("stop").inhibitor("stop", 1).transition("off").input("stop").build();
        boolean[] pressed = {false};
        Coordinator coordinator = Coordinator.of(net).inputs("pressed").reader(values -> values[0] = pressed[0] ? 1 : 0)
            .when("on", in -> in.isOn(0)).when("off", in -> !in.isOn(0)).build();
        assertEquals(0, coordinator.scan(1000));
        assertEquals(1100, coordinator.nextDue());
        assertEquals(0, coordinator.scan(1099));
        pressed[0] = true;
        assertEquals(0, coordinator.scan(1099) - 1, "only on fires");
        assertEquals(Long.MAX_VALUE, coordinator.nextDue());
        pressed[0] = false;
        assertEquals(1, coordinator.scan(1150), "only off fires: the delay restarts");
        assertEquals(1250, coordinator.nextDue());
        assertEquals(0, coordinator.scan(1249));
        assertEquals(1, coordinator.scan(1250));
    }

    @Test
    void aClockThatGoesBackStopsTheControllerWithItsOutputsFailSafe() {
        double[] motor = {-1};
        Coordinator coordinator = Coordinator.of(PetriNet.named("n").place("p", 1).build()).output("motor", 0)
            .writer(values -> motor[0] = values[0]).during("p", (in, out) -> out.set("motor", 1)).build();
        coordinator.scan(1250);
        assertEquals(1, motor[0]);
        assertEquals(0, coordinator.scan(1249));
        assertEquals(0, motor[0]);
        Stop stop = coordinator.stop().orElseThrow();
        assertEquals("clock", stop.element());
        assertTrue(stop.message().contains("a scan at 1249 ns after one at 1250; expected a time that does not go back"), stop.message());
        assertEquals(0, coordinator.scan(1300));
        assertEquals(0, motor[0]);
    }

    @Test
    void aTimedTransitionWaitsAnewAfterEachFiring() {
        PetriNet net = PetriNet.named("clock").place("p", 3).transition("t").input("p").delay(Delay.fixed(10)).build();
        Coordinator coordinator = Coordinator.of(net).build();
        int[] fired = new int[35];
        for (int now = 0; now < fired.length; now++) {
            fired[now] = coordinator.scan(now);
        }
        for (int now = 0; now < fired.length; now++) {
            assertEquals(now > 0 && now % 10 == 0 ? 1 : 0, fired[now], "at " + now);
        }
    }

    @Test
    void tokensInATimedPlaceAreUnavailableUntilTheyAreOldEnough() {
        PetriNet net = PetriNet.named("belt").place("feed", 2).place("belt").delay(50)
            .transition("in").input("feed").output("belt").transition("out").input("belt").build();
        int[] limit = {1};
        Coordinator coordinator = Coordinator.of(net).inputs("open").reader(values -> values[0] = limit[0])
            .when("in", in -> in.isOn(0)).build();
        limit[0] = 1;
        assertEquals(2, coordinator.scan(0));
        assertEquals(50, coordinator.nextDue());
        assertEquals(0, coordinator.scan(49));
        assertEquals(2, coordinator.marking().get("belt"), "the tokens are there");
        assertEquals(2, coordinator.scan(50));
        assertEquals(Long.MAX_VALUE, coordinator.nextDue());
    }

    @Test
    void randomDelaysStayInTheirBoundsAndComeFromTheSeed() {
        SplitMix random = new SplitMix(5);
        long least = Long.MAX_VALUE;
        long greatest = 0;
        double sum = 0;
        for (int i = 0; i < 20_000; i++) {
            long drawn = random.draw(Delay.uniform(10, 20));
            least = Math.min(least, drawn);
            greatest = Math.max(greatest, drawn);
            sum += random.draw(Delay.exponential(1000));
        }
        assertEquals(10, least);
        assertEquals(20, greatest);
        assertEquals(1000, sum / 20_000, 30);
        assertThrows(IllegalArgumentException.class, () -> Delay.uniform(5, 4));
        assertThrows(IllegalArgumentException.class, () -> Delay.fixed(-1));
    }

    @Test
    void whatIsBoundAfterBuildingIsNotBoundToThatCoordinator() {
        CoordinatorBuilder builder = Coordinator.of(choice()).when("back", in -> false);
        Coordinator coordinator = builder.build();
        builder.when("a", in -> false).when("b", in -> false);
        assertEquals(1, coordinator.scan(0));
        assertEquals(0, builder.build().scan(0));
    }

    @Test
    void anUnknownNameIsRefusedAtOnce() {
        assertThrows(IllegalArgumentException.class, () -> Coordinator.of(choice()).when("c", in -> true));
        assertThrows(IllegalArgumentException.class, () -> Coordinator.of(choice()).inputs("a", "a").build());
        Coordinator coordinator = Coordinator.of(choice()).inputs("a").when("a", in -> in.isOn("b")).build();
        coordinator.scan(0);
        assertTrue(coordinator.stop().orElseThrow().message().contains("there is no input 'b'; there are [a]"));
    }

    @Test
    void theRunningNetAgreesWithTheRulesOfTheNetAfterEachFiring() {
        Draws random = new Draws(77);
        for (int round = 0; round < 300; round++) {
            PetriNet net = RandomNets.any(random, 6, 6);
            Marking marking = net.initialMarking();
            Coordinator[] coordinator = {null};
            coordinator[0] = Coordinator.of(net).seed(round).limit(40).listener((scan, nanos, t, choices) -> {
                net.fire(marking, t);
                assertEquals(marking, coordinator[0].marking());
                for (int u = 0; u < net.transitions().size(); u++) {
                    assertEquals(net.isEnabled(marking, u), coordinator[0].enabling.enabled.contains(u), net + " " + marking);
                }
            }).build();
            coordinator[0].scan(0);
            coordinator[0].stop().ifPresent(stop -> assertEquals(Stop.Cause.LIVELOCK, stop.cause(), stop.message()));
        }
    }

    @Test
    void theCostOfAFiringDoesNotGrowWithTheNet() {
        long small = visitsOfRing(10);
        assertEquals(small, visitsOfRing(10_000));
        assertTrue(small <= 4 * 1000, small + " needs looked at in 1000 firings");
    }

    /** A token runs round a ring of transitions: one is enabled at a time. */
    private static long visitsOfRing(int size) {
        Coordinator coordinator = Coordinator.of(Samples.ring(size)).limit(1000).build();
        coordinator.scan(0);
        assertEquals(Stop.Cause.LIVELOCK, coordinator.stop().orElseThrow().cause());
        return coordinator.enabling.visits;
    }

    @Test
    void tokensAreThoseOfTheInitialMarkingUntilTheFirstScan() {
        Coordinator coordinator = Coordinator.of(PetriNet.named("n").place("a", 2).place("b")
            .transition("t").input("a").output("b").build()).build();
        assertEquals(2, coordinator.tokens(0));
        coordinator.scan(0);
        assertEquals(0, coordinator.tokens(0));
        assertEquals(2, coordinator.tokens(1));
    }
}
