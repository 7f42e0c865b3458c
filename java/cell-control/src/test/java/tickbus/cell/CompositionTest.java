package tickbus.cell;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import org.junit.jupiter.api.Test;
import tickbus.petri.PetriNet;
import tickbus.petri.Reachability;
import tickbus.petri.Verdict;
import tickbus.petri.control.BoundNet;

/** What analysis says of the nets: each alone, and all together. */
class CompositionTest {
    private static final int LIMIT = 5_000_000;

    @Test
    void eachNetAloneIsSafeLiveAndWithoutDeadlock() {
        for (BoundNet bound : CellNets.all()) {
            Reachability graph = Reachability.explore(bound.net(), LIMIT);
            assertEquals(Verdict.YES, graph.isDeadlockFree(), graph::toString);
            assertEquals(Verdict.YES, graph.isLive(), graph::toString);
        }
    }

    @Test
    void togetherTheyAreSafeAndLiveSoThatNothingCanGetStuck() {
        PetriNet whole = CellNets.composition(1, 3, 4);
        Reachability graph = Reachability.explore(whole, LIMIT);
        assertTrue(graph.isComplete(), graph::toString);
        assertEquals(Verdict.YES, graph.isDeadlockFree(), () -> graph.deadlock().toString());
        assertEquals(Verdict.YES, graph.isSafe());
        // The switch alone keeps the net from a deadlock in the strict sense, so that more is asked for.
        assertEquals(Verdict.YES, graph.isLive());
    }

    @Test
    void withAPalletAtEveryStopNoneCanMove() {
        PetriNet whole = CellNets.composition(1, 2, 3, 4);
        Reachability graph = Reachability.explore(whole, LIMIT);
        assertEquals(Verdict.NO, graph.canFire(whole.transition("cell.send from 1").index()));
        assertEquals(Verdict.NO, graph.isLive());
    }
}
