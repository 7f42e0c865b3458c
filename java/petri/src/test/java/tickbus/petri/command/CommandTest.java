package tickbus.petri.command;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.ByteArrayInputStream;
import java.io.ByteArrayOutputStream;
import java.io.IOException;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.petri.format.Pnml;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.sfc.Sfc;

class CommandTest {
    @TempDir
    Path folder;

    private Path net;
    private String out;
    private String err;

    @BeforeEach
    void write() throws IOException {
        PetriNet press = PetriNet.named("press").place("idle", 1).place("moving").place("guard open")
            .transition("start").input("idle").output("moving").inhibitor("guard open", 1)
            .transition("arrive").input("moving").output("idle").delay(Delay.fixed(1_500_000_000))
            .transition("open").output("guard open").inhibitor("guard open", 1).priority(1)
            .transition("close").input("guard open").build();
        net = Files.writeString(folder.resolve("press.pnml"), Pnml.write(press));
    }

    private int run(String input, String... args) {
        ByteArrayOutputStream printed = new ByteArrayOutputStream();
        ByteArrayOutputStream complained = new ByteArrayOutputStream();
        int code = Main.run(args, new ByteArrayInputStream(input.getBytes(StandardCharsets.UTF_8)),
            new PrintStream(printed, true, StandardCharsets.UTF_8), new PrintStream(complained, true, StandardCharsets.UTF_8));
        out = printed.toString(StandardCharsets.UTF_8);
        err = complained.toString(StandardCharsets.UTF_8);
        return code;
    }

    private int step(String... lines) {
        return run(String.join("\n", lines) + "\n", "step", net.toString());
    }

    @Test
    void aScriptFiresLooksAndTakesBack() {
        assertEquals(0, step("2", "why start", "undo", "start", "why arrive", "wait 0.5s", "marking",
            "wait", "fire arrive", "log"), () -> out + err);
        assertEquals("""
            net press: 3 places, 4 transitions, 8 arcs
            time 0 s, {idle}
              1  start  idle → moving
              2  open   → guard open, priority 1
            fired open
            time 0 s, {idle, guard open}
              1  close  guard open →
            start: place guard open has 1 token, and inhibits from 1 on
            took back 1
            time 0 s, {idle}
              1  start  idle → moving
              2  open   → guard open, priority 1
            fired start
            time 0 s, {moving}
              1  open  → guard open, priority 1
                 arrive in 1.5 s
            arrive: its delay is over in 1.5 s
            time 0.5 s, {moving}
              1  open  → guard open, priority 1
                 arrive in 1 s
            {moving}
            time 1.5 s, {moving}
              1  arrive  moving → idle
              2  open    → guard open, priority 1
            fired arrive
            time 1.5 s, {idle}
              1  start  idle → moving
              2  open   → guard open, priority 1
            1 0 start
            2 1500000000 arrive
            """, out.replace("\r", ""));
    }

    @Test
    void chanceIsTheSameForTheSameSeedAndTakenBackAsAWhole() {
        assertEquals(0, run("run 50\nlog\n", "step", net.toString(), "--seed", "4"));
        String first = out;
        assertEquals(0, run("run 50\nlog\n", "step", net.toString(), "--seed", "4"));
        assertEquals(first, out);
        assertTrue(out.contains("50 fired"), out);
        assertEquals(0, step("run 50", "undo 50", "log"));
        assertTrue(out.contains("took back"), out);
        assertTrue(out.contains("time 0 s, {idle}"), out);
    }

    @Test
    void theFirstMistakeOfAScriptEndsItWithItsLine() {
        for (String[] one : new String[][] {{"fire", "the name of a transition is missing"}, {"strat", "'strat' is neither a transition"},
                {"arrive", "cannot fire: place moving has no token; 1 needed"}, {"7", "there is no number 7; expected 1 to 2"},
                {"run", "expected a number from 1 on"}, {"run 0", "expected a number from 1 on"}, {"wait soon", "'soon' is no time"},
                {"undo", "there is no step to take back"}, {"draw", "draw needs a file"}, {"marking all", "'marking' stands alone"},
                {"wait", "nothing waits for the time"}, {"log " + folder + "/no/such/file", "there is no such folder"}}) {
            assertEquals(1, step("", one[0], "marking"), one[0]);
            assertTrue(err.startsWith("input:2: ") && err.contains(one[1]), err);
            assertTrue(!out.endsWith("{idle}\n"), out);
        }
    }

    @Test
    void aDeadlockIsSaidToBeOne() throws IOException {
        Path end = Files.writeString(folder.resolve("end.pnml"),
            Pnml.write(PetriNet.named("end").place("p", 1).transition("t").input("p").build()));
        assertEquals(0, run("run 5\n", "step", end.toString()));
        assertTrue(out.contains("1 fired; then nothing could") && out.contains("this is a deadlock"), out);
    }

