package tickbus.petri.run;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.ArrayList;
import java.util.Comparator;
import java.util.List;
import java.util.Set;
import java.util.TreeMap;
import java.util.TreeSet;
import org.junit.jupiter.api.Test;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;

/** The order in which ready transitions fire. */
class ReadyTest {
    @Test
    void theOrderIsThatOfASearchThroughAll() {
        Draws random = new Draws(3);
        for (int round = 0; round < 200; round++) {
            int all = 1 + random.below(30);
            int[] priority = new int[all];
            int[] cluster = new int[all];
            for (int t = 0; t < all; t++) {
                priority[t] = random.below(3) - 1;
                cluster[t] = random.below(4) - 1;
            }
            Ready ready = new Ready(priority, cluster);
            TreeMap<Integer, Long> model = new TreeMap<>();
            for (int step = 0; step < 200; step++) {
                int t = random.below(all);
                if (random.below(3) > 0) {
                    long at = random.below(2) == 0 ? Ready.UNTIMED : random.below(4);
                    ready.add(t, at);
                    model.putIfAbsent(t, at);
                } else if (random.below(50) == 0) {
                    ready.clear();
                    model.clear();
                } else {
                    ready.remove(t);
                    model.remove(t);
                }
                assertEquals(model.size(), ready.size());
                if (!model.isEmpty()) {
                    assertEquals(expected(model, priority, cluster), choices(ready));
                }
            }
        }
    }

    /** All transitions contend for one place, half of them by a delay of their own: what a firing costs does not depend on them. */
    @Test
    void aClusterOfManyTransitionsCostsALogarithmForEachFiring() {
        assertEquals(10_000, fireCluster(10_000, 0));
        long small = timeOfCluster(5_000);
        long large = timeOfCluster(40_000);
        assertTrue(large < 30 * small, large + " ns for 40,000 transitions, " + small + " ns for 5,000");
    }

    private static long timeOfCluster(int size) {
        long best = Long.MAX_VALUE;
        for (int round = 0; round < 5; round++) {
            long start = System.nanoTime();
            fireCluster(size, round);
            best = Math.min(best, System.nanoTime() - start);
        }
        return best;
    }

    private static int fireCluster(int size, long seed) {
        NetBuilder builder = PetriNet.named("cluster").place("shared", size);
        for (int t = 0; t < size; t++) {
            builder.place("own " + t, 1);
            builder.transition("t" + t).delay(t % 2 == 0 ? 0 : t).input("shared", "own " + t);
        }
        Coordinator cluster = Coordinator.of(builder.build()).seed(seed).limit(size).build();
        return cluster.scan(0) + cluster.scan(size);
    }

    private static Set<Integer> choices(Ready ready) {
        Set<Integer> found = new TreeSet<>();
        int count = ready.choices();
        for (int i = 0; i < count; i++) {
            assertTrue(found.add(ready.choice(i)), "chosen from twice");
        }
        return found;
    }

    private static Set<Integer> expected(TreeMap<Integer, Long> model, int[] priority, int[] cluster) {
        int first = model.keySet().stream().min(Comparator.<Integer>comparingInt(t -> -priority[t])
            .thenComparingLong(model::get).thenComparingInt(t -> t)).orElseThrow();
        Set<Integer> found = new TreeSet<>(Set.of(first));
        model.forEach((t, at) -> {
            if (cluster[first] >= 0 && cluster[t] == cluster[first] && priority[t] == priority[first]
                    && at.equals(model.get(first))) {
                found.add(t);
            }
        });
        return found;
    }

    private static PetriNet race(int slowPriority) {
        return PetriNet.named("race").place("p", 1).place("slow wins").place("quick wins")
            .transition("slow").delay(200).priority(slowPriority).input("p").output("slow wins")
            .transition("quick").delay(100).input("p").output("quick wins").build();
    }

    @Test
    void whatIsDueFirstWinsInAScanThatComesLate() {
        for (int seed = 0; seed < 100; seed++) {
            Coordinator late = Coordinator.of(race(0)).seed(seed).build();
            late.scan(0);
            late.scan(300);
            assertEquals("{quick wins}", late.marking().toString(), "seed " + seed);
        }
        Coordinator late = Coordinator.of(race(1)).build();
        late.scan(0);
        late.scan(300);
        assertEquals("{slow wins}", late.marking().toString(), "the greater priority is asked first");
    }

