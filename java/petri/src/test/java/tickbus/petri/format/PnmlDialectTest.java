package tickbus.petri.format;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.List;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import tickbus.petri.analysis.Reachability;
import tickbus.petri.analysis.Verdict;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;

/** Nets in the formats of other tools. */
class PnmlDialectTest {
    private static final String TAPAAL = """
        <pnml xmlns="http://www.pnml.org/version-2009/grammar/pnml">
        <net id="n" type="http://www.pnml.org/version-2009/grammar/ptnet"><page id="g">
        <place id="p"><initialMarking><text>1</text></initialMarking></place><place id="q" initialMarking="2"/>
        <transition id="t" priority="5"/><transition id="u"/>
        <arc id="a" source="p" target="t" type="inhibitor"/>
        <arc id="b" source="t" target="q" type="normal"/>
        <arc id="c" source="q" target="u" inscription="2"/>
        </page></net></pnml>
        """;

    private static final String PROM = """
        <?xml version="1.0" encoding="ISO-8859-1"?>
        <pnml>
          <net id="net1" type="http://www.pnml.org/version-2009/grammar/pnmlcoremodel">
            <name><text>mined</text></name>
            <page id="n0"><name><text/></name>
              <place id="n1"><name><text>start</text></name><toolspecific tool="ProM" version="6.4" localNodeID="1"/>
                <graphics><position x="0.0" y="0.0"/><dimension x="12.5" y="12.5"/></graphics>
                <initialMarking><text>1</text></initialMarking></place>
              <place id="n2"><name><text>end</text></name></place>
              <transition id="t1"><name><text>tau</text></name>
                <toolspecific tool="ProM" version="6.4" activity="$invisible$" localNodeID="2"/></transition>
              <arc id="a1" source="n1" target="t1"><name><text>1</text></name><toolspecific tool="ProM" version="6.4"/>
                <arctype><text>normal</text></arctype></arc>
              <arc id="a2" source="t1" target="n2"><arctype><text>normal</text></arctype></arc>
            </page>
            <finalmarkings><marking><place idref="n2"><text>1</text></place></marking></finalmarkings>
          </net>
        </pnml>
        """;

    private static final String WOPED = """
        <pnml>
          <net type="http://www.informatik.hu-berlin.de/top/pntd/ptNetb" id="noID">
            <place id="p1"><name><text>p1</text><graphics><offset x="70" y="150"/></graphics></name>
              <graphics><position x="70" y="110"/><dimension x="40" y="40"/></graphics>
              <initialMarking><text>1</text></initialMarking></place>
            <transition id="t1"><name><text>check</text></name>
              <toolspecific tool="WoPeD" version="1.0"><time>0</time><orientation>1</orientation></toolspecific></transition>
            <arc id="a1" source="p1" target="t1"><inscription><text>1</text></inscription>
              <toolspecific tool="WoPeD" version="1.0"><probability>1.0</probability></toolspecific></arc>
            <toolspecific tool="WoPeD" version="1.0"><bounds><position x="2" y="25"/></bounds></toolspecific>
          </net>
        </pnml>
        """;

    private static final String PIPE = """
        <?xml version="1.0" encoding="ISO-8859-1"?><pnml>
        <net id="Net-One" type="P/T net"><token id="Default" enabled="true" red="0" green="0" blue="0"/>
        <labels x="121" y="234" width="104" height="36" border="false"><text>a note</text></labels>
        <place id="P0"><graphics><position x="615.0" y="210.0"/></graphics><name><value>P0</value><graphics/></name>
          <initialMarking><value>Default,3</value><graphics/></initialMarking><capacity><value>4</value></capacity></place>
        <place id="P1"><name><value>P1</value></name><initialMarking><value>0</value></initialMarking>
          <capacity><value>0</value></capacity></place>
        <transition id="T0"><name><value>T0</value></name><orientation><value>0</value></orientation>
          <rate><value>1.0</value></rate><timed><value>false</value></timed><infiniteServer><value>false</value></infiniteServer>
          <priority><value>2</value></priority></transition>
        <transition id="T1"><name><value>T1</value></name><rate><value>3.0</value></rate><timed><value>true</value></timed>
          <priority><value>7</value></priority></transition>
        <arc id="P0 to T0" source="P0" target="T0"><graphics/><inscription><value>Default,2</value><graphics/></inscription>
          <tagged><value>false</value></tagged><arcpath id="000" x="1" y="2" curvePoint="false"/><type value="normal"/></arc>
        <arc id="P1 to T0" source="P1" target="T0"><inscription><value>1</value></inscription><type value="inhibitor"/></arc>
        <arc id="T0 to P1" source="T0" target="P1"><inscription><value>Default,1</value></inscription><type value="normal"/></arc>
        </net></pnml>
        """;

    private static String refused(String text, Dialect dialect) {
        return assertThrows(NetException.class, () -> Pnml.parse("n.pnml", text, dialect), text).getMessage();
    }

    @Test
    void theAttributesOfTapaalMakeTheNetThatTapaalMeans() {
        PetriNet net = Pnml.parse("n.pnml", TAPAAL);
        PetriNet expected = PetriNet.named("n").place("p", 1).place("q", 2)
            .transition("t").priority(5).inhibitor("p", 1).output("q").transition("u").input("q", 2).build();
        assertTrue(expected.isSameAs(net), net.arcs().toString());
        Reachability graph = Reachability.explore(net, 10);
        assertEquals(2, graph.size());
        assertEquals(Verdict.NO, graph.canFire(0));
    }