    private static PetriNet independentCycles(int count) {
        NetBuilder net = PetriNet.named("cycles");
        for (int i = 0; i < count; i++) {
            net.place("a" + i, 1).place("b" + i).transition("go" + i).input("a" + i).output("b" + i)
                .transition("back" + i).input("b" + i).output("a" + i);
        }
        return net.build();
    }

    @Test
    void anAnalysisPrintsWhatIsProvenAndCanRequireIt() throws IOException {
        assertEquals(0, run("", "analyse", net.toString(), "--require", "bounded,safe,live,deadlock-free,reversible"), () -> out + err);
        for (String line : List.of("net          press: 3 places, 4 transitions, 8 arcs", "markings     4, with 7 firings",
                "bounded      yes; most tokens: 1 in idle, moving, guard open", "safe         yes", "deadlock     none",
                "live         yes", "can fire     all", "reversible   yes; 4 home states", "rank         2", "    idle + moving = 1",
                "    start + arrive", "    {idle, moving}", "    start and open, about guard open")) {
            assertTrue(out.lines().anyMatch(line::equals), line + " in\n" + out);
        }
        Path grows = Files.writeString(folder.resolve("grows.pnml"), Pnml.write(PetriNet.named("grows").place("a", 1).place("b")
            .transition("more").test("a", 1).output("b").transition("end").input("a").transition("never").input("a", 2).build()));
        assertEquals(1, run("", "analyse", grows.toString(), "--limit", "50", "--require", "bounded,live"));
        assertTrue(out.contains("gave up at 50") && out.contains("bounded      no; without bound: b"), out);
        assertTrue(out.contains("markings     gave up at 50: the limit of 50 markings"), out);
        Path many = Files.writeString(folder.resolve("many.pnml"), Pnml.write(independentCycles(20)));
        assertEquals(0, run("", "analyse", many.toString(), "--limit", "1000", "--require", "deadlock-free"), () -> out + err);
        assertTrue(out.contains("gave up at 1000") && out.contains("deadlock     none (stubborn sets: "), out);
        assertEquals(1, run("", "analyse", grows.toString(), "--limit", "50", "--require", "bounded,live"));
        assertEquals(grows + ": not proven to be bounded\n" + grows + ": not proven to be live\n", err.replace("\r", ""));
    }

    @Test
    void aDeadlockComesWithItsFirings() throws IOException {
        Path end = Files.writeString(folder.resolve("end.pnml"),
            Pnml.write(PetriNet.named("end").place("p", 2).transition("t").input("p").build()));
        assertEquals(1, run("", "analyse", end.toString(), "--require", "deadlock-free"));
        assertTrue(out.contains("deadlock     1 found; the nearest is {} after 2 firings: t, t"), out);
        assertTrue(out.contains("live         no; not live: t"), out);
    }

    @Test
    void aNetIsDrawnAndTurnedIntoAnotherFormat() throws IOException {
        assertEquals(0, run("", "draw", net.toString()));
        assertTrue(out.startsWith("<svg ") && out.contains("guard open"), out);
        assertEquals(0, run("", "draw", net.toString(), "--as", "dot"));
        assertTrue(out.startsWith("digraph "), out);
        Path again = folder.resolve("again.pnml");
        assertEquals(0, run("", "draw", net.toString(), "--as", "pnml", "--out", again.toString()));
        assertTrue(Pnml.read(again).isSameAs(Pnml.read(net)));
    }

    @Test
    void aNetIsWrittenForOtherToolsAndReadBack() throws IOException {
        for (String tool : List.of("tapaal", "prom", "pipe")) {
            Path file = folder.resolve(tool + ".pnml");
            assertEquals(0, run("", "draw", net.toString(), "--as", tool, "--out", file.toString()), () -> err);
            assertEquals(0, run("", "draw", file.toString(), "--as", "pnml"), () -> err);
            assertTrue(Pnml.parse("n", out).isSameAs(Pnml.read(net)), out);
        }
        assertEquals(1, run("", "draw", net.toString(), "--as", "woped"));
        assertTrue(err.contains("an inhibitor arc of weight 1; WoPeD has none"), err);
        assertEquals(1, run("", "draw", net.toString(), "--as", "tina"));
        assertTrue(err.contains("transition open: priority 1; it is not written for TINA"), err);
        Path plain = Files.writeString(folder.resolve("plain.pnml"), Pnml.write(PetriNet.named("plain").place("a", 1).place("b")
            .transition("t").delay(Delay.fixed(3_000_000)).input("a").output("b", 2).build()));
        Path lola = folder.resolve("plain.lola");
        assertEquals(0, run("", "draw", plain.toString(), "--as", "lola", "--out", lola.toString()), () -> err);
        assertEquals(0, run("", "analyse", lola.toString()));
        assertTrue(out.contains("markings     2, with 1 firing"), out);
        Path tina = folder.resolve("plain.net");
        assertEquals(0, run("", "draw", plain.toString(), "--as", "tina", "--unit", "500us", "--out", tina.toString()), () -> err);
        assertTrue(Files.readString(tina).contains("tr {t} [6,6] {a}*1 -> {b}*2"), Files.readString(tina));
        assertEquals(0, run("", "draw", tina.toString(), "--as", "pnml", "--unit", "500us"), () -> err);
        assertTrue(Pnml.parse("n", out).isSameAs(Pnml.read(plain)), out);
        assertEquals(0, run("", "draw", tina.toString()));
        assertTrue(err.contains("have no unit; they are taken as milliseconds"), err);
        assertEquals(2, run("", "draw", plain.toString(), "--unit", "1ms"));
        assertEquals(2, run("", "draw", plain.toString(), "--as", "apt"));
    }

