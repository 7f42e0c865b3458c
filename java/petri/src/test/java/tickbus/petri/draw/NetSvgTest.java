package tickbus.petri.draw;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.StringReader;
import java.util.ArrayList;
import java.util.List;
import java.util.Optional;
import java.util.stream.IntStream;
import javax.xml.parsers.DocumentBuilderFactory;
import org.junit.jupiter.api.Test;
import org.w3c.dom.Element;
import org.w3c.dom.NodeList;
import org.xml.sax.InputSource;
import tickbus.petri.RandomNets;
import tickbus.petri.Samples;
import tickbus.petri.format.Pnml;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Marking;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Draws;

class NetSvgTest {
    private static final String PLACED = """
        <pnml><net id="n" type="http://www.pnml.org/version-2009/grammar/ptnet"><page id="g">
        <place id="a"><graphics><position x="10" y="20"/></graphics></place>
        <place id="b"><graphics><position x="50" y="20"/></graphics></place>
        <transition id="t"><graphics><position x="30" y="20"/></graphics></transition>
        <arc id="1" source="a" target="t"><graphics><position x="10" y="40"/><position x="30" y="40"/></graphics></arc>
        <arc id="2" source="t" target="b"/><arc id="3" source="b" target="t"/>
        </page></net></pnml>
        """;

    /** The elements of a class, in their order. */
    private static List<Element> all(String svg, String kind) throws Exception {
        DocumentBuilderFactory factory = DocumentBuilderFactory.newInstance();
        Element root = factory.newDocumentBuilder().parse(new InputSource(new StringReader(svg))).getDocumentElement();
        List<Element> found = new ArrayList<>();
        NodeList every = root.getElementsByTagName("*");
        for (int i = 0; i < every.getLength(); i++) {
            Element one = (Element) every.item(i);
            if (List.of(one.getAttribute("class").split(" ")).contains(kind)) {
                found.add(one);
            }
        }
        return found;
    }

    @Test
    void thePapersNetHasAllItsNodesArcsAndItsToken() throws Exception {
        PetriNet net = Samples.paper();
        String svg = NetSvg.write(net);
        assertEquals(5, all(svg, "net-place").size());
        assertEquals(4, all(svg, "net-transition").size());
        assertEquals(net.arcs().size(), all(svg, "net-arc").size());
        assertEquals(net.arcs().size(), all(svg, "net-head").size());
        assertEquals(1, all(svg, "net-dot").size());
        assertEquals(List.of("0"), all(svg, "net-enabled").stream().map(one -> one.getAttribute("data-transition")).toList());
        Marking next = net.initialMarking();
        net.fire(next, 0);
        String after = NetSvg.write(net, next);
        assertEquals(2, all(after, "net-dot").size());
        assertEquals(List.of("1", "2"), all(after, "net-enabled").stream().map(one -> one.getAttribute("data-transition")).toList());
        assertEquals(svg, NetSvg.write(Samples.paper()), "the same net does not look the same");
    }

    @Test
    void fiveTokensAreDotsAndSixANumber() throws Exception {
        PetriNet net = PetriNet.named("n").place("p").build();
        for (int count = 0; count < 8; count++) {
            String svg = NetSvg.write(net, net.marking(count));
            assertEquals(count > 5 ? 0 : count, all(svg, "net-dot").size());
            assertEquals(count > 5 ? List.of(Integer.toString(count)) : List.of(),
                all(svg, "net-number").stream().map(Element::getTextContent).toList());
        }
    }

    @Test
    void everyKindOfArcAndNodeIsShownAndNamesAreEscaped() throws Exception {
        String svg = NetSvg.write(Samples.everything());
        assertEquals(2, all(svg, "net-ring").size());
        assertEquals(1, all(svg, "net-test").size());
        assertEquals(3, all(svg, "net-timed").size());
        assertTrue(svg.contains("stop &amp; &lt;go&gt;"), svg);
        assertFalse(svg.contains("<go>"), svg);
        assertTrue(svg.contains(">2</text>"), "the weight of an arc");
        String quoted = NetSvg.write(PetriNet.named("\" onload=\"alert(1)").place("p").build());
        assertTrue(quoted.contains("aria-label=\"net &quot; onload=&quot;alert(1)\""), quoted);
    }

    @Test
    void aDrawingOfTheFileIsKeptWithItsBends() {
        PetriNet net = Pnml.parse("n.pnml", PLACED);
        Layout layout = Layout.of(net);
        assertFalse(layout.curved);
        assertEquals(layout.y[0], layout.y[1]);
        // The nearest nodes are 20 apart in the file and 64 in the drawing.
        assertEquals(64, layout.x[2] - layout.x[0], 1e-9);
        assertEquals(128, layout.x[1] - layout.x[0], 1e-9);
        assertArrayEquals(new double[] {layout.x[0], layout.y[0] + 16, layout.x[0], layout.y[0] + 64, layout.x[2],
            layout.y[0] + 64, layout.x[2], layout.y[0] + 14}, layout.routes[0], 1e-9);
        // The arcs in both directions between b and t, on both sides of the straight line.
        assertTrue((layout.routes[1][3] - layout.y[0]) * (layout.routes[2][3] - layout.y[0]) < 0);
        PetriNet back = Pnml.parse("back.pnml", Pnml.write(net));
        assertEquals(NetSvg.write(net), NetSvg.write(back).replace("net back", "net n"));
    }

