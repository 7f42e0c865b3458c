package tickbus.petri.run;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.ArrayList;
import java.util.List;
import org.junit.jupiter.api.Test;
import tickbus.petri.RandomNets;
import tickbus.petri.Samples;
import tickbus.petri.net.Marking;
import tickbus.petri.net.PetriNet;

class StepperTest {
    private static int index(PetriNet net, String transition) {
        return net.transition(transition).index();
    }

    /** For every net that the generator makes: {@code canFire} agrees with the firing rule, and undo goes back exactly. */
    @Test
    void stepsFollowTheRuleAndAreTakenBackOneByOne() {
        Draws random = new Draws(7);
        int fired = 0;
        for (int round = 0; round < 200; round++) {
            PetriNet net = RandomNets.any(random, 1 + random.below(5), 1 + random.below(5));
            Stepper stepper = new Stepper(net, round);
            List<Marking> markings = new ArrayList<>(List.of(stepper.marking()));
            for (int i = 0; i < 15; i++) {
                Marking marking = stepper.marking();
                for (int t = 0; t < net.transitions().size(); t++) {
                    assertEquals(net.isEnabled(marking, t), stepper.canFire(t));
                    assertEquals(stepper.canFire(t), stepper.obstacles(t).isEmpty(), net + " " + marking);
                }
                int next = stepper.choose();
                if (next < 0) {
                    assertTrue(stepper.ready().isEmpty());
                    break;
                }
                stepper.fire(next);
                net.fire(marking, next);
                assertEquals(marking, stepper.marking());
                markings.add(marking);
                fired++;
            }
            for (int i = markings.size() - 1; i > 0; i--) {
                assertEquals(markings.get(i), stepper.marking());
                assertEquals(1, stepper.undo(1));
            }
            assertEquals(net.initialMarking(), stepper.marking());
            assertEquals(0, stepper.undo(1));
        }
        assertTrue(fired > 500, fired + " firings");
    }

    @Test
    void delaysEndWithTheTimeAndAreTheSameAfterAStepBack() {
        PetriNet net = Samples.everything();
        Stepper stepper = new Stepper(net, 3);
        int make = index(net, "make");
        assertFalse(stepper.canFire(make));
        assertEquals(1_000_000, stepper.due(make));
        assertEquals(List.of("its delay is over in 0.001 s"), stepper.obstacles(make));
        stepper.advance(999_999);
        assertFalse(stepper.canFire(make));
        stepper.advance(1);
        stepper.fire(make);
        int put = index(net, "put");
        assertEquals(List.of("place made has 1 token, 0 of them old enough (the next in 0.000005 s); 1 needed"),
            stepper.obstacles(put));
        stepper.advance(5_000);
        stepper.fire(put);
        int take = index(net, "take");
        long due = stepper.due(take);
        assertTrue(due >= stepper.time() + 10 && due <= stepper.time() + 20, due + " after " + stepper.time());
        stepper.undo(1);
        stepper.fire(put);
        assertEquals(due, stepper.due(take), "the same seed");
        assertEquals("1 1000000 make\n2 1005000 put\n", stepper.log());
        stepper.undo(99);
        assertEquals(0, stepper.time());
        assertEquals("", stepper.log());
    }

    @Test
    void everyKindOfObstacleIsExplained() {
        PetriNet net = PetriNet.named("n").place("a").place("b", 2).place("full", 3).capacity(4)
            .transition("t").input("a", 2).test("a", 1).inhibitor("b", 2).output("full", 2).build();
        Stepper stepper = new Stepper(net, 0);
        assertEquals(List.of("place a has no token; 2 needed", "place a has no token; 1 needed, by a test arc",
            "place b has 2 tokens, and inhibits from 2 on",
            "place full has 3 tokens, 2 would come, and its capacity is 4"), stepper.obstacles(0));
        IllegalStateException refused = assertThrows(IllegalStateException.class, () -> stepper.fire(0));
        assertTrue(refused.getMessage().startsWith("net n: transition t cannot fire: place a has no token"), refused.getMessage());
        assertEquals(0, stepper.steps());
    }

    @Test
    void tokensThatNoIntCanCountAreRefusedAndNothingHasHappened() {
        PetriNet net = PetriNet.named("n").place("a", Integer.MAX_VALUE).transition("more").output("a").build();
        Stepper stepper = new Stepper(net, 0);
        assertThrows(IllegalStateException.class, () -> stepper.fire(0));
        assertEquals(Integer.MAX_VALUE, stepper.marking().get(0));
        assertEquals(0, stepper.steps());
    }

    @Test
    void chanceChoosesAmongTheGreatestPriorityAndIsTheSameForTheSameSeed() {
        PetriNet net = PetriNet.named("n").place("p", 1).transition("low").test("p", 1).transition("a").test("p", 1).priority(2)
            .transition("b").test("p", 1).priority(2).build();
        Stepper one = new Stepper(net, 5);
        Stepper same = new Stepper(net, 5);
        boolean[] seen = new boolean[3];
        for (int i = 0; i < 50; i++) {
            int choice = one.choose();
            assertEquals(choice, same.choose());
            seen[choice] = true;
        }
        assertFalse(seen[0]);
        assertTrue(seen[1] && seen[2]);
    }
}