    @Test
    void aChartIsReadAndWrittenInBothForms() throws IOException {
        Path mixer = Path.of("src/test/resources/sfc/mixer.xml");
        assertEquals(0, run("", "analyse", mixer.toString(), "--require", "safe,live"), () -> err);
        assertTrue(err.contains("conditions and actions of the chart are left out"), err);
        Path text = folder.resolve("mixer.st");
        assertEquals(0, run("", "draw", mixer.toString(), "--as", "sfc", "--out", text.toString()), () -> err);
        assertEquals("", err);
        assertEquals(0, run("", "draw", text.toString(), "--as", "plcopen"), () -> err);
        assertEquals(Sfc.read(mixer).text(), Sfc.parse("written.xml", out).text());
        Path plain = Files.writeString(folder.resolve("plain.pnml"), Pnml.write(PetriNet.named("plain").place("a", 1).place("b")
            .transition("go").delay(Delay.fixed(3_000_000)).input("a").output("b").build()));
        assertEquals(0, run("", "draw", plain.toString(), "--as", "sfc"), () -> err);
        assertTrue(out.contains("TRANSITION go FROM a TO b := a.T >= T#3ms; END_TRANSITION"), out);
        assertEquals(1, run("", "draw", net.toString(), "--as", "plcopen"));
        assertTrue(err.contains("transition open: no input arc"), err);
        assertEquals(2, run("", "draw", text.toString(), "--as", "sfc", "--unit", "1ms"));
    }

    @Test
    void hpsimsTextGetsItsDelaysByName() throws IOException {
        Path text = Files.writeString(folder.resolve("net.txt"), """
            // Transition Name Vector:
            (go ;)
            // Position Name Vector:
            (a;b;)
            // Inzidenz Matrix:
            {
            (1)
            (-1)
            }
            // Marking Vector:
            (1 0)
            // Arc Type Matrix:
            {
            (1)
            (1)
            }
            // Transition Time Model Vektor:
            (2 ;
            """);
        assertEquals(1, run("", "step", text.toString()));
        assertTrue(err.startsWith(text + ":") && err.contains("transition go") && err.contains("hand in a delay"), err);
        assertEquals(0, run("", "step", text.toString(), "--delay", "go=2s"));
        assertTrue(out.contains("go in 2 s"), out);
        assertEquals(1, run("", "step", text.toString(), "--delay", "go=2s", "--delay", "stop=1s"));
        assertTrue(err.contains("there is no transition 'stop'"), err);
    }

    @Test
    void aWrongFileIsNamedWithLineAndElement() throws IOException {
        assertEquals(1, run("", "analyse", folder.resolve("none.pnml").toString()));
        assertEquals(folder.resolve("none.pnml") + ": there is no such file", err.strip());
        Path wrong = Files.writeString(folder.resolve("wrong.pnml"),
            Files.readString(net).replace("source=\"p0\" target=\"t0\"", "source=\"p0\" target=\"nowhere\""));
        assertEquals(1, run("", "draw", wrong.toString()));
        assertTrue(err.matches("(?s).*wrong\\.pnml:\\d+: arc a\\d+: target 'nowhere' is not there; .*"), err);
    }

    @Test
    void aWrongCommandLineIsExplained() {
        String file = net.toString();
        for (String[] one : new String[][] {{}, {"stop", file}, {"step"}, {"step", file, file}, {"step", file, "--seed"},
                {"step", file, "--seed", "x"}, {"step", file, "--out", "x"}, {"draw", file, "--as", "png"},
                {"analyse", file, "--require", "fast"}, {"analyse", file, "--limit", "0"}, {"step", file, "--unit", "1ms"},
                {"step", file, "--delay", "start=1s"}, {"step", file, "--delay", "start"}, {"step", file, "--seed", "1", "--seed", "2"}}) {
            assertEquals(2, run("", one), () -> String.join(" ", one) + ": " + out + err);
            assertTrue(err.contains("usage: java -jar"), err);
        }
        assertEquals(0, run("", "--help"));
        assertTrue(out.startsWith("usage: "), out);
    }

    @Test
    @Tag("native")
    void thePageOfAStepperShowsEachStep() {
        assertEquals(0, run("start\n", "step", net.toString(), "--page"), () -> err);
        assertTrue(out.contains("page at http://127.0.0.1:"), out);
        assertEquals(1, run("", "step", net.toString(), "--page", "nowhere.invalid:1"));
        assertTrue(err.contains("nowhere.invalid"), err);
    }
}
