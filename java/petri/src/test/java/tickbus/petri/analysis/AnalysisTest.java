package tickbus.petri.analysis;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.Arrays;
import java.util.BitSet;
import java.util.List;
import java.util.Optional;
import java.util.Set;
import java.util.TreeSet;
import org.junit.jupiter.api.Test;
import tickbus.petri.RandomNets;
import tickbus.petri.Samples;
import tickbus.petri.net.Marking;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Draws;

class AnalysisTest {
    /** Each philosopher takes the left fork, then the right one. */
    private static PetriNet greedy(int count) {
        NetBuilder builder = PetriNet.named("greedy");
        for (int i = 0; i < count; i++) {
            builder.place("fork" + i, 1).place("thinks" + i, 1).place("holds" + i).place("eats" + i);
        }
        for (int i = 0; i < count; i++) {
            String other = "fork" + (i + 1) % count;
            builder.transition("left" + i).input("fork" + i, "thinks" + i).output("holds" + i);
            builder.transition("right" + i).input(other, "holds" + i).output("eats" + i);
            builder.transition("end" + i).input("eats" + i).output("fork" + i, other, "thinks" + i);
        }
        return builder.build();
    }

    @Test
    void theNetOfThePaperHasItsGoldenResults() {
        PetriNet net = Samples.paper();
        Reachability graph = Reachability.explore(net, 1000);
        assertEquals("net paper.txt: 5 markings, 6 firings", graph.toString());
        assertEquals(Verdict.YES, graph.isSafe());
        assertEquals(Verdict.YES, graph.isBounded());
        assertEquals(Verdict.YES, graph.isDeadlockFree());
        assertEquals(Optional.empty(), graph.deadlock());
        assertEquals(Verdict.YES, graph.isReversible());
        assertEquals(Verdict.YES, graph.isLive());
        assertEquals(5, graph.homeStates().cardinality());
        List<int[]> flows = Semiflows.places(net, 100);
        assertEquals(2, flows.size());
        assertArrayEquals(new int[] {1, 1, 0, 1, 0}, flows.get(0));
        assertArrayEquals(new int[] {1, 0, 1, 0, 1}, flows.get(1));
        assertEquals(1, Semiflows.transitions(net, 100).size());
        assertArrayEquals(new int[] {1, 1, 1, 1}, Semiflows.transitions(net, 100).get(0));
        assertEquals(3, Semiflows.rank(net));
        assertEquals(List.of(), Conflicts.structural(net));
        assertEquals("[{0, 1, 3}, {0, 2, 4}]", Siphons.siphons(net, 100).toString());
        assertEquals("[{0, 1, 3}, {0, 2, 4}]", Siphons.traps(net, 100).toString());
        Coverability cover = Coverability.explore(net, 100);
        assertEquals(5, cover.size());
        assertEquals(Verdict.YES, cover.isSafe());
    }

    @Test
    void aDeadlockIsFoundWithAShortestSequenceThatLeadsThere() {
        PetriNet net = greedy(3);
        Reachability graph = Reachability.explore(net, 10_000);
        Reachability.Deadlock deadlock = graph.deadlock().orElseThrow();
        assertEquals("{holds0, holds1, holds2}", deadlock.marking().toString());
        assertEquals(3, deadlock.firings().size());
        Marking replayed = net.initialMarking();
        deadlock.firings().forEach(name -> net.fire(replayed, net.transition(name).index()));
        assertEquals(deadlock.marking(), replayed);
        assertEquals(Verdict.NO, graph.isDeadlockFree());
        assertEquals(Verdict.NO, graph.isLive());
        assertEquals(Verdict.NO, graph.isReversible());
        assertEquals(1, graph.homeStates().cardinality(), "the deadlock can always be reached");
    }

    @Test
    void everyPathLeadsToItsMarking() {
        PetriNet net = greedy(4);
        Reachability graph = Reachability.explore(net, 10_000);
        for (int number = 0; number < graph.size(); number++) {
            Marking marking = net.initialMarking();
            for (int t : graph.path(number)) {
                net.fire(marking, t);
            }
            assertEquals(graph.marking(number), marking);
            assertEquals(number, graph.find(marking));
        }
    }

