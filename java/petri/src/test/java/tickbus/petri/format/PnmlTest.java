package tickbus.petri.format;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.petri.Samples;
import tickbus.petri.draw.Dot;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Draws;

class PnmlTest {
    /** Two pages, a reference to a reference, two arcs between the same nodes. */
    private static final String PAGES = """
        <?xml version="1.0"?>
        <pnml xmlns="http://www.pnml.org/version-2009/grammar/pnml">
          <net id="n1" type="http://www.pnml.org/version-2009/grammar/ptnet">
            <name><text>two pages</text></name>
            <page id="one">
              <place id="a"><name><text>start</text><graphics><offset x="1" y="2"/></graphics></name>
                <initialMarking><text> 3 </text></initialMarking></place>
              <transition id="t"><name><text>go</text></name><graphics/></transition>
              <arc id="x1" source="a" target="t"><inscription><text>2</text></inscription></arc>
              <arc id="x2" source="a" target="t"/>
              <page id="two">
                <place id="b"><name><text>end</text></name>
                  <toolspecific tool="other" version="9"><capacity>none</capacity></toolspecific></place>
                <referenceTransition id="rt" ref="rt2"/>
                <referenceTransition id="rt2" ref="t"/>
                <arc id="x3" source="rt" target="b"/>
              </page>
            </page>
          </net>
        </pnml>
        """;

    @TempDir
    Path folder;

    private static String mistake(String text) {
        return assertThrows(NetException.class, () -> Pnml.parse("n.pnml", text), text).getMessage();
    }

    @Test
    void pagesAndReferencesAreResolvedAndArcsAdded() {
        PetriNet expected = PetriNet.named("x").place("start", 3).place("end")
            .transition("go").input("start", 3).output("end").build();
        PetriNet net = Pnml.parse("n.pnml", PAGES);
        assertTrue(expected.isSameAs(net), net.arcs().toString());
        assertEquals("two pages", net.name());
    }

    @Test
    void whatIsWrittenIsReadBackTheSame() {
        for (PetriNet net : new PetriNet[] {Samples.everything(), Samples.paper(), Samples.philosophers(3)}) {
            PetriNet back = Pnml.parse("back.pnml", Pnml.write(net));
            assertTrue(net.isSameAs(back), Pnml.write(net));
            assertEquals(net.name(), back.name());
        }
    }

    @Test
    void aFileIsReadInTheEncodingThatItNames() throws Exception {
        Path file = folder.resolve("latin.pnml");
        String text = PAGES.replace("version=\"1.0\"", "version=\"1.0\" encoding=\"ISO-8859-1\"").replace("start", "Anfänge");
        Files.writeString(file, text, StandardCharsets.ISO_8859_1);
        assertEquals("Anfänge", Pnml.read(file).place(0).name());
    }

    @Test
    void whatIsWrongIsReportedWithLineAndElement() {
        assertEquals("n.pnml:10: arc x2: target 'u' is not there; expected the id of a place or transition",
            mistake(PAGES.replace("id=\"x2\" source=\"a\" target=\"t\"", "id=\"x2\" source=\"a\" target=\"u\"")));
        assertTrue(mistake(PAGES.replace("ptnet", "symmetricnet")).contains("n.pnml:3: net n1: type 'http"));
        assertTrue(mistake(PAGES.replace(" 3 ", "-3")).contains("n.pnml:7: place a: initial marking -3; expected 0 to"));
        assertTrue(mistake(PAGES.replace(" 3 ", "three")).contains("initial marking 'three'; expected a whole number"));
        assertTrue(mistake(PAGES.replace(">2<", ">0<")).contains("n.pnml:9: arc x1: weight 0; expected 1 to"));
        assertTrue(mistake(PAGES.replace(">2<", ">99999999999<")).contains("weight 99999999999; expected"));
        assertTrue(mistake(PAGES.replace(">2<", ">2147483647<")).contains("weigh more than 2147483647 together"));
        assertTrue(mistake(PAGES.replace("source=\"rt\" target=\"b\"", "source=\"a\" target=\"b\""))
            .contains("n.pnml:16: arc x3: from place a to place b"));
        assertTrue(mistake(PAGES.replace("ref=\"t\"", "ref=\"rt\"")).contains("refers to itself"));
        assertTrue(mistake(PAGES.replace("ref=\"t\"", "ref=\"a\"")).contains("expected the id of a transition"));
        assertTrue(mistake(PAGES.replace("id=\"b\"", "id=\"a\"")).contains("id a is given twice"));
        assertTrue(mistake(PAGES.replace("<graphics/>", "<condition/>")).contains("<condition>, which a place/transition net"));
        assertTrue(mistake(PAGES.replace("<arc id=\"x2\" ", "<arc ")).contains("there is no attribute id"));
        assertTrue(mistake(PAGES.replace("id=\"x2\" source=\"a\" target=\"t\"/",
            "id=\"x2\" source=\"a\" target=\"t\"><type value=\"reset\"/></arc")).contains("arc type 'reset'; expected normal"));
        assertTrue(mistake(PAGES.replace("</page>", "</paeg>")).contains("not well-formed XML"));
        assertTrue(mistake("<pnml/>").contains("there is no <net>"));
        assertTrue(mistake(PAGES.replace("tool=\"other\"", "tool=\"tickbus\"")).contains("capacity 'none'; expected"));
        assertTrue(mistake(PAGES.replace("</net>", "</net><net id=\"n2\" type=\"\"/>")).contains("a second net"));
    }

