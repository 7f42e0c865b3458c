package tickbus.petri.format;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.junit.jupiter.api.Assumptions.assumeTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.TimeUnit;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import org.junit.jupiter.params.provider.EnumSource;
import tickbus.petri.RandomNets;
import tickbus.petri.analysis.Reachability;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.PlaceStep;
import tickbus.petri.run.Draws;

/** Nets from and for other tools: read as those tools mean them, written as those tools read them. */
class DialectsTest {
    private static final int NETS = 20;
    private static final int LIMIT = 150;

    @TempDir
    Path folder;

    /** A net of {@link RandomNets}, with what the tool has of it. */
    private static PetriNet drawn(Draws random, ForeignFiles of) {
        PetriNet any = RandomNets.any(random, 4, 4);
        NetBuilder builder = PetriNet.named("net");
        any.places().forEach(place -> {
            PlaceStep made = builder.place(place.name(), place.initial());
            if (of.hasCapacities && place.isLimited()) {
                made.capacity(place.capacity());
            }
        });
        any.transitions().forEach(transition -> builder.transition(transition.name()));
        any.arcs().stream()
            .filter(arc -> arc.kind() != ArcKind.INHIBITOR || of.hasInhibitors)
            .filter(arc -> arc.kind() != ArcKind.TEST || of == ForeignFiles.TINA)
            .forEach(arc -> builder.arc(arc.kind(), any.place(arc.place()).name(), any.transition(arc.transition()).name(),
                of == ForeignFiles.PROM && arc.kind() == ArcKind.INHIBITOR ? 1 : arc.weight()));
        return builder.build();
    }

    private static Imported read(ForeignFiles of, String text) {
        String source = "n" + of.ending;
        return of == ForeignFiles.LOLA ? Lola.parse(source, text) : of == ForeignFiles.TINA ? Tina.parse(source, text, 1)
            : Pnml.parse(source, text, Dialect.ANY);
    }

    private static String write(ForeignFiles of, PetriNet net) {
        return switch (of) {
            case TAPAAL, TAPAAL_PROJECT -> Pnml.write(net, Dialect.TAPAAL);
            case PROM -> Pnml.write(net, Dialect.PROM);
            case WOPED -> Pnml.write(net, Dialect.WOPED);
            case PIPE -> Pnml.write(net, Dialect.PIPE);
            case LOLA -> Lola.write(net);
            case TINA -> Tina.write(net, 1);
        };
    }

    private static String counts(PetriNet net) {
        Reachability graph = Reachability.explore(net, LIMIT);
        return graph.isComplete() ? graph.size() + " " + graph.edges() + " " + graph.deadlocks().size() : "more";
    }

    @ParameterizedTest
    @EnumSource
    void netsFromAndForAToolAreTheSameToAnotherReader(ForeignFiles of) throws Exception {
        Draws random = new Draws(1962 + of.ordinal());
        List<String> expected = new ArrayList<>();
        List<String> command = new ArrayList<>(List.of("python3",
            Path.of(System.getProperty("tickbus.root", "../.."), "tests/peers/petri_dialects.py").toString(), "" + LIMIT));
        for (int drawn = 0; expected.size() < 2 * NETS; drawn++) {
            PetriNet net = drawn(random, of);
            String counts = counts(net);
            if (counts.equals("more") && drawn % 8 != 0 || counts.startsWith("1 ")) {
                continue;
            }
            PetriNet read = read(of, of.write(net)).net();
            // TINA's places are in the order in which transitions name them.
            assertTrue(of == ForeignFiles.TINA ? sorted(net).isSameAs(sorted(read)) : net.isSameAs(read), () -> of.write(net));
            PetriNet back = read(of, write(of, net)).net();
            assertTrue(net.isSameAs(back), () -> write(of, net));
            for (String text : List.of(of.write(net), write(of, net))) {
                command.add(Files.writeString(folder.resolve(expected.size() + of.ending), text).toString());
                expected.add(counts);
            }
        }
        assertEquals(expected, answers(command));
    }

    /** Places by name; transitions keep their order. */
    private static PetriNet sorted(PetriNet net) {
        NetBuilder builder = PetriNet.named(net.name());
        net.places().stream().sorted((a, b) -> a.name().compareTo(b.name())).forEach(one -> builder.place(one.name(), one.initial()));
        net.transitions().forEach(one -> builder.transition(one.name()));
        net.arcs().forEach(arc -> builder.arc(arc.kind(), net.place(arc.place()).name(), net.transition(arc.transition()).name(), arc.weight()));
        return builder.build();
    }

    private List<String> answers(List<String> command) throws IOException, InterruptedException {
        Path output = folder.resolve("output");
        Process reader;
        try {
            reader = new ProcessBuilder(command).redirectErrorStream(true).redirectOutput(output.toFile()).start();
        } catch (IOException e) {
            assumeTrue(false, "there is no python3: " + e.getMessage());
            return List.of();
        }
        assertTrue(reader.waitFor(120, TimeUnit.SECONDS), "the other reader does not come to an end");
        return Files.readAllLines(output);
    }