    @Test
    void whatGaveUpSaysSoAndKnowsOnlyWhatItHasSeen() {
        PetriNet net = greedy(6);
        Reachability graph = Reachability.explore(net, 50);
        assertEquals("net greedy: gave up at 50 markings", graph.toString());
        assertEquals(50, graph.size());
        assertEquals(Verdict.UNKNOWN, graph.isSafe());
        assertEquals(Verdict.UNKNOWN, graph.isDeadlockFree());
        assertEquals(Verdict.UNKNOWN, graph.isLive());
        assertEquals(Verdict.UNKNOWN, graph.isLive(0));
        assertEquals(Verdict.UNKNOWN, graph.isReversible());
        assertEquals(Verdict.YES, graph.canFire(0));
        assertEquals(Verdict.UNKNOWN, graph.isReachable(net.marking(new int[24])));
        assertTrue(assertThrows(GaveUpException.class, graph::homeStates).getMessage().contains("gave up at 50 markings"));
        assertEquals("net greedy: gave up at 20 markings", Coverability.explore(net, 20).toString());
        assertThrows(GaveUpException.class, () -> Semiflows.places(net, 3));
        assertThrows(GaveUpException.class, () -> Siphons.siphons(net, 10));
        PetriNet all = PetriNet.named("all").place("p").transition("t").output("p").build();
        Reachability grown = Reachability.explore(all, 100_000);
        assertEquals(Verdict.UNKNOWN, grown.isBounded());
        for (int tokens : new int[] {0, 1, 2, 15, 16, 255, 256, 65_535, 65_536, 99_999}) {
            assertEquals(tokens, grown.find(all.marking(tokens)), "repacked with wider places");
            assertEquals(tokens, grown.marking(tokens).get(0));
        }
    }

    @Test
    void coverabilityTellsBoundedPlacesFromUnboundedOnes() {
        PetriNet net = PetriNet.named("producer").place("idle", 1).place("made").place("store").place("never")
            .transition("make").input("idle").output("made").transition("put").input("made").output("idle").output("store", 2)
            .transition("dead").input("never").output("idle").build();
        Coverability cover = Coverability.explore(net, 1000);
        assertEquals("net producer: 4 markings", cover.toString());
        assertEquals(Verdict.NO, cover.isBounded());
        assertEquals(Verdict.NO, cover.isSafe());
        assertEquals(1, cover.bound(0));
        assertEquals(Coverability.OMEGA, cover.bound(2));
        assertEquals(Verdict.YES, cover.isCoverable(net.marking(1, 0, 1_000_000, 0)));
        assertEquals(Verdict.NO, cover.isCoverable(net.marking(1, 1, 0, 0)));
        assertEquals(Verdict.NO, cover.canFire(2));
    }

    @Test
    void capacitiesBoundANetAndMakeInhibitorArcsDecidable() {
        PetriNet open = PetriNet.named("open").place("a").transition("t").output("a").inhibitor("a", 3).build();
        String why = assertThrows(UnsupportedOperationException.class, () -> Coverability.explore(open, 100)).getMessage();
        assertTrue(why.contains("inhibitor arc a -> t") && why.contains("capacity"), why);
        PetriNet closed = PetriNet.named("closed").place("a").capacity(5).transition("t").output("a").inhibitor("a", 3).build();
        assertEquals(3, Coverability.explore(closed, 100).bound(0));
        assertEquals(3, Reachability.explore(closed, 100).bound(0));
    }

