package tickbus.petri.analysis;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.List;
import java.util.Set;
import java.util.TreeSet;
import org.junit.jupiter.api.Test;
import tickbus.petri.net.Marking;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;

/**
 * Nets of the Model Checking Contest whose numbers of markings are published. The files of the contest have no licence to
 * redistribute them; these are built from their definitions in the literature.
 */
class PublishedNetsTest {
    /**
     * The Kanban system of Ciardo and Tilgner, "On the use of Kronecker operators for the solution of generalized
     * stochastic Petri nets": four cells with the same number of tickets. Cell 1 feeds 2 and 3, and both feed 4.
     */
    private static PetriNet kanban(int tickets) {
        NetBuilder net = PetriNet.named("Kanban");
        for (int cell = 1; cell <= 4; cell++) {
            net.place("kanban" + cell, tickets).place("machine" + cell).place("back" + cell).place("out" + cell);
        }
        for (int cell = 1; cell <= 4; cell++) {
            net.transition("ok" + cell).input("machine" + cell).output("out" + cell);
            net.transition("redo" + cell).input("machine" + cell).output("back" + cell);
            net.transition("repair" + cell).input("back" + cell).output("machine" + cell);
        }
        return net
            .transition("in").input("kanban1").output("machine1")
            .transition("split").input("out1", "kanban2", "kanban3").output("kanban1", "machine2", "machine3")
            .transition("join").input("out2", "out3", "kanban4").output("kanban2", "kanban3", "machine4")
            .transition("out").input("out4").output("kanban4")
            .build();
    }

    /** Dining philosophers who take one fork after the other, the left or the right one first. */
    private static PetriNet philosophers(int count) {
        NetBuilder net = PetriNet.named("Philosophers");
        for (int i = 0; i < count; i++) {
            net.place("think" + i, 1).place("left" + i).place("right" + i).place("eat" + i).place("fork" + i, 1);
        }
        for (int i = 0; i < count; i++) {
            String left = "fork" + i;
            String right = "fork" + (i + 1) % count;
            net.transition("takeLeft" + i).input("think" + i, left).output("left" + i);
            net.transition("thenRight" + i).input("left" + i, right).output("eat" + i);
            net.transition("takeRight" + i).input("think" + i, right).output("right" + i);
            net.transition("thenLeft" + i).input("right" + i, left).output("eat" + i);
            net.transition("end" + i).input("eat" + i).output("think" + i, left, right);
        }
        return net.build();
    }

    private static Reachability explored(PetriNet net) {
        Reachability reached = Reachability.explore(net, 1_000_000);
        assertTrue(reached.isComplete());
        return reached;
    }

    @Test
    void kanbanHasItsPublishedNumbersOfMarkings() {
        int[] published = {160, 4_600, 58_400, 454_475};
        for (int tickets = 1; tickets <= published.length; tickets++) {
            Reachability reached = explored(kanban(tickets));
            assertEquals(published[tickets - 1], reached.size(), tickets + " tickets");
        }
    }

    @Test
    void kanbanIsLiveAndKeepsItsTickets() {
        PetriNet net = kanban(2);
        Reachability reached = explored(net);
        assertEquals(Verdict.YES, reached.isDeadlockFree());
        assertEquals(Verdict.YES, reached.isLive());
        assertEquals(Verdict.YES, reached.isReversible());
        assertEquals(2, reached.bound(net.place("out4").index()));
        // Cells 2 and 3 are fed together, so the free tickets of one also go with the used ones of the other.
        assertEquals(4 + 2, Semiflows.places(net, 100).size());
    }

    @Test
    void philosophersHaveThreeToTheirNumberOfMarkingsAndTwoDeadlocks() {
        for (int count = 2; count <= 10; count++) {
            PetriNet net = philosophers(count);
            Reachability reached = explored(net);
            assertEquals((int) Math.pow(3, count), reached.size(), count + " philosophers");
            List<Integer> deadlocks = reached.deadlocks();
            assertEquals(2, deadlocks.size());
            Set<String> hands = new TreeSet<>();
            for (int deadlock : deadlocks) {
                Marking marking = reached.marking(deadlock);
                for (int i = 0; i < count; i++) {
                    assertEquals(1, marking.get("left" + i) + marking.get("right" + i));
                }
                hands.add(marking.get("left0") == 1 ? "left" : "right");
            }
            assertEquals(Set.of("left", "right"), hands);
            assertFalse(reached.deadlock().orElseThrow().firings().isEmpty());
        }
    }
}