    @ParameterizedTest
    @CsvSource(delimiter = '|', value = {
        "<place id=\"p\"          | place p: attribute x=\"1\"; expected id, initialMarking and no other",
        "<transition id=\"t\"     | transition t: attribute x=\"1\"; expected id, priority and no other",
        "<arc id=\"a\"            | arc a: attribute x=\"1\"; expected id, source, target, type, inscription, weight and no other",
        "<page id=\"g\"           | page g: attribute x=\"1\"; expected id and no other",
        "<net id=\"n\"            | net n: attribute x=\"1\"; expected id, type and no other"})
    void anAttributeThatIsNotKnownIsRefusedInEachDialect(String element, String expected) {
        for (Dialect dialect : Dialect.values()) {
            assertTrue(refused(TAPAAL.replace(element, element + " x=\"1\""), dialect).contains(expected));
        }
        Pnml.parse("n.pnml", TAPAAL.replace(element, element + " xmlns:o=\"urn:other\" o:x=\"1\""));
    }

    @Test
    void anAttributeAndAnElementThatDisagreeAreRefused() {
        assertTrue(refused(TAPAAL.replace("initialMarking=\"2\"/>",
            "initialMarking=\"2\"><initialMarking><text>3</text></initialMarking></place>"), Dialect.STANDARD)
            .contains("place q: initial marking 2 and 3; expected one"));
        assertTrue(refused(TAPAAL.replace("inscription=\"2\"/>", "inscription=\"2\"><inscription><text>1</text></inscription></arc>"),
            Dialect.STANDARD).contains("arc c: weight 2 and 1; expected one"));
        assertTrue(refused(TAPAAL.replace("type=\"inhibitor\"/>", "type=\"inhibitor\"><type value=\"normal\"/></arc>"),
            Dialect.STANDARD).contains("arc a: arc type 'normal' beside another one; expected one"));
        assertTrue(refused(TAPAAL.replace("type=\"inhibitor\"", "type=\"transport\""), Dialect.STANDARD)
            .contains("arc a: arc type 'transport'; expected normal, inhibitor, test or read"));
        assertTrue(refused(TAPAAL.replace("priority=\"5\"/>", "priority=\"5\"><toolspecific tool=\"tickbus\" version=\"1\">"
            + "<priority>6</priority></toolspecific></transition>"), Dialect.STANDARD)
            .contains("transition t: priority '6' and '5'; expected one"));
    }

    @Test
    void anInhibitorArcIsWrittenWhereTapaalPipeAndPm4pyLook() {
        PetriNet net = PetriNet.named("n").place("p").transition("t").inhibitor("p", 2).build();
        assertTrue(Pnml.write(net).contains("target=\"t0\" type=\"inhibitor\"><inscription><text>2</text></inscription>"
            + "<type value=\"inhibitor\"/><arctype><text>inhibitor</text></arctype></arc>"), Pnml.write(net));
    }

    @Test
    void theCoreModelOfPromIsReadWithoutItsFinalMarkings() {
        assertTrue(refused(PROM, Dialect.STANDARD).contains("n.pnml:3: net net1: type 'http://www.pnml.org/version-2009/grammar/"
            + "pnmlcoremodel'; expected http://www.pnml.org/version-2009/grammar/ptnet; Dialect.ANY reads this one"));
        Imported prom = Pnml.parse("n.pnml", PROM, Dialect.ANY);
        assertTrue(PetriNet.named("x").place("start", 1).place("end").transition("tau").input("start").output("end").build()
            .isSameAs(prom.net()));
        assertEquals("mined", prom.net().name());
        assertEquals(List.of("n.pnml:3: net net1: type 'http://www.pnml.org/version-2009/grammar/pnmlcoremodel' is read as that of a "
            + "place/transition net", "n.pnml:16: net net1: the final markings are left out"), prom.warnings());
        assertTrue(refused(PROM.replace("<text>normal</text></arctype></arc>\n    </page>", "<text>reset</text></arctype></arc></page>")
            .replace("normal", "reset"), Dialect.ANY).contains("arc type 'reset'"));
    }

    @Test
    void theTypeOf2003IsRead() {
        Imported woped = Pnml.parse("n.pnml", WOPED, Dialect.ANY);
        assertTrue(PetriNet.named("x").place("p1", 1).transition("check").input("p1").build().isSameAs(woped.net()));
        assertEquals(1, woped.warnings().size());
    }

    @Test
    void theNetsOfPipeAreReadAndWhatIsLeftOutIsNamed() {
        Imported pipe = Pnml.parse("n.pnml", PIPE, Dialect.ANY);
        PetriNet expected = PetriNet.named("x").place("P0", 3).capacity(4).place("P1")
            .transition("T0").priority(2).input("P0", 2).inhibitor("P1", 1).output("P1").transition("T1").build();
        assertTrue(expected.isSameAs(pipe.net()), Pnml.write(pipe.net()));
        assertEquals(2, pipe.warnings().size());
        assertTrue(pipe.warnings().get(1).endsWith(
            "transition T1: timed by a rate, and read as an immediate transition of priority 0"), pipe.warnings().toString());
        assertTrue(refused(PIPE.replace("<labels", "<token id=\"Red\"/><labels"), Dialect.ANY)
            .contains("tokens 'Default' and 'Red'; expected one kind, as colours are not read"));
        assertTrue(refused(PIPE.replace("Default,3", "Default,3,Red,1"), Dialect.ANY).contains("expected a whole number"));
    }

    @Test
    void aColouredNetIsRefusedInEachDialect() {
        assertTrue(refused(TAPAAL.replace("grammar/ptnet", "grammar/symmetricnet"), Dialect.ANY).contains("; expected http://"));
        assertTrue(refused(TAPAAL.replace("<page id=\"g\">", "<declaration/><page id=\"g\">"), Dialect.ANY).contains("<declaration>"));
    }
}