    @Test
    void reachabilityAndCoverabilityAgreeOnRandomNets() {
        Draws random = new Draws(2024);
        int bounded = 0;
        int unbounded = 0;
        for (int round = 0; round < 600; round++) {
            PetriNet net = RandomNets.plain(random, 4, 4);
            Reachability graph = Reachability.explore(net, 3000);
            Coverability cover = Coverability.explore(net, 3000);
            if (!cover.isComplete() && cover.isBounded() == Verdict.UNKNOWN) {
                continue;
            }
            if (cover.isBounded() == Verdict.YES) {
                bounded++;
                assertTrue(graph.isComplete(), net.arcs().toString());
                assertEquals(graph.size(), cover.size());
                for (int p = 0; p < 4; p++) {
                    assertEquals(graph.bound(p), cover.bound(p));
                }
            } else {
                unbounded++;
                assertTrue(!graph.isComplete(), net.arcs().toString());
            }
            for (int p = 0; p < 4; p++) {
                assertTrue(graph.bound(p) <= cover.bound(p));
            }
            for (int t = 0; t < 4; t++) {
                if (graph.canFire(t) == Verdict.YES || graph.isComplete() && cover.isComplete()) {
                    assertEquals(graph.canFire(t), cover.canFire(t) == Verdict.UNKNOWN ? graph.canFire(t) : cover.canFire(t));
                }
            }
        }
        assertTrue(bounded > 50 && unbounded > 50, bounded + " bounded, " + unbounded + " not");
    }

    @Test
    void semiflowsAreThoseThatASearchFinds() {
        Draws random = new Draws(8);
        int flows = 0;
        for (int round = 0; round < 200; round++) {
            PetriNet net = RandomNets.plain(random, 4, 3);
            List<int[]> found = Semiflows.places(net, 1000);
            flows += found.size();
            int[][] c = net.incidence();
            for (int[] flow : found) {
                assertTrue(isFlow(c, flow), net.arcs().toString());
                for (int[] other : found) {
                    assertTrue(other == flow || !within(other, flow), "one support is within another");
                }
            }
            for (int code = 1; code < 6 * 6 * 6 * 6; code++) {
                int[] tried = {code % 6, code / 6 % 6, code / 36 % 6, code / 216};
                if (isFlow(c, tried)) {
                    assertTrue(found.stream().anyMatch(flow -> within(flow, tried)), net.arcs().toString());
                }
            }
        }
        assertTrue(flows > 50, flows + " semiflows");
        for (int round = 0; round < 300; round++) {
            PetriNet net = RandomNets.plain(random, 9, 4);
            List<int[]> found = Semiflows.places(net, 10_000);
            for (int[] flow : found) {
                assertTrue(isFlow(net.incidence(), flow), net.arcs().toString());
                assertTrue(found.stream().noneMatch(other -> other != flow && within(other, flow)), net.arcs().toString());
            }
        }
    }

    private static boolean isFlow(int[][] c, int[] weights) {
        for (int t = 0; t < c[0].length; t++) {
            int sum = 0;
            for (int p = 0; p < weights.length; p++) {
                sum += weights[p] * c[p][t];
            }
            if (sum != 0) {
                return false;
            }
        }
        return true;
    }

    private static boolean within(int[] inner, int[] outer) {
        for (int i = 0; i < inner.length; i++) {
            if (inner[i] != 0 && outer[i] == 0) {
                return false;
            }
        }
        return true;
    }

    @Test
    void siphonsAndTrapsAreThoseThatASearchFinds() {
        Draws random = new Draws(31);
        int found = 0;
        for (int round = 0; round < 200; round++) {
            PetriNet net = RandomNets.plain(random, 6, 5);
            List<BitSet> siphons = Siphons.siphons(net, 100_000);
            found += siphons.size();
            assertEquals(search(net.pre(), net.post()), List.copyOf(siphons), net.arcs().toString());
            assertEquals(search(net.post(), net.pre()), Siphons.traps(net, 100_000), net.arcs().toString());
        }
        assertTrue(found > 200, found + " siphons");
    }

    private static List<BitSet> search(int[][] pre, int[][] post) {
        List<BitSet> all = new java.util.ArrayList<>();
        for (int set = 1; set < 1 << pre.length; set++) {
            boolean is = true;
            for (int t = 0; t < pre[0].length; t++) {
                boolean takes = false;
                boolean puts = false;
                for (int p = 0; p < pre.length; p++) {
                    takes |= (set >> p & 1) != 0 && pre[p][t] > 0;
                    puts |= (set >> p & 1) != 0 && post[p][t] > 0;
                }
                is &= takes || !puts;
            }
            if (is) {
                all.add(BitSet.valueOf(new long[] {set}));
            }
        }
        return all.stream().filter(set -> all.stream().noneMatch(other -> {
            BitSet rest = (BitSet) other.clone();
            rest.andNot(set);
            return !other.equals(set) && rest.isEmpty();
        })).sorted(java.util.Comparator.comparing(BitSet::toString)).toList();
    }

