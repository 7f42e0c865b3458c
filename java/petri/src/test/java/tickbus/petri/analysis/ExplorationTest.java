package tickbus.petri.analysis;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.time.Duration;
import java.util.ArrayList;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Set;
import java.util.stream.Collectors;
import org.junit.jupiter.api.Test;
import tickbus.petri.RandomNets;
import tickbus.petri.net.Marking;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Draws;

/** Explorations against a search that knows the rules of a firing alone, and their limits. */
class ExplorationTest {
    private static final int LIMIT = 500;

    /** Each marking with its distance from the initial one, breadth first; null beyond the limit. */
    private static Map<Marking, Integer> search(PetriNet net, List<String> firings) {
        Map<Marking, Integer> found = new LinkedHashMap<>(Map.of(net.initialMarking(), 0));
        List<Marking> open = new ArrayList<>(found.keySet());
        for (int i = 0; i < open.size(); i++) {
            for (int t = 0; t < net.transitions().size(); t++) {
                if (net.isEnabled(open.get(i), t)) {
                    Marking next = after(net, open.get(i), t);
                    if (found.putIfAbsent(next, found.get(open.get(i)) + 1) == null) {
                        open.add(next);
                        if (open.size() > LIMIT) {
                            return null;
                        }
                    }
                    firings.add(i + " " + t);
                }
            }
        }
        return found;
    }

    private static Marking after(PetriNet net, Marking marking, int... firings) {
        Marking next = net.marking(marking.toArray());
        for (int t : firings) {
            net.fire(next, t);
        }
        return next;
    }

    private static boolean isDead(PetriNet net, Marking marking) {
        return net.transitions().stream().noneMatch(one -> net.isEnabled(marking, one.index()));
    }

    private static Set<Marking> deadlocks(Reachability graph) {
        return graph.deadlocks().stream().map(graph::marking).collect(Collectors.toSet());
    }

    private static PetriNet net(Draws random, int round) {
        int places = 1 + random.below(8);
        int transitions = 1 + random.below(8);
        return round % 2 == 0 ? RandomNets.any(random, places, transitions) : RandomNets.plain(random, places, transitions);
    }

    @Test
    void markingsPathsAndDeadlocksAreThoseOfASearchByTheRules() {
        Draws random = new Draws(11);
        int complete = 0;
        for (int round = 0; round < 600; round++) {
            PetriNet net = net(random, round);
            List<String> firings = new ArrayList<>();
            Map<Marking, Integer> expected = search(net, firings);
            if (expected == null) {
                continue;
            }
            complete++;
            Reachability graph = Reachability.explore(net, LIMIT);
            Reachability markings = Exploration.of(net).markings(LIMIT).withoutFirings().run();
            assertEquals(expected.size(), graph.size(), net::toString);
            assertEquals(expected.size(), markings.size());
            assertEquals(firings.size(), graph.edges());
            assertEquals(firings.size(), markings.edges());
            List<Marking> order = new ArrayList<>(expected.keySet());
            for (int number = 0; number < order.size(); number++) {
                assertEquals(order.get(number), graph.marking(number));
                assertEquals(order.get(number), markings.marking(number));
                assertEquals(number, graph.find(order.get(number)));
                int[] path = graph.path(number);
                assertEquals(expected.get(order.get(number)), path.length);
                assertEquals(order.get(number), after(net, net.initialMarking(), path));
            }
            Set<Marking> dead = order.stream().filter(marking -> isDead(net, marking)).collect(Collectors.toSet());
            assertEquals(dead, deadlocks(graph));
            assertEquals(graph.deadlocks(), markings.deadlocks());
            for (int p = 0; p < net.places().size(); p++) {
                int place = p;
                int most = order.stream().mapToInt(marking -> marking.get(place)).max().orElseThrow();
                assertEquals(most, graph.bound(p));
                assertEquals(most, markings.bound(p));
            }
        }
        assertTrue(complete > 200, complete + " nets are bounded");
    }

    /** The deadlocks of nets with conflicts, weights, capacities, test and inhibitor arcs. */
    @Test
    void stubbornSetsFindExactlyTheDeadlocksOfAllMarkings() {
        Draws random = new Draws(12);
        int nets = 0;
        int withDeadlocks = 0;
        long all = 0;
        long few = 0;
        for (int round = 0; round < 4000; round++) {
            PetriNet net = net(random, round);
            Reachability graph = Exploration.of(net).markings(LIMIT).withoutFirings().run();
            if (!graph.isComplete()) {
                continue;
            }
            Reachability reduced = Exploration.of(net).markings(LIMIT).onlyForDeadlocks().run();
            assertTrue(reduced.isComplete());
            assertEquals(deadlocks(graph), deadlocks(reduced), net::toString);
            assertEquals(graph.isDeadlockFree(), reduced.isDeadlockFree());
            for (int number : reduced.deadlocks()) {
                assertEquals(reduced.marking(number), after(net, net.initialMarking(), reduced.path(number)));
            }
            nets++;
            withDeadlocks += graph.deadlocks().isEmpty() ? 0 : 1;
            all += graph.size();
            few += reduced.size();
        }
        assertTrue(nets > 1500 && withDeadlocks > 500 && withDeadlocks < nets - 100, nets + " nets, " + withDeadlocks + " with deadlocks");
        assertTrue(few < all, few + " of " + all + " markings");
    }

    private static PetriNet independent(int pairs) {
        NetBuilder net = PetriNet.named("independent");
        for (int i = 0; i < pairs; i++) {
            net.place("a" + i, 1).place("b" + i).transition("t" + i).input("a" + i).output("b" + i);
        }
        return net.build();
    }