    @Test
    void externalEntitiesAndBombsAreRefused() throws Exception {
        Path secret = Files.writeString(folder.resolve("secret"), "42");
        String external = PAGES.replace("?>\n<pnml", "?>\n<!DOCTYPE pnml [<!ENTITY e SYSTEM \"" + secret.toUri() + "\">]>\n<pnml")
            .replace(" 3 ", "&e;");
        assertFalse(mistake(external).contains("42"));
        StringBuilder bomb = new StringBuilder("<?xml version=\"1.0\"?>\n<!DOCTYPE pnml [<!ENTITY e0 \"ha\">");
        for (int i = 1; i < 30; i++) {
            bomb.append("<!ENTITY e").append(i).append(" \"&e").append(i - 1).append(";&e").append(i - 1).append(";\">");
        }
        mistake(bomb + "]>\n<pnml>&e29;</pnml>");
        assertTrue(mistake("<!DOCTYPE pnml>\n" + PAGES.substring(PAGES.indexOf('\n') + 1)).contains("document type"));
        String deep = "<page id=\"p\">".repeat(100_000);
        mistake(PAGES.substring(0, PAGES.indexOf("<page")) + deep);
    }

    @Test
    void aDocumentThatIsCutOffIsRefusedUntilItsLastTag() {
        int end = PAGES.lastIndexOf('>') + 1;
        for (int length = 0; length < end; length++) {
            String text = PAGES.substring(0, length);
            assertTrue(mistake(text).startsWith("n.pnml"), "cut at " + length);
        }
    }

    @Test
    void charactersThatAreChangedGiveANetOrANetException() {
        Draws random = new Draws(99);
        String whole = Pnml.write(Samples.everything());
        for (int i = 0; i < 4_000; i++) {
            StringBuilder text = new StringBuilder(whole);
            for (int change = random.below(3); change >= 0; change--) {
                int at = random.below(text.length());
                switch (random.below(3)) {
                    case 0 -> text.deleteCharAt(at);
                    case 1 -> text.setCharAt(at, (char) (32 + random.below(96)));
                    default -> text.insert(at, "<>\"-&/0p".charAt(random.below(8)));
                }
            }
            try {
                Pnml.parse("fuzz", text.toString());
            } catch (NetException expected) {
                assertTrue(expected.getMessage().contains("fuzz") || expected.getMessage().startsWith("net "),
                    expected.getMessage());
            }
        }
    }

    @Test
    void dotShowsKindsWeightsAndTokens() {
        String dot = Dot.write(Samples.everything());
        for (String part : new String[] {"digraph \"every kind\"", "p3 [shape=circle, label=\"2\", xlabel=\"idle\"]",
            "p4 -> t0 [arrowhead=odot]", "p3 -> t2 [style=dashed, label=\"2\"]", "t1 -> p2 [label=\"2\"]", "p0 -> t0;"}) {
            assertTrue(dot.contains(part), part + " in " + dot);
        }
    }
}
