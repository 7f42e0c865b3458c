package tickbus.petri.net;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import org.junit.jupiter.api.Test;
import tickbus.petri.Samples;

class PetriNetTest {
    @Test
    void everyKindOfArcEnablesAsItShould() {
        PetriNet net = PetriNet.named("arcs").place("a", 2).place("b", 1).place("c").capacity(2)
            .transition("t").input("a", 2).test("b", 1).inhibitor("c", 2).output("c").build();
        Marking marking = net.initialMarking();
        assertTrue(net.isEnabled(marking, 0));
        marking.set(0, 1);
        assertFalse(net.isEnabled(marking, 0), "an input arc of weight 2 finds one token");
        marking.set(0, 2);
        marking.set(1, 0);
        assertFalse(net.isEnabled(marking, 0), "a test arc finds no token");
        marking.set(1, 1);
        marking.set(2, 2);
        assertFalse(net.isEnabled(marking, 0), "an inhibitor arc of weight 2 finds two tokens");
        marking.set(2, 1);
        net.fire(marking, 0);
        assertArrayEquals(new int[] {0, 1, 2}, marking.toArray());
        assertEquals("{b, c: 2}", marking.toString());
        assertThrows(IllegalStateException.class, () -> net.fire(marking, 0));
    }

    @Test
    void aFullPlaceStopsATransitionUnlessItTakesAsManyAsItPuts() {
        PetriNet net = PetriNet.named("full").place("a", 1).capacity(1)
            .transition("more").output("a").transition("same").input("a").output("a").build();
        assertFalse(net.isEnabled(net.initialMarking(), 0));
        assertTrue(net.isEnabled(net.initialMarking(), 1));
    }

    @Test
    void tooManyTokensForAnIntAreRefusedAndChangeNothing() {
        PetriNet net = PetriNet.named("many").place("a", Integer.MAX_VALUE).place("b")
            .transition("t").output("b").output("a").build();
        Marking marking = net.initialMarking();
        assertThrows(IllegalStateException.class, () -> net.fire(marking, 0));
        assertEquals(net.initialMarking(), marking);
    }

    @Test
    void matricesGiveTheSameNetAsTheBuilder() {
        PetriNet built = PetriNet.named("m").place("P0", 1).place("P1")
            .transition("T0").input("P0").output("P1", 2).transition("T1").input("P1").output("P1").build();
        int[][] pre = {{1, 0}, {0, 1}};
        int[][] post = {{0, 0}, {2, 1}};
        assertTrue(built.isSameAs(PetriNet.fromMatrices("m", pre, post, new int[] {1, 0})));
        assertArrayEquals(pre, built.pre());
        assertArrayEquals(post, built.post());
        assertArrayEquals(new int[][] {{-1, 0}, {2, 0}}, built.incidence());
        assertFalse(built.isSameAs(PetriNet.fromIncidence("m", built.incidence(), new int[] {1, 0})),
            "an incidence matrix has no place that is input and output of one transition");
    }

    @Test
    void matricesOfTheWrongShapeAreRefused() {
        NetException rows = assertThrows(NetException.class,
            () -> PetriNet.fromMatrices("m", new int[][] {{1}}, new int[][] {{1}}, new int[] {1, 0}));
        assertTrue(rows.getMessage().contains("1 rows; expected 2"), rows.getMessage());
        NetException columns = assertThrows(NetException.class,
            () -> PetriNet.fromMatrices("m", new int[][] {{1, 0}, {1}}, new int[][] {{1, 0}, {1, 0}}, new int[] {1, 0}));
        assertTrue(columns.getMessage().contains("row 1 has 1 columns; expected 2"), columns.getMessage());
        assertThrows(NetException.class,
            () -> PetriNet.fromMatrices("m", new int[][] {{-1}}, new int[][] {{1}}, new int[] {1}));
    }

    @Test
    void allMistakesOfABuilderAreReportedAtOnce() {
        NetException wrong = assertThrows(NetException.class, () -> PetriNet.named("w").place("a", -1).place("a")
            .place("b", 5).capacity(2).transition("t").input("nowhere").input("a", 0).output("b").output("b")
            .transition(" ").place("a\u0007").place("\u202egnp.exe").build());
        for (String one : new String[] {"place a: -1 tokens", "place a: given twice",
            "place b: 5 tokens; expected at most its capacity of 2",
            "there is no place 'nowhere'", "weight 0; expected 1 or more", "arc t -> b: given twice", "no name", "a control character",
            "place number 4: its name turns the direction of the text"}) {
            assertTrue(wrong.getMessage().contains(one), one + " in " + wrong.getMessage());
        }
    }