    @Test
    void oneOrderOfIndependentFiringsIsEnoughForTheirDeadlock() {
        PetriNet net = independent(300);
        Reachability graph = Exploration.of(net).onlyForDeadlocks().run();
        assertEquals("net independent: 301 markings, 300 firings, as far as deadlocks need", graph.toString());
        assertEquals(300, graph.deadlock().orElseThrow().firings().size());
        assertEquals(Verdict.NO, graph.isDeadlockFree());
        assertEquals(Verdict.UNKNOWN, graph.isSafe());
        assertEquals(Verdict.UNKNOWN, graph.isBounded());
        assertEquals(Verdict.UNKNOWN, graph.isLive());
        assertEquals(Verdict.YES, graph.canFire(299));
        int[] last = new int[600];
        for (int i = 0; i < 300; i++) {
            last[2 * i + (i == 299 ? 1 : 0)] = 1;
        }
        assertEquals(Verdict.UNKNOWN, graph.isReachable(net.marking(last)), "t299 alone");
    }

    @Test
    void aLimitOfMemoryHoldsAndKeepsWhatWasFound() {
        long limit = 3_000_000;
        Reachability graph = Exploration.of(independent(40)).memory(limit).run();
        assertTrue(!graph.isComplete() && graph.bytes() <= limit && graph.bytes() > limit / 3, graph + ", " + graph.bytes());
        assertEquals("the limit of 3000000 bytes", graph.gaveUpBecause().orElseThrow());
        assertTrue(graph.size() > 10_000, graph.toString());
        assertEquals(Verdict.UNKNOWN, graph.isDeadlockFree());
        assertEquals(Verdict.YES, graph.canFire(39));
        Reachability lean = Exploration.of(independent(40)).memory(limit).withoutFirings().run();
        assertTrue(lean.size() > 3 * graph.size(), lean + " for " + graph);
    }

    @Test
    void aLimitOfTimeHolds() {
        long start = System.nanoTime();
        Reachability graph = Exploration.of(independent(60)).time(Duration.ofMillis(50)).withoutFirings().run();
        assertEquals("the limit of PT0.05S", graph.gaveUpBecause().orElseThrow());
        assertTrue(System.nanoTime() - start >= 50_000_000 && graph.size() > 1);
        assertThrows(IllegalArgumentException.class, () -> Exploration.of(independent(1)).time(Duration.ZERO));
        assertThrows(IllegalArgumentException.class, () -> Exploration.of(independent(1)).memory(0));
        assertThrows(IllegalArgumentException.class, () -> Exploration.of(independent(1)).markings(0));
    }

    @Test
    void withoutFiringsAMarkingOfSixtyPlacesTakesLessThanTwentyBytes() {
        NetBuilder machines = PetriNet.named("machines");
        for (int machine = 0; machine < 5; machine++) {
            for (int i = 0; i < 12; i++) {
                machines.place("m" + machine + "p" + i, i == 0 ? 1 : 0);
            }
            for (int i = 0; i < 12; i++) {
                machines.transition("m" + machine + "t" + i).input("m" + machine + "p" + i)
                    .output("m" + machine + "p" + (i + 1) % 12);
            }
        }
        Reachability graph = Exploration.of(machines.build()).withoutFirings().run();
        assertEquals(248_832, graph.size());
        assertTrue(graph.bytes() < 20L * graph.size(), graph.bytes() + " bytes");
        assertEquals(Verdict.YES, graph.isSafe());
        assertEquals(Verdict.UNKNOWN, graph.isLive());
        assertThrows(GaveUpException.class, graph::homeStates);
    }

    /** The sum of two places stays: one of them has no bits. Counts that grow pack all markings again. */
    @Test
    void markingsWithManyTokensAreFoundAgain() {
        PetriNet net = PetriNet.named("pour").place("jug", 70_000).place("cup").place("spill")
            .transition("pour").input("jug").output("cup").transition("drop").input("cup", 50_000).output("spill").build();
        Reachability graph = Reachability.explore(net, 200_000);
        assertEquals(70_001 + 20_001, graph.size());
        assertEquals(70_000, graph.bound(1));
        for (int cups = 0; cups <= 70_000; cups += 7) {
            assertEquals(Verdict.YES, graph.isReachable(net.marking(70_000 - cups, cups, 0)));
            assertEquals(Verdict.NO, graph.isReachable(net.marking(70_001 - cups, cups, 0)));
        }
        int last = graph.find(net.marking(0, 20_000, 1));
        assertArrayEquals(new int[] {0, 20_000, 1}, graph.marking(last).toArray());
    }

    /** Every transition depends on every other one, so the search for stubborn sets itself takes longer than the limit. */
    @Test
    void theLimitOfTimeHoldsWithinOneMarking() {
        NetBuilder builder = PetriNet.named("shared").place("shared", 2);
        for (int t = 0; t < 6000; t++) {
            builder.place("own " + t, 1).transition("t" + t).input("shared", "own " + t);
        }
        PetriNet net = builder.build();
        for (Exploration exploration : List.of(Exploration.of(net).onlyForDeadlocks(), Exploration.of(net).withoutFirings())) {
            long start = System.nanoTime();
            Reachability graph = exploration.time(Duration.ofMillis(100)).run();
            assertTrue(graph.gaveUpBecause().isPresent() || graph.isComplete());
            assertTrue(System.nanoTime() - start < 60_000_000_000L, "took " + (System.nanoTime() - start) + " ns");
            assertEquals(0, graph.deadlocks().size(), "a search that was cut off takes no marking for dead");
        }
    }
}