    @Test
    void aStructuralConflictIsEffectiveOnlyIfItHappens() {
        PetriNet net = PetriNet.named("turns").place("a", 1).place("b").place("shared", 1).place("rare").place("full").capacity(1)
            .transition("ta").input("a", "shared").output("b", "shared").transition("tb").input("b", "shared").output("a", "shared")
            .transition("x").input("a").output("rare").transition("y").inhibitor("rare", 1).test("b", 1).output("full")
            .build();
        List<Conflicts.Pair> pairs = Conflicts.structural(net);
        assertEquals(List.of(new Conflicts.Pair(0, 2, 0), new Conflicts.Pair(1, 3, 1), new Conflicts.Pair(0, 1, 2),
            new Conflicts.Pair(2, 3, 3)), pairs);
        List<Conflicts.Effective> effective = Reachability.explore(net, 100).effectiveConflicts();
        assertEquals("[0>2, 2>0, 1>3]", effective.stream().map(one -> one.first() + ">" + one.second()).toList().toString());
        int[] cluster = Conflicts.clusters(net);
        assertTrue(cluster[0] == cluster[1] && cluster[0] == cluster[2] && cluster[0] == cluster[3]);
        assertArrayEquals(new int[] {-1, -1, -1, -1}, Conflicts.clusters(Samples.paper()));
    }

    @Test
    void clustersJoinExactlyWhatStructuralConflictsJoin() {
        Draws random = new Draws(55);
        for (int round = 0; round < 300; round++) {
            PetriNet net = RandomNets.any(random, 7, 7);
            int[] cluster = Conflicts.clusters(net);
            boolean[] any = new boolean[7];
            for (Conflicts.Pair pair : Conflicts.structural(net)) {
                any[pair.first()] = true;
                any[pair.second()] = true;
                assertEquals(cluster[pair.first()], cluster[pair.second()], net.arcs().toString());
            }
            for (int t = 0; t < 7; t++) {
                assertEquals(any[t], cluster[t] >= 0, "transition " + t + " of " + net.arcs());
            }
        }
    }

    @Test
    void theRankOfTheIncidenceMatrixIsThatOfItsSemiflows() {
        assertEquals(0, Semiflows.rank(PetriNet.named("none").place("p").transition("t").input("p").output("p").build()));
        int[][] incidence = {{-2, 4, 1}, {1, -2, 0}, {-1, 2, 1}};
        assertEquals(2, Semiflows.rank(PetriNet.fromIncidence("r", incidence, new int[3])));
        assertEquals(10, Semiflows.rank(Samples.philosophers(10)));
    }

    /** A later sum of rows has a smaller support than a row that was kept earlier. */
    @Test
    void aSemiflowThatContainsALaterOneIsDropped() {
        int[][] incidence = {{0, -1, -1}, {1, 0, 1}, {-1, -1, -1}, {1, 1, 0}, {-1, 2, -1}, {1, 0, 1}, {-1, 2, 0}};
        PetriNet net = PetriNet.fromIncidence("late", incidence, new int[7]);
        Set<String> found = new TreeSet<>();
        Semiflows.places(net, 100_000).forEach(flow -> found.add(Arrays.toString(flow)));
        assertEquals(new TreeSet<>(Set.of("[1, 2, 1, 0, 0, 0, 1]", "[1, 0, 1, 0, 0, 2, 1]", "[0, 3, 3, 1, 0, 0, 1]",
            "[0, 3, 2, 0, 1, 0, 0]", "[0, 0, 3, 1, 0, 3, 1]", "[0, 0, 2, 0, 1, 3, 0]")), found);
    }
}