    @Test
    void aDelayBelongsToItsPlaceOrTransition() {
        NetBuilder builder = PetriNet.named("x");
        PlaceStep first = builder.place("p", 1);
        TransitionStep transition = builder.place("q").delay(6).transition("t").delay(500_000_000L).input("p");
        first.delay(5).capacity(3);
        transition.output("q").priority(2);
        PetriNet net = builder.build();
        assertEquals(new Place(0, "p", 1, 3, 5), net.place("p"));
        assertEquals(6, net.place("q").delay());
        assertEquals(new Transition(0, "t", 2, Delay.fixed(500_000_000L)), net.transition("t"));
        assertEquals(2, net.arcs().size());
        String wrong = assertThrows(NetException.class,
            () -> PetriNet.named("x").place("p").delay(-2).transition("t").delay(-1).build()).getMessage();
        assertTrue(wrong.contains("place p: delay -2 ns; expected 0 or more"), wrong);
        assertTrue(wrong.contains("transition t: delay -1 ns; expected 0 or more"), wrong);
    }

    @Test
    void theCompilerRefusesAPropertyOfTheOtherKindOfNode() {
        assertThrows(NoSuchMethodException.class, () -> TransitionStep.class.getMethod("capacity", int.class));
        assertThrows(NoSuchMethodException.class, () -> PlaceStep.class.getMethod("delay", Delay.class));
        assertThrows(NoSuchMethodException.class, () -> PlaceStep.class.getMethod("input", String[].class));
        assertThrows(NoSuchMethodException.class, () -> NetBuilder.class.getMethod("delay", long.class));
    }

    @Test
    void anUnknownNameSaysWhichThereAre() {
        String text = assertThrows(IllegalArgumentException.class, () -> Samples.paper().place("P9")).getMessage();
        assertTrue(text.contains("there is no place 'P9'; there are [P0, P1"), text);
    }

    @Test
    void aMacroStepIsItsExpansion() {
        PetriNet inner = PetriNet.named("inner").place("E1").place("S1").transition("t").priority(2).delay(5).input("E1").output("S1").build();
        PetriNet fill = PetriNet.named("fill").place("E2").place("wait").delay(7).place("S2").capacity(3)
            .transition("t").input("E2").output("M1").transition("u").input("M1").output("wait").transition("v").input("wait").output("S2")
            .macroStep("M1", inner, "E1", "S1").build();
        PetriNet net = PetriNet.named("tank").place("rest", 1).place("free", 1)
            .macroStep("M2", fill, "E2", "S2")
            .transition("start").input("rest").output("M2")
            .transition("done").input("M2").output("rest")
            .transition("alone").input("free").output("free").inhibitor("M2", 1)
            .build();
        PetriNet same = PetriNet.named("tank").place("rest", 1).place("free", 1)
            .place("M2.E2").place("M2.wait").delay(7).place("M2.S2").capacity(3).place("M2.M1.E1").place("M2.M1.S1")
            .transition("M2.t").input("M2.E2").output("M2.M1.E1").transition("M2.u").input("M2.M1.S1").output("M2.wait")
            .transition("M2.v").input("M2.wait").output("M2.S2")
            .transition("M2.M1.t").priority(2).delay(5).input("M2.M1.E1").output("M2.M1.S1")
            .transition("start").input("rest").output("M2.E2").transition("done").input("M2.S2").output("rest")
            .transition("alone").input("free").output("free").inhibitor("M2.E2", 1).inhibitor("M2.wait", 1).inhibitor("M2.S2", 1)
            .inhibitor("M2.M1.E1", 1).inhibitor("M2.M1.S1", 1).build();
        assertTrue(net.isSameAs(same), net + " " + net.arcs());
    }

    @Test
    void mistakesOfMacroStepsAreNamed() {
        PetriNet fill = PetriNet.named("fill").place("E").place("S").transition("t").input("E").output("S").build();
        NetException wrong = assertThrows(NetException.class, () -> PetriNet.named("n").place("M")
            .macroStep("M", fill, "E", "X").macroStep("K", fill, "E", "E")
            .transition("a").test("K", 1).transition("b").inhibitor("K", 2).build());
        assertEquals("""
            net n: macro step M: there is no place 'X' in fill
            macro step K: E is entry and exit; expected two steps
            macro step M: there is a place of this name; expected another one
            test arc K -> a: a test arc at a macro step, which is active while any of its steps is; expected one of its steps, such as K.E
            inhibitor arc K -> b: weight 2 at a macro step; expected 1""", wrong.getMessage());
    }
}