    @Test
    void positionsThatMakeNoDrawingAreNotUsed() {
        double width = Layout.of(Pnml.parse("n", PLACED.replaceAll("<graphics>.*?</graphics>", ""))).width;
        for (String at : List.of("10", "1e9", "NaN", "1e308")) {
            Layout layout = Layout.of(Pnml.parse("n", PLACED.replace("x=\"50\"", "x=\"" + at + "\"")));
            assertTrue(layout.curved, "a node on top of another, or far away: " + at);
            assertEquals(width, layout.width, at);
        }
        assertEquals(Optional.empty(), Pnml.parse("n", PLACED.replace("x=\"50\"", "x=\"right\"")).positions(), "no figure");
        assertEquals(Optional.empty(), Pnml.parse("n", PLACED.replace("<position x=\"50\" y=\"20\"/>", "")).positions(), "a node without");
        String pages = PLACED.replace("<transition", "</page><page id=\"h\"><transition");
        assertEquals(Optional.empty(), Pnml.parse("n", pages).positions(), "two pages, each with coordinates of its own");
    }

    @Test
    void nodesOfALayoutNeverLieUponEachOtherAndArcsRunDownwardsUnlessTheyGoBack() {
        Draws random = new Draws(7);
        for (int i = 0; i < 60; i++) {
            PetriNet net = RandomNets.any(random, 9, 9);
            Layout layout = Layout.of(net);
            for (int a = 0; a < layout.x.length; a++) {
                assertTrue(layout.x[a] >= 16 && layout.x[a] + layout.labelWidth(a) <= layout.width, "within the picture");
                assertTrue(layout.y[a] >= 16 && layout.y[a] <= layout.height, "within the picture");
                for (int b = a + 1; b < layout.x.length; b++) {
                    assertTrue(Math.abs(layout.y[a] - layout.y[b]) > 30 || Math.abs(layout.x[a] - layout.x[b]) > 30,
                        net + ": nodes " + a + " and " + b);
                }
            }
            for (int a = 0; a < net.arcs().size(); a++) {
                Arc arc = net.arcs().get(a);
                double run = layout.y[layout.target(arc)] - layout.y[layout.source(arc)];
                assertTrue(run != 0, "an arc along a row");
                boolean toMarked = arc.kind() == ArcKind.OUTPUT && net.place(arc.place()).initial() > 0;
                assertTrue(!toMarked || run < 0, "an arc to a marked place goes back to it");
            }
        }
    }

    @Test
    void aLongNameIsBrokenOrShortenedAndStaysWholeInTheTip() {
        String name = "transport cylinder extended";
        Layout layout = Layout.of(PetriNet.named("n").place(name).place("x".repeat(60)).build());
        assertEquals(List.of("transport", "cylinder extended"), layout.label(0));
        assertEquals(List.of("x".repeat(27) + "…"), layout.label(1));
        assertTrue(NetSvg.write(layout.net).contains("<title>" + "x".repeat(60)));
    }

    @Test
    void aNetWithNothingAndARingOfThousandsAreDrawn() throws Exception {
        assertTrue(NetSvg.write(PetriNet.named("empty").build()).endsWith("</svg>\n"));
        assertEquals(2000, all(NetSvg.write(Samples.ring(2000)), "net-place").size());
    }

    @Test
    void aNetWithTooManyBendsToDrawIsDrawnWithoutThem() throws Exception {
        int length = 300;
        String[] high = IntStream.range(0, 80).mapToObj(i -> "high " + i).toArray(String[]::new);
        String[] low = IntStream.range(0, high.length).mapToObj(i -> "low " + i).toArray(String[]::new);
        NetBuilder builder = PetriNet.named("long").place("0", 1);
        for (String place : high) {
            builder.place(place);
        }
        for (String place : low) {
            builder.place(place);
        }
        builder.transition("begin").input("0").output(high).output("1").place("1");
        for (int i = 1; i < length; i++) {
            builder.place("" + (i + 1)).transition("step " + i).input("" + i).output("" + (i + 1));
        }
        builder.transition("end").input("" + length).output(low);
        for (int i = 0; i < high.length; i++) {
            // Over about 600 rows, most of which are narrow, and the last of which is wide.
            builder.transition("join " + i).input(high[i], low[i]);
        }
        PetriNet net = builder.build();
        assertEquals(net.arcs().size(), all(NetSvg.write(net), "net-arc").size());
        Layout layout = Layout.of(net);
        assertEquals(5.0 * (high.length + 1), layout.halfWidth[net.transition("begin").index()], "room for its arcs");
    }
}
