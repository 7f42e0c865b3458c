package tickbus.petri.format;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.List;
import java.util.Map;
import org.junit.jupiter.api.Test;
import tickbus.petri.Samples;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Draws;

class HpsimTextTest {
    private static String mistake(String text) {
        return assertThrows(NetException.class, () -> HpsimText.parse("n.txt", text, Map.of()), text).getMessage();
    }

    @Test
    void theNetOfThePaperIsReadWithInputsFromPositiveEntries() {
        Imported imported = HpsimText.parse("paper.txt", Samples.PAPER, Map.of());
        assertEquals(List.of(), imported.warnings());
        PetriNet expected = PetriNet.named("paper").place("P0", 1).place("P1").place("P2").place("P3").place("P4")
            .transition("T0").input("P0").output("P1", "P2").transition("T1").input("P1").output("P3")
            .transition("T2").input("P2").output("P4").transition("T3").input("P3", "P4").output("P0").build();
        assertTrue(expected.isSameAs(imported.net()), imported.net().arcs().toString());
    }

    @Test
    void theLaterSpellingWithAMacroInItIsRead() {
        String later = Samples.PAPER.replace("(1 0 0 0 0)", "(_T(1 0 0 0 0 )").replace("(1 ;1 ;1 ;1 ;", "(_T(1 ;1 ;1 ;1 ;")
            .replace("(1 0 0 -1)", "(_T( 1   0   0  -1 )").replace("(P0;", "P0;").replace("\n", "\r\n");
        assertTrue(Samples.paper().isSameAs(HpsimText.parse("later.txt", later, Map.of()).net()));
    }

    @Test
    void inhibitorAndTestArcsAreReadWithAWarningAboutTheirWeight() {
        String text = Samples.PAPER.replace("(0 -1 0 1)", "(0 -1 0 0)").replace("(0 1 0 1)", "(0 1 0 2)")
            .replace("(0 0 -1 1)", "(0 0 -1 0)").replace("(0 0 1 1)", "(0 0 1 3)");
        Imported imported = HpsimText.parse("n.txt", text, Map.of());
        assertEquals(2, imported.warnings().size());
        assertTrue(imported.warnings().get(0).startsWith("n.txt:15: place P3, transition T3: the format has no weight"),
            imported.warnings().get(0));
        assertTrue(imported.net().arcs().contains(new Arc(ArcKind.INHIBITOR, 3, 3, 1)));
        assertTrue(imported.net().arcs().contains(new Arc(ArcKind.TEST, 4, 3, 1)));
    }

    @Test
    void aTimeModelNeedsTheDelayThatTheFormatDoesNotHave() {
        String text = Samples.PAPER.replace("(1 ;1 ;1 ;1 ;", "(1 ;2 ;1 ;1 ;");
        assertTrue(mistake(text).contains("n.txt:24: transition T1: time model 2, but the format has no figures"));
        Map<String, Delay> right = Map.of("T1", Delay.fixed(5));
        assertEquals(Delay.fixed(5), HpsimText.parse("n.txt", text, right).net().transition("T1").delay());
        Map<String, Delay> wrong = Map.of("T1", Delay.exponential(5));
        assertThrows(NetException.class, () -> HpsimText.parse("n.txt", text, wrong));
    }

    @Test
    void whatIsWrongIsReportedWithLineAndElement() {
        assertTrue(mistake(Samples.PAPER.replace("(-1 0 1 0)", "(-1 x 1 0)"))
            .equals("n.txt:9: row 3, column 2: entry 'x'; expected a whole number"));
        assertTrue(mistake(Samples.PAPER.replace("(-1 0 1 0)", "(-1 0 1)")).contains("n.txt:9: row 3: 3 columns; expected 4"));
        assertTrue(mistake(Samples.PAPER.replace("(1 0 0 0 0)", "(1 0 0 0)")).contains("4 entries; expected 5"));
        assertTrue(mistake(Samples.PAPER.replace("(1 0 0 0 0)", "(-1 0 0 0 0)")).contains("value -1; expected 0 to"));
        assertTrue(mistake(Samples.PAPER.replace("(P0;P1", "(P0;P0")).contains("name P0: given twice"));
        assertTrue(mistake(Samples.PAPER.replace("(0 0 1 1)", "(0 0 1 4)")).contains("arc type 4; expected 0 (none)"));
        assertTrue(mistake(Samples.PAPER.replace("(0 0 1 1)", "(0 1 1 1)")).contains("a normal arc, but incidence 0"));
        assertTrue(mistake(Samples.PAPER.replace("(0 0 1 1)", "(0 0 0 1)")).contains("arc type 0 with incidence -1"));
        assertTrue(mistake(Samples.PAPER.replace("(1 ;1 ;1 ;1 ;", "(1 ;1 ;1 ;5 ;")).contains("value 5; expected 1 to 4"));
        assertTrue(mistake(Samples.PAPER + "// Marking Vector:\n(1 0 0 0 0)").contains("a second section"));
        assertTrue(mistake("").contains("there is no section of transitions"));
    }

    @Test
    void aBinaryFileOfHpsimIsNamedAsSuch() {
        assertEquals("n.txt:1: a binary file; if it is a .hps of HPSim, open it there and export it as .hpx",
            mistake("\u00ff\u00ff\u0002\0CObject\u0001\0"));
        assertTrue(mistake("\u001b[31mno section").contains("'\uFFFD[31mno section' before any section"));
    }

    @Test
    void aTextThatIsCutOffIsNeverAWrongNet() {
        PetriNet whole = Samples.paper();
        int read = 0;
        for (int length = 0; length < Samples.PAPER.length(); length++) {
            try {
                Imported cut = HpsimText.parse("cut.txt", Samples.PAPER.substring(0, length), Map.of());
                assertTrue(whole.isSameAs(cut.net()), "cut at " + length);
                read++;
            } catch (NetException expected) {
                assertTrue(expected.getMessage().startsWith("cut.txt:"), expected.getMessage());
            }
        }
        assertEquals(3, read, "without the last semicolon, space or line end it is still whole");
    }

    @Test
    void bytesThatAreChangedGiveAnErrorOrTheNetThatTheySpell() {
        Draws random = new Draws(14);
        String alphabet = "0123456789-();{}/ \nTPxé,_";
        for (int i = 0; i < 4_000; i++) {
            StringBuilder text = new StringBuilder(Samples.PAPER);
            for (int change = random.below(3); change >= 0; change--) {
                text.setCharAt(random.below(text.length()), alphabet.charAt(random.below(alphabet.length())));
            }
            try {
                PetriNet net = HpsimText.parse("fuzz", text.toString(), Map.of()).net();
                assertArrayEquals(new int[] {5, 4}, new int[] {net.places().size(), net.transitions().size()},
                    text.toString());
            } catch (NetException expected) {
                assertTrue(expected.getMessage().startsWith("fuzz") || expected.getMessage().startsWith("net fuzz"),
                    expected.getMessage());
            }
        }
    }
}
