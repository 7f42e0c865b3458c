package tickbus.petri.run;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.ArrayList;
import java.util.List;
import org.junit.jupiter.api.Test;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.TransitionStep;

/** {@link CoordinatorBuilder#exactDelays}. */
class ExactDelaysTest {
    private static List<String> firings(PetriNet net, boolean exact, int scans, long period, List<Integer> markings) {
        List<String> fired = new ArrayList<>();
        CoordinatorBuilder builder = Coordinator.of(net).seed(5).limit(60)
            .listener((scan, nanos, t, choices) -> fired.add(net.transition(t).name()));
        Coordinator coordinator = (exact ? builder.exactDelays() : builder).build();
        for (int i = 0; i <= scans; i++) {
            coordinator.scan(i * period);
            if (coordinator.stop().isPresent()) {
                return List.of("livelock");
            }
            if (i * period % 60 == 0) {
                markings.add(fired.size());
            }
        }
        return fired;
    }

    private static PetriNet net(Draws random) {
        NetBuilder builder = PetriNet.named("random");
        int places = 3 + random.below(4);
        for (int p = 0; p < places; p++) {
            builder.place("p" + p, random.below(3)).delay(random.below(2) * (1 + random.below(50)));
        }
        for (int t = 0; t < 5; t++) {
            // Each takes a token: one that only puts tokens would never rest.
            TransitionStep made = builder.transition("t" + t).input("p" + random.below(places)).priority(random.below(2))
                .delay(Delay.fixed(random.below(3) * (1 + random.below(40))));
            for (int i = random.below(3); i >= 0; i--) {
                String place = "p" + (places * t + i) % places;
                switch (random.below(4)) {
                    case 0 -> made.test(place, 1);
                    case 1 -> made.inhibitor(place, 1 + random.below(3));
                    default -> made.output(place, 1);
                }
            }
        }
        return builder.build();
    }

    @Test
    void lateScansFireWhatAScanInEachNanosecondWouldFire() {
        int compared = 0;
        int firings = 0;
        for (long seed = 0; compared < 300; seed++) {
            PetriNet net = net(new Draws(seed));
            List<Integer> expected = new ArrayList<>();
            List<String> each = firings(net, false, 600, 1, expected);
            if (each.isEmpty() || each.contains("livelock")) {
                continue;
            }
            List<Integer> counts = new ArrayList<>();
            assertEquals(each, firings(net, true, 10, 60, counts), "seed " + seed);
            assertEquals(expected, counts, "seed " + seed);
            compared++;
            firings += each.size();
        }
        assertTrue(firings > 3000, firings + " firings");
    }

    /** A chain of two delays of 100 ns, scanned at 250 ns. */
    private static int chain(boolean exact, boolean withCondition) {
        PetriNet net = PetriNet.named("chain").place("a", 1).place("b").place("c")
            .transition("t").delay(100).input("a").output("b").transition("u").delay(100).input("b").output("c").build();
        CoordinatorBuilder builder = Coordinator.of(net);
        if (withCondition) {
            builder.when("t", in -> true);
        }
        Coordinator coordinator = (exact ? builder.exactDelays() : builder).build();
        coordinator.scan(0);
        coordinator.scan(250);
        return coordinator.marking().get("c");
    }

    @Test
    void aChainOfDelaysEndsAtItsTime() {
        assertEquals(1, chain(true, false));
        assertEquals(0, chain(false, false));
        // What needs an input happens at the scan.
        assertEquals(0, chain(true, true));
    }

    @Test
    void whatIsDueFirstFiresFirstWhateverThePriority() {
        PetriNet net = PetriNet.named("conflict").place("p", 1).place("slow").place("quick")
            .transition("s").priority(9).delay(200).input("p").output("slow")
            .transition("q").delay(100).input("p").output("quick").build();
        Coordinator coordinator = Coordinator.of(net).exactDelays().build();
        coordinator.scan(0);
        coordinator.scan(300);
        assertEquals(1, coordinator.marking().get("quick"));
    }

    @Test
    void aSensorWinsOverItsTimeOut() {
        PetriNet net = PetriNet.named("move").place("moves", 1).place("there").place("late")
            .transition("arrives").input("moves").output("there").transition("gives up").delay(100).input("moves").output("late").build();
        double[] sensor = {0};
        Coordinator coordinator = Coordinator.of(net).exactDelays().inputs("sensor").reader(values -> values[0] = sensor[0])
            .when("arrives", in -> in.isOn(0)).build();
        coordinator.scan(0);
        sensor[0] = 1;
        coordinator.scan(300);
        assertEquals(1, coordinator.marking().get("there"));
    }

    @Test
    void tokensOfAnInputAndOfATimeKeepTheirOwnDelays() {
        PetriNet net = PetriNet.named("two").place("a", 1).place("b", 1).place("q").delay(100).place("r")
            .transition("input").input("a").output("q").transition("time").delay(200).input("b").output("q")
            .transition("out").input("q").output("r").build();
        double[] input = {0};
        Coordinator coordinator = Coordinator.of(net).exactDelays().inputs("x").reader(values -> values[0] = input[0])
            .when("input", in -> in.isOn(0)).build();
        coordinator.scan(0);
        input[0] = 1;
        // Puts a token by the input at 250, and then one by the time, as of 200.
        coordinator.scan(250);
        assertEquals(300, coordinator.nextDue());
        coordinator.scan(300);
        assertEquals(1, coordinator.marking().get("r"));
        assertEquals(350, coordinator.nextDue());
        coordinator.scan(350);
        assertEquals(2, coordinator.marking().get("r"));
    }

    @Test
    void theLimitCountsForEachMoment() {
        PetriNet clock = PetriNet.named("clock").place("p", 1).transition("tick").delay(10).input("p").output("p").build();
        Coordinator coordinator = Coordinator.of(clock).exactDelays().limit(3).build();
        coordinator.scan(0);
        assertEquals(100, coordinator.scan(1000));
        assertFalse(coordinator.stop().isPresent());
        Coordinator circle = Coordinator.of(PetriNet.named("circle").place("p", 1).transition("t").input("p").output("p").build())
            .exactDelays().limit(3).build();
        circle.scan(0);
        assertEquals(Stop.Cause.LIVELOCK, circle.stop().orElseThrow().cause());
    }
}
