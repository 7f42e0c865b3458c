package tickbus.petri.run;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.time.Duration;
import org.junit.jupiter.api.Test;
import tickbus.petri.net.PetriNet;

/** {@link CoordinatorBuilder#whenMarked}: how long a place has been marked. */
class MarkedForTest {
    private static final Duration FIVE = Duration.ofNanos(5);

    @Test
    void aTransitionWaitsUntilAPlaceHasBeenMarkedForATime() {
        PetriNet net = PetriNet.named("n").place("step 3").place("a", 1).place("b", 1).place("c")
            .transition("begin").input("a").output("step 3").transition("t").input("b").output("c").build();
        double[] input = {0};
        Coordinator coordinator = Coordinator.of(net).inputs("go").reader(values -> values[0] = input[0])
            .when("begin", in -> in.isOn(0)).whenMarked("t", "step 3", FIVE).build();
        coordinator.scan(0);
        coordinator.scan(100);
        assertEquals(Long.MAX_VALUE, coordinator.nextDue());
        input[0] = 1;
        assertEquals(1, coordinator.scan(200));
        assertEquals(200, coordinator.markedSince(net.place("step 3").index()));
        assertEquals(205, coordinator.nextDue());
        assertEquals(0, coordinator.scan(204));
        assertEquals(1, coordinator.scan(205));
        assertEquals(1, coordinator.tokens(net.place("c").index()));
        assertEquals(Long.MAX_VALUE, coordinator.nextDue());
    }

    @Test
    void theTimeBeginsAgainWithTheNextToken() {
        // Two steps that alternate every 5 ns, and a loop at one step.
        PetriNet net = PetriNet.named("n").place("x", 1).place("y").place("z", 1)
            .transition("xy").input("x").output("y").transition("yx").input("y").output("x").transition("loop").input("z").output("z").build();
        int[] fired = new int[3];
        Coordinator coordinator = Coordinator.of(net).listener((scan, nanos, t, choices) -> fired[t]++).limit(10)
            .whenMarked("xy", "x", FIVE).whenMarked("loop", "z", Duration.ofNanos(7)).build();
        for (int now = 0; now <= 35; now++) {
            coordinator.scan(now);
        }
        assertTrue(coordinator.stop().isEmpty());
        // "yx" follows at once, so that x is marked again in the scan in which it was left.
        assertEquals("7 7 5", fired[0] + " " + fired[1] + " " + fired[2]);
    }

    @Test
    void aSecondTokenDoesNotBeginTheTimeAgain() {
        PetriNet net = PetriNet.named("n").place("p", 1).place("more", 1).place("q").place("end", 1)
            .transition("add").input("more").output("p").transition("t").test("p", 1).input("end").output("q").build();
        Coordinator coordinator = Coordinator.of(net).inputs("time").reader(values -> values[0]++)
            .when("add", in -> in.get(0) == 4).whenMarked("t", "p", FIVE).build();
        for (int now = 0; now < 5; now++) {
            assertEquals(now == 3 ? 1 : 0, coordinator.scan(now));
        }
        assertEquals(1, coordinator.scan(5));
    }

    @Test
    void aPlaceThatAnotherTransitionEmptiesFirstFiresNothing() {
        PetriNet net = PetriNet.named("n").place("p", 1).place("a").place("b", 1).place("c")
            .transition("first").priority(1).input("p").output("a").transition("t").input("b").output("c").build();
        Coordinator coordinator = Coordinator.of(net).whenMarked("first", "p", FIVE).whenMarked("t", "p", FIVE).build();
        coordinator.scan(0);
        assertEquals(1, coordinator.scan(5));
        assertEquals(0, coordinator.scan(50));
        assertEquals("{a, b}", coordinator.marking().toString());
    }

    @Test
    void aTimeOfNothingIsRefused() {
        PetriNet net = PetriNet.named("n").place("p").transition("t").build();
        CoordinatorBuilder builder = Coordinator.of(net);
        assertTrue(assertThrows(IllegalArgumentException.class, () -> builder.whenMarked("t", "p", Duration.ZERO)).getMessage()
            .contains("expected more than 0"));
        assertTrue(assertThrows(IllegalArgumentException.class, () -> builder.whenMarked("t", "x", FIVE)).getMessage().contains("no place 'x'"));
    }
}
