package tickbus.petri.sfc;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.nio.file.Path;
import org.junit.jupiter.api.Test;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.TransitionStep;

/** Charts and nets that are written and read again. */
class WrittenTest {
    /** Two arms, a way back by priority, delays of both kinds, a flag and its absence. */
    static final PetriNet PRESS = PetriNet.named("chart")
        .place("idle", 1).place("left arm").delay(30_000_000).place("right arm").place("waits").place("step").place("cool").delay(12_000_000)
        .transition("go").input("idle").output("left arm", "right arm")
        .transition("l").input("left arm").output("waits").inhibitor("step", 1)
        .transition("r").priority(3).delay(25_500_000).input("right arm").output("step").test("waits", 1)
        .transition("r 2").priority(1).delay(45_000_000).input("right arm").output("right arm")
        .transition("stuck").priority(5).delay(100_000_000).input("right arm", "left arm").output("idle")
        .transition("meet").input("waits", "step").output("cool")
        .transition("cooled").input("cool").output("idle")
        .build();

    private static final String CHART = """
        FUNCTION_BLOCK all
          VAR_INPUT a, b, c : BOOL; END_VAR
          VAR_OUTPUT RETAIN u, v : BOOL := TRUE; END_VAR
          VAR CONSTANT limit : TIME := T#30ms; END_VAR
          VAR n : INT := -3; m AT %QW1 : UDINT; END_VAR
          INITIAL_STEP one: u(N); count(P); END_STEP
          STEP two: v(L, T#1.5ms); count(P0); END_STEP
          STEP three: v(SD, T#12ms); END_STEP
          STEP four: v(R); u(S); END_STEP
          ACTION count: (* a comment *) IF a THEN n := n + 1; m := (m * 3 + 1) MOD 16#FF; ELSIF NOT b THEN n := -n; ELSE m := 2; END_IF; END_ACTION
          ACTION never: n := 0; END_ACTION
          TRANSITION fork FROM one TO (two, three) := a OR two.X; END_TRANSITION
          TRANSITION jump (PRIORITY := 7) FROM one TO four := b; END_TRANSITION
          TRANSITION FROM (two, three) TO four := c AND two.T > limit; END_TRANSITION
          TRANSITION (PRIORITY := 5) FROM (two, three) TO (two, three) := NOT c; END_TRANSITION
          TRANSITION FROM two TO one := FALSE; END_TRANSITION
          TRANSITION FROM four TO one := a <> b; END_TRANSITION
        END_FUNCTION_BLOCK
        """;

    @Test
    void aChartIsTheSameAfterWriting() throws Exception {
        for (Sfc chart : new Sfc[] {Sfc.parse("all.st", CHART), Sfc.read(Path.of("src/test/resources/sfc/mixer.xml"))}) {
            Sfc fromText = Sfc.parse("written.st", chart.text());
            assertEquals(chart.text(), fromText.text());
            assertEquals(chart.variables(), fromText.variables());
            assertTrue(PlcopenTest.runsAs(chart, fromText, "abc") > 200);
            Sfc fromXml = Sfc.parse("written.xml", chart.plcopen());
            assertEquals(chart.variables(), fromXml.variables());
            assertTrue(PlcopenTest.runsAs(chart, fromXml, "abc") > 200);
        }
    }

    @Test
    void delaysBecomeTimesOfSteps() {
        String text = Sfc.of(PRESS).text();
        assertTrue(text.contains("TRANSITION n_l (PRIORITY := 4) FROM left_arm TO waits := left_arm.T >= T#30ms AND NOT n_step.X; "), text);
        assertTrue(text.contains("TRANSITION n_r (PRIORITY := 2) FROM right_arm TO n_step := "
            + "right_arm.T >= T#25.5ms AND waits.X AND waits.T >= T#25.5ms; "), text);
        assertTrue(text.contains("TRANSITION stuck (PRIORITY := 1) FROM (left_arm, right_arm) TO idle := "
            + "left_arm.T >= T#130ms AND right_arm.T >= T#100ms; "), text);
        assertTrue(PlcopenTest.runsAs(Sfc.of(PRESS), Sfc.parse("net.xml", Sfc.of(PRESS).plcopen()), "") > 100);
    }

    private static TransitionStep net() {
        return PetriNet.named("n").place("a", 1).place("b").transition("t").input("a").output("b");
    }

    @Test
    void whatAChartDoesNotHaveIsRefused() {
        assertRefused("the initial marking {a, c}; expected one token, in the initial step", net().place("c", 1).build());
        assertRefused("the initial marking {a: 2}; expected one token, in the initial step",
            PetriNet.named("n").place("a", 2).place("b").transition("t").input("a").output("b").build());
        assertRefused("place c: a capacity of 1; expected none", net().place("c").capacity(1).build());
        assertRefused("arc between place b and transition u: weight 2; expected 1",
            net().transition("u").input("b", 2).output("a").build());
        assertRefused("transition u: no input arc; expected one, as there is a step before and behind it",
            net().transition("u").output("a").build());
        assertRefused("transition u: no output arc; expected one, as there is a step before and behind it",
            net().transition("u").input("b").build());
        assertRefused("transition u: a random delay (EXPONENTIAL); expected a fixed one",
            net().transition("u").input("b").output("a").delay(Delay.exponential(5)).build());
        assertRefused("arc between place a and transition u: an inhibitor arc of a transition with a delay; a chart has no time since a step "
            + "was left", net().transition("u").input("b").output("a").delay(5).inhibitor("a", 1).build());
        assertRefused("not safe (without its test and inhibitor arcs, as two transitions of a chart fire at once); expected at most one token in "
            + "each place, as a step is active or not", net().transition("u").input("b").output("a", "b").build());
    }

    private static void assertRefused(String message, PetriNet net) {
        assertEquals("net n: " + message, assertThrows(NetException.class, () -> Sfc.of(net)).getMessage());
    }

    @Test
    void namesBecomeIdentifiers() {
        Sfc chart = Sfc.of(PetriNet.named("2 µm").place("a b", 1).place("a-b").place("ü").place("A_B_2").place("Step")
            .transition("a b").input("a b").output("a-b").transition("1").input("a-b").output("ü").transition("x").input("ü").output("A_B_2")
            .transition("y").input("A_B_2").output("Step").build());
        assertEquals("n_2_m", chart.net().name());
        assertEquals("[a_b, a_b_2, step2, A_B_2_2, n_Step]", chart.net().places().stream().map(one -> one.name()).toList().toString());
    }
}