    @Test
    void testArcsAndCapacitiesBecomeWhatAToolHas() throws Exception {
        PetriNet net = PetriNet.named("n & m").place("a b", 2).capacity(3).place("PLACE", 1).place("q")
            .transition("t").test("a b", 2).input("a b").output("a b").inhibitor("q", 2).output("q")
            .transition("u-1").input("PLACE").output("a b", 2).output("PLACE").test("q", 1)
            .transition("v").input("a b", 2)
            .build();
        String expected = counts(net);
        List<String> command = new ArrayList<>(List.of("python3",
            Path.of(System.getProperty("tickbus.root", "../.."), "tests/peers/petri_dialects.py").toString(), "" + LIMIT));
        for (ForeignFiles of : List.of(ForeignFiles.TAPAAL, ForeignFiles.PIPE, ForeignFiles.TINA)) {
            String text = write(of, net);
            assertEquals(expected, counts(read(of, text).net()), text);
            command.add(Files.writeString(folder.resolve("own-" + of + of.ending), text).toString());
        }
        PetriNet tests = PetriNet.named("n").place("a b", 2).place("PLACE").place("PLACE_1").transition("t 1").test("a b", 2).output("PLACE")
            .transition("t_1").input("PLACE", 3).output("PLACE_1").transition("v").inhibitor("PLACE_1", 1).input("a b").build();
        assertEquals("net n: place PLACE_1, transition v: an inhibitor arc of weight 1; LoLA has none", refused(() -> Lola.write(tests)));
        assertEquals("net n & m: place q, transition t: an inhibitor arc of weight 2; WoPeD has none\nplace a b, transition u-1: a "
            + "capacity of 3; WoPeD has none", refused(() -> Pnml.write(net, Dialect.WOPED)));
        assertTrue(refused(() -> Pnml.write(net, Dialect.PROM)).contains("an inhibitor arc of weight 2; pm4py has only those of weight 1"));
        assertEquals(List.of(expected, expected, expected), answers(command));
    }

    @Test
    void namesThatLolaCannotHoldGetANumber() {
        PetriNet net = PetriNet.named("{n}").place("a b", 1).delay(7).place("PLACE").place("_PLACE_1").transition("t.1").priority(2)
            .input("a b").output("PLACE", 2).transition("t").build();
        String text = Lola.write(net);
        assertTrue(text.startsWith("{ _n_ }\n{ _a_b_0: delay 7 ns }\nPLACE _a_b_0, _PLACE_1_2, _PLACE_1;\nMARKING _a_b_0: 1;\n{ _t_1_0: priority 2, "), text);
        assertTrue(text.endsWith("TRANSITION t\nCONSUME ;\nPRODUCE ;\n"), text);
        assertEquals(counts(net), counts(Lola.parse("n.lola", text).net()));
    }

    @Test
    void theIntervalsOfTinaAreDelays() {
        Imported tina = Tina.parse("n.net", "tr a [5,5] p -> q\ntr b ]2,4[ q*2K -> p\ntr c [3,w[ p?2 r?-1 ->\ntr d [0,w[ -> \npl p (1M) a -> d*2\n", 10);
        PetriNet net = tina.net();
        assertEquals(List.of(Delay.fixed(50), Delay.uniform(20, 40), Delay.fixed(30), Delay.NONE),
            net.transitions().stream().map(one -> one.delay()).toList());
        assertEquals(1_000_000, net.place("p").initial());
        assertEquals(2, net.pre()[net.place("p").index()][net.transition("d").index()]);
        assertEquals(1, net.post()[net.place("p").index()][net.transition("a").index()]);
        assertEquals(List.of("n.net:2: transition b: its interval is read with its bounds",
            "n.net:3: transition c: it may fire at any time from 3 on, and is read to fire then"), tina.warnings());
        assertTrue(net.isSameAs(Tina.parse("m", Tina.write(net, 10), 10).net()));
        assertTrue(refused(() -> Tina.write(net, 100)).contains("transition a: a delay of 50 ns in units of 100 ns"));
    }

    private static String refused(org.junit.jupiter.api.function.Executable what) {
        return assertThrows(NetException.class, what).getMessage();
    }

    @ParameterizedTest
    @CsvSource(delimiter = '|', quoteCharacter = '"', value = {
        "tr t p!2 -> q                       | n.net:1: transition t: a stopwatch arc; expected a net without",
        "tr t p\\n q                         | n.net:2: transition t: nodes without ->; expected inputs -> outputs",
        "pl p\\npr t > u                     | n.net:2: pr: a priority between transitions; expected a net without",
        "tr t [5,3] ->                       | n.net:1: transition t: an interval from 5 to 3; expected the earliest time first",
        "tr t p*0 ->                         | n.net:1: transition t: weight 0; expected 1 to 2147483647",
        "pl p (3000M)                        | n.net:1: place p: marking 3000M; expected at most 2147483647",
        "pl p (1)\\npl p (2)                 | n.net:2: place p: marked with 1 and with 2; expected one marking",
        "place p                             | n.net:1: 'place'; expected net, tr, pl, lb or nt",
        "tr {t                               | n.net:1: transition: '{'; expected a name"})
    void aNetThatTinaMeansOtherwiseIsRefused(String text, String expected) {
        assertEquals(expected, refused(() -> Tina.parse("n.net", text.replace("\\n", "\n"), 1)));
    }