    @Test
    void aSensorWinsOverATimeOutThatIsDueInTheSameScan() {
        PetriNet net = PetriNet.named("stroke").place("out", 1).place("there").place("late")
            .transition("time out").delay(100).input("out").output("late")
            .transition("arrive").input("out").output("there").build();
        for (int seed = 0; seed < 100; seed++) {
            double[] sensor = {0};
            Coordinator stroke = Coordinator.of(net).seed(seed).inputs("sensor").reader(values -> values[0] = sensor[0])
                .when("arrive", in -> in.isOn(0)).build();
            stroke.scan(0);
            sensor[0] = 1;
            stroke.scan(110);
            assertEquals("{there}", stroke.marking().toString(), "seed " + seed);
        }
    }

    @Test
    void tokensThatBecameOldEnoughFirstAreUsedFirst() {
        PetriNet net = PetriNet.named("tokens").place("late", 1).delay(200).place("early", 1).delay(100).place("one", 1)
            .place("by late").place("by early").transition("a").input("late", "one").output("by late")
            .transition("b").input("early", "one").output("by early").build();
        for (int seed = 0; seed < 100; seed++) {
            Coordinator both = Coordinator.of(net).seed(seed).build();
            both.scan(0);
            both.scan(300);
            assertEquals(1, both.marking().get("by early"), "seed " + seed);
        }
    }

    /** A delay begins with the scan in which the outputs change, so an output is on for at least as long. */
    @Test
    void aDelayBeginsWithTheScanThatMarkedItsPlace() {
        Coordinator chain = Coordinator.of(PetriNet.named("chain").place("p", 1).place("q").place("r")
            .transition("one").delay(100).input("p").output("q").transition("two").delay(100).input("q").output("r").build()).build();
        chain.scan(0);
        assertEquals(1, chain.scan(250));
        assertEquals(350, chain.nextDue());
    }

    private static PetriNet toggle() {
        return PetriNet.named("toggle").place("off", 1).place("on")
            .transition("switch on").input("off").output("on").transition("switch off").input("on").output("off").build();
    }

    @Test
    void anEdgeIsUsedByOneEvolution() {
        double[] edge = {0};
        Coordinator toggle = Coordinator.of(toggle()).inputs("edge").reader(values -> values[0] = edge[0])
            .whenEdge("switch on", in -> in.isOn(0)).whenEdge("switch off", in -> in.isOn(0)).build();
        toggle.scan(0);
        edge[0] = 1;
        for (int press = 1; press <= 4; press++) {
            assertEquals(1, toggle.scan(press));
            assertEquals(press % 2 == 1 ? "{on}" : "{off}", toggle.marking().toString());
        }
        edge[0] = 0;
        assertEquals(0, toggle.scan(9));
    }

    @Test
    void anEdgeFiresATransitionOnceHoweverManyTokensWait() {
        Coordinator queue = Coordinator.of(PetriNet.named("queue").place("waiting", 3).transition("next").input("waiting").build())
            .whenEdge("next", in -> true).build();
        assertEquals(1, queue.scan(0));
        assertEquals(1, queue.scan(1));
        assertEquals(1, queue.marking().get("waiting"));
    }

    @Test
    void aControllerGoesOnFromAMarkingOfAnEarlierRun() {
        PetriNet net = toggle();
        List<String> entered = new ArrayList<>();
        Coordinator toggle = Coordinator.of(net).when("switch on", in -> false).when("switch off", in -> false)
            .onEntry("off", (in, out) -> entered.add("off")).onEntry("on", (in, out) -> entered.add("on")).build();
        toggle.resume(net.marking(0, 1));
        assertEquals("{on}", toggle.marking().toString());
        assertEquals(1, toggle.tokens(1));
        toggle.scan(0);
        assertEquals("{on}", toggle.marking().toString());
        assertEquals(List.of("on"), entered);
        assertThrows(IllegalStateException.class, () -> toggle.resume(net.initialMarking()));
        assertThrows(IllegalArgumentException.class, () -> Coordinator.of(toggle()).build().resume(net.initialMarking()));
    }
}
