package tickbus.petri;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import java.util.function.Consumer;
import org.junit.jupiter.api.Test;
import tickbus.petri.analysis.Conflicts;
import tickbus.petri.analysis.Coverability;
import tickbus.petri.analysis.GaveUpException;
import tickbus.petri.analysis.Reachability;
import tickbus.petri.analysis.Semiflows;
import tickbus.petri.analysis.Siphons;
import tickbus.petri.analysis.Verdict;
import tickbus.petri.draw.Dot;
import tickbus.petri.draw.NetSvg;
import tickbus.petri.format.HpsimText;
import tickbus.petri.format.Hpx;
import tickbus.petri.format.HpxTest;
import tickbus.petri.format.Pnml;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.run.Coordinator;
import tickbus.petri.run.Draws;

/** Nets that nobody would draw, and broken files. */
class OddNetsTest {
    private static final int MAX = Integer.MAX_VALUE;

    private static List<PetriNet> odd() {
        return List.of(
            PetriNet.named("nothing").build(),
            PetriNet.named("places").place("a").place("b", 3).build(),
            PetriNet.named("transitions").transition("t").transition("u").build(),
            PetriNet.named("loop").place("p", 1).transition("t").input("p").output("p").test("p", 1).inhibitor("p", 2).build(),
            PetriNet.named("full").place("p", 2).capacity(2).transition("t").output("p").transition("u").input("p", 2).output("p", 2)
                .build(),
            PetriNet.named("heavy").place("p", MAX).place("q").transition("t").input("p", MAX).output("q", MAX)
                .transition("back").input("q", MAX).output("p", MAX).build(),
            PetriNet.named("overflows").place("p", MAX).place("q", 1).transition("t").test("q", 1).output("p").build(),
            PetriNet.named("nearly").place("p", MAX - 1).capacity(MAX - 1).place("q").transition("t").output("p", MAX)
                .inhibitor("q", MAX).build(),
            PetriNet.named("self").place("p", MAX).transition("t").input("p", MAX).output("p", MAX).build(),
            PetriNet.named("grows").place("p").transition("t").output("p", MAX / 2 + 1).build());
    }

    private static void givesUpAtMost(Runnable what) {
        try {
            what.run();
        } catch (GaveUpException | UnsupportedOperationException said) {
            assertTrue(said.getMessage().startsWith("net "), said.getMessage());
        }
    }

    @Test
    void everyAnalysisOfAnOddNetAnswersOrSaysThatItGaveUp() {
        for (PetriNet net : odd()) {
            Reachability graph = Reachability.explore(net, 1000);
            if (graph.isComplete()) {
                assertEquals(Verdict.YES, graph.isBounded());
                graph.homeStates();
            }
            graph.isLive();
            graph.deadlock();
            graph.effectiveConflicts();
            givesUpAtMost(() -> Coverability.explore(net, 1000));
            givesUpAtMost(() -> Semiflows.places(net, 1000));
            givesUpAtMost(() -> Semiflows.transitions(net, 1000));
            Semiflows.rank(net);
            givesUpAtMost(() -> Siphons.siphons(net, 1000));
            givesUpAtMost(() -> Siphons.traps(net, 1000));
            Conflicts.structural(net);
        }
    }

    @Test
    void anOddNetIsDrawnAndReadBack() {
        for (PetriNet net : odd()) {
            assertTrue(Pnml.parse("n", Pnml.write(net)).isSameAs(net), net.toString());
            assertTrue(NetSvg.write(net).endsWith("</svg>\n"));
            assertTrue(!NetSvg.write(net).contains("NaN"), net.toString());
            assertTrue(Dot.write(net).endsWith("}\n"));
        }
    }

    @Test
    void anOddNetIsScannedUntilItRestsOrStopsWithAReason() {
        for (PetriNet net : odd()) {
            Coordinator coordinator = Coordinator.of(net).limit(100).build();
            for (int i = 0; i < 3; i++) {
                coordinator.scan(i);
            }
            coordinator.stop().ifPresent(stop -> assertTrue(stop.message().startsWith("net " + net.name()), stop.message()));
            for (Place place : net.places()) {
                assertTrue(coordinator.tokens(place.index()) >= 0 && coordinator.tokens(place.index()) <= place.capacity());
            }
        }
    }

    /** The place's count equals the sign for "no bound", although the net is bounded. */
    @Test
    void asManyTokensAsAnIntCountsAreNotTakenForNoBound() {
        PetriNet still = PetriNet.named("still").place("p", MAX).place("q", 1).transition("t").input("q").build();
        assertEquals(Verdict.YES, Reachability.explore(still, 10).isBounded());
        assertThrows(GaveUpException.class, () -> Coverability.explore(still, 10));
    }

    private static void refusedOnlyAsANet(String text, Consumer<String> reader) {
        try {
            reader.accept(text);
        } catch (NetException said) {
            assertTrue(said.getMessage().startsWith("f"), said.getMessage());
        } catch (RuntimeException | StackOverflowError unexpected) {
            throw new AssertionError(unexpected + " for\n" + text, unexpected);
        }
    }

    /** Cuts, doubles, swaps and changes pieces of a text. */
    private static String mutated(Draws random, String text) {
        StringBuilder changed = new StringBuilder(text);
        String[] pieces = {"-", "999999999999", "2147483647", "-2147483648", "\u0000", "<", "&", "\"", "\n", ";", "[", "]", "=", "p0", "t0",
            "<page id=\"x\">", "\uD800", "\uFEFF", "(", ")", "0", "1.5", " ", "//"};
        for (int i = 1 + random.below(4); i > 0 && changed.length() > 2; i--) {
            int at = random.below(changed.length());
            int length = Math.min(changed.length() - at, 1 + random.below(12));
            switch (random.below(5)) {
                case 0 -> changed.delete(at, at + length);
                case 1 -> changed.insert(at, changed.substring(at, at + length));
                case 2 -> changed.setLength(at);
                case 3 -> changed.replace(at, at + length, pieces[random.below(pieces.length)]);
                default -> {
                    List<String> lines = new ArrayList<>(List.of(changed.toString().split("\n", -1)));
                    String taken = lines.remove(random.below(lines.size()));
                    lines.add(random.below(lines.size() + 1), taken);
                    changed = new StringBuilder(String.join("\n", lines));
                }
            }
        }
        return changed.toString();
    }

    @Test
    void aDamagedFileIsReadOrRefusedWithItsName() {
        Draws random = new Draws(11);
        String pnml = Pnml.write(Samples.everything());
        for (int i = 0; i < 500; i++) {
            refusedOnlyAsANet(mutated(random, pnml), text -> Pnml.parse("f", text));
            refusedOnlyAsANet(mutated(random, Samples.PAPER), text -> HpsimText.parse("f", text, Map.of()));
            refusedOnlyAsANet(mutated(random, HpxTest.NET), text -> Hpx.parse("f", text, 1_000_000));
        }
    }
}
