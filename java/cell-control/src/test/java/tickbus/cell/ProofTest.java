package tickbus.cell;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import org.junit.jupiter.api.Test;
import tickbus.petri.analysis.Reachability;
import tickbus.petri.analysis.Verdict;
import tickbus.petri.control.BoundNet;

/** Analyses the nets: each alone, and all together. */
class ProofTest {
    @Test
    void eachNetAloneIsBoundedLiveAndWithoutDeadlock() {
        for (BoundNet bound : CellNets.all(Heads.none())) {
            Reachability graph = Reachability.explore(bound.net(), 100_000);
            assertEquals(Verdict.YES, graph.isDeadlockFree(), graph::toString);
            assertEquals(Verdict.YES, graph.isBounded(), graph::toString);
            assertEquals(Verdict.YES, graph.isLive(), graph::toString);
        }
    }

    @Test
    void togetherTheyAreSafeAndHaveNoDeadlock() {
        Proof proof = Proof.of(CellNets.composition(1, 3, 4));
        assertTrue(proof.complete() && proof.safe(), proof::toString);
        assertEquals(0, proof.deadlocks(), proof::toString);
    }

    /** Stronger: from every marking every transition can become enabled again. With two pallets, to be quick. */
    @Test
    void withTwoPalletsTheyAreLive() {
        Reachability graph = Reachability.explore(CellNets.composition(1, 3), 2_000_000);
        assertTrue(graph.isComplete(), graph::toString);
        assertEquals(Verdict.YES, graph.isLive());
    }

    @Test
    void withAPalletOnTheWayToEachStopTheyGetStuck() {
        Proof proof = Proof.of(CellNets.composition(1, 2, 3, 4));
        assertTrue(proof.complete(), proof::toString);
        assertTrue(proof.deadlocks() > 0, proof::toString);
    }
}