    @ParameterizedTest
    @CsvSource(delimiter = '|', quoteCharacter = '"', value = {
        "SORT colour                                                    | n.lola:1: 'SORT'; expected PLACE, as in a place/transition net of LoLA",
        "PLACE a, a; MARKING ;                                          | n.lola:1: place a: given twice; expected a name of its own",
        "PLACE a;\\n MARKING b;                                         | n.lola:2: marking: there is no place 'b'",
        "PLACE a; MARKING a: x;                                         | n.lola:1: marking: number 'x'; expected a whole number",
        "PLACE a; MARKING a\\n TRANSITION t CONSUME; PRODUCE;           | n.lola:2: marking: 'TRANSITION'; expected , or ;",
        "PLACE a; MARKING ; TRANSITION t CONSUME a;                     | n.lola:1: 'the end'; expected PRODUCE",
        "PLACE a; MARKING ; TRANSITION t CONSUME a: 2147483647, a;PRODUCE; | n.lola:1: arc of transition t: the arcs between p:a and t:t weigh more than 2147483647 together"})
    void aTextThatIsNoNetOfLolaIsRefused(String text, String expected) {
        assertEquals(expected, refused(() -> Lola.parse("n.lola", text.replace("\\n", "\n"))));
    }

    @ParameterizedTest
    @CsvSource(delimiter = '|', quoteCharacter = '\'', value = {
        "invariant=\"&lt; inf\"    | invariant=\"&lt;= 5\"       | invariant '<= 5': a net with ages; expected '< inf'",
        "inscription=\"[0,inf)\"   | inscription=\"[1,inf)\"     | interval '[1,inf)': a net with ages; expected '[0,inf)'",
        "type=\"timed\"            | type=\"aged\"               | arc type 'aged'; expected normal, inhibitor, test or read",
        "<constant                 | <shared-place               | pnml: <shared-place>: components that share nodes; expected one net. Compose them in TAPAAL, and export the result as PNML",
        "infiniteServer            | player                      | attribute player=\"false\"; expected id, priority and no other"})
    void aTapaalProjectWithMoreThanANetIsRefused(String part, String by, String expected) {
        PetriNet net = PetriNet.named("n").place("p", 1).place("q").transition("t").input("p").output("q").build();
        String text = ForeignFiles.TAPAAL_PROJECT.write(net).replace(part, by);
        String refused = refused(() -> Pnml.parse("n.xml", text, Dialect.ANY));
        assertTrue(refused.endsWith(expected), refused);
        assertThrows(NetException.class, () -> Pnml.parse("n.xml", ForeignFiles.TAPAAL_PROJECT.write(net)));
    }

    @Test
    void theComposedNetsOfTapaalHaveArcsOfTheirOwn() {
        String text = """
            <pnml><net id="ComposedModel" type="P/T net">
            <place id="P0" name="P0" invariant="&lt; inf" initialMarking="3"/><place id="P1" name="P1" invariant="&lt; inf" initialMarking="0"/>
            <transition id="T0" name="T0"/><inputArc inscription="[0,inf)" source="P0" target="T0"/>
            <outputArc inscription="2" source="T0" target="P1"/>
            <inhibitorArc inscription="[0,inf)" source="P1" target="T0"><inscription><value>4</value></inscription></inhibitorArc>
            </net></pnml>
            """;
        PetriNet expected = PetriNet.named("x").place("P0", 3).place("P1").transition("T0").input("P0").output("P1", 2).inhibitor("P1", 4).build();
        assertTrue(expected.isSameAs(Pnml.parse("n.xml", text, Dialect.ANY).net()));
        assertTrue(refused(() -> Pnml.parse("n.xml", text, Dialect.STANDARD)).contains("type 'P/T net'"));
        assertTrue(refused(() -> Pnml.parse("n.xml", text.replace("P/T net", Pnml.TYPE).replaceAll(" name=\"..\" invariant=\"&lt; inf\"| name=\"T0\"", "")))
            .contains("<inputArc>"));
    }

    @Test
    void anIdOfTwoArcsIsForgivenUnlessTheyMayBeOne() {
        PetriNet net = PetriNet.named("n").place("p", 1).place("q").transition("t").input("p").output("q").build();
        String text = ForeignFiles.WOPED.write(net);
        Imported woped = Pnml.parse("n.pnml", text, Dialect.WOPED);
        assertTrue(net.isSameAs(woped.net()));
        assertTrue(woped.warnings().get(1).endsWith("arc a0: its id is given twice"), woped.warnings().toString());
        String twice = refused(() -> Pnml.parse("n.pnml", text.replace("source=\"t\" target=\"q\"", "source=\"p\" target=\"t\""), Dialect.ANY));
        assertTrue(twice.endsWith("arc a0: given twice, p to t; expected an id of its own for each arc"), twice);
    }
}
