package tickbus.petri.sfc;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.junit.jupiter.api.Assumptions.assumeTrue;

import java.io.File;
import java.io.IOException;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.TimeUnit;
import java.util.stream.Collectors;
import java.util.stream.Stream;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.run.Draws;

/** Charts run as nets beside the same charts compiled by iec2c, the compiler of OpenPLC and Beremiz: the outputs of each scan are equal. */
class CompiledByIec2cTest {
    private static final int SCANS = 2_000;
    private static final String VARIABLES = """
          VAR
            a AT %IX0.0 : BOOL;
            b AT %IX0.1 : BOOL;
            c AT %IX0.2 : BOOL;
            u AT %QX0.0 : BOOL;
            v AT %QX0.1 : BOOL;
            w AT %QX0.2 : BOOL;
            x AT %QX0.3 : BOOL;
            y AT %QX0.4 : BOOL;
            z AT %QX0.5 : BOOL;
            n AT %QW0 : INT;
            m AT %QW1 : INT := 5;
          END_VAR
        """;

    @TempDir
    Path folder;

    @Test
    void aSequenceWithTimesAndAJumpBack() throws Exception {
        compare("""
              INITIAL_STEP idle: u(N); END_STEP
              STEP fill: v(N); w(D, T#30ms); END_STEP
              STEP stir: x(L, T#25ms); count(N); y(N); END_STEP
              ACTION count: n := n + 1; m := (n * 3 - m) MOD 17; END_ACTION
              TRANSITION start FROM idle TO fill := a AND NOT b; END_TRANSITION
              TRANSITION full FROM fill TO stir := fill.T >= T#50ms OR (b & c); END_TRANSITION
              TRANSITION again (PRIORITY := 1) FROM stir TO fill := stir.T > T#20ms AND c; END_TRANSITION
              TRANSITION done (PRIORITY := 2) FROM stir TO idle := stir.T > T#60ms AND NOT fill.X; END_TRANSITION
            """);
    }

    @Test
    void selectionsByPriority() throws Exception {
        compare("""
              INITIAL_STEP choose: END_STEP
              STEP left: u(N); END_STEP
              STEP middle: v(N); see(P); END_STEP
              STEP right: w(N); leave(P0); END_STEP
              STEP joined: x(N); END_STEP
              ACTION see: n := n + 1; END_ACTION
              ACTION leave: IF a THEN m := m + 1; ELSIF b XOR c THEN m := m - 1; ELSE y := NOT y; END_IF; END_ACTION
              TRANSITION (PRIORITY := 3) FROM choose TO left := a; END_TRANSITION
              TRANSITION (PRIORITY := 1) FROM choose TO middle := b; END_TRANSITION
              TRANSITION (PRIORITY := 2) FROM choose TO right := c; END_TRANSITION
              TRANSITION FROM left TO joined := NOT a; END_TRANSITION
              TRANSITION FROM middle TO joined := NOT b; END_TRANSITION
              TRANSITION FROM right TO joined := NOT c; END_TRANSITION
              TRANSITION FROM joined TO choose := TRUE; END_TRANSITION
            """);
    }

    @Test
    void simultaneousSequences() throws Exception {
        compare("""
              INITIAL_STEP rest: z(N); END_STEP
              STEP one: u(N); END_STEP
              STEP oneDone: END_STEP
              STEP two: v(N); END_STEP
              STEP three: w(N); END_STEP
              STEP twoDone: x(N); END_STEP
              ACTION unused: n := n + 1; END_ACTION
              TRANSITION fork FROM rest TO (one, two) := a; END_TRANSITION
              TRANSITION FROM one TO oneDone := b; END_TRANSITION
              TRANSITION FROM two TO three := c OR two.T > T#70ms; END_TRANSITION
              TRANSITION FROM three TO twoDone := three.T >= T#30ms AND oneDone.X; END_TRANSITION
              TRANSITION meet FROM (oneDone, twoDone) TO rest := NOT a; END_TRANSITION
            """);
    }

    @Test
    void theQualifiersOfActions() throws Exception {
        compare("""
              INITIAL_STEP rest: u(R); everyScan(R); END_STEP
              STEP one: u(S); v(P); w(L, T#40ms); x(D, T#40ms); everyScan(S); END_STEP
              STEP two: y(SD, T#60ms); z(SL, T#35ms); END_STEP
              STEP three: once(P1); last(P0); late(DS, T#25ms); END_STEP
              STEP four: y(R); z(R); late(R); END_STEP
              ACTION everyScan: n := n + 1; END_ACTION
              ACTION once: m := m + 10; END_ACTION
              ACTION last: m := m - 7; END_ACTION
              ACTION late: m := m + 1; END_ACTION
              TRANSITION FROM rest TO one := a; END_TRANSITION
              TRANSITION FROM one TO two := b; END_TRANSITION
              TRANSITION FROM two TO three := c AND two.T > T#70ms; END_TRANSITION
              TRANSITION FROM three TO four := a; END_TRANSITION
              TRANSITION FROM four TO rest := b; END_TRANSITION
            """);
    }

    /** Beremiz made the text of the same project. */
    @Test
    void aProjectInPlcopenXml() throws Exception {
        Path project = Path.of("src/test/resources/sfc/mixer.xml");
        compare(Files.readString(project.resolveSibling("mixer.st")), Sfc.read(project));
    }

    /** The text that is written of a chart runs as the chart did, and that of a net as the net. */
    @Test
    void whatIsWrittenOfAChart() throws Exception {
        Sfc mixer = Sfc.read(Path.of("src/test/resources/sfc/mixer.xml"));
        compare(mixer.text(), mixer);
    }

    @Test
    void whatIsWrittenOfANet() throws Exception {
        Sfc chart = Sfc.of(WrittenTest.PRESS);
        compare(chart.text(), chart);
    }

    private void compare(String chart) throws Exception {
        String program = "PROGRAM chart\n" + VARIABLES + chart + "END_PROGRAM\n";
        compare(program + """
            CONFIGURATION config
              RESOURCE res ON PLC
                TASK t(INTERVAL := T#10ms, PRIORITY := 0);
                PROGRAM p WITH t : chart;
              END_RESOURCE
            END_CONFIGURATION
            """, Sfc.parse("chart.st", program));
    }

    /** Compares a text that iec2c compiles with a chart that runs here. */
    private void compare(String text, Sfc read) throws Exception {
        Path compiler = compiler();
        Path library = compiler.resolveSibling("lib");
        assumeTrue(Files.isRegularFile(library.resolve("ieclib.txt")), "iec2c has no library beside it");
        Path file = Files.writeString(folder.resolve("chart.st"), text);
        run(compiler.toString(), "-f", "-l", "-p", "-I", library.toString(), "-T", folder.toString(), file.toString());
        Files.writeString(folder.resolve("main.c"), main(read, Sfc.parse("chart.st", text).net()));
        run("cc", "-w", "-I", folder.toString(), "-I", library.resolve("C").toString(), "-o",
            folder.resolve("main").toString(), folder.resolve("main.c").toString(), "-lm");
        Draws random = new Draws(text.hashCode());
        StringBuilder inputs = new StringBuilder();
        List<String> got = new ArrayList<>();
        SfcController net = read.start();
        long now = 0;
        int fired = 0;
        String names = "abc";
        int[] values = {0, 0, 0};
        for (int scan = 0; scan < SCANS; scan++) {
            now += scan == 0 ? 0 : 1_000_000L * (5 + random.below(10));
            values[random.below(3)] = random.below(2);
            inputs.append(now);
            for (int i = 0; i < 3; i++) {
                inputs.append(' ').append(values[i]);
                if (!read.variables().isEmpty()) {
                    net.set(names.substring(i, i + 1), values[i]);
                }
            }
            inputs.append('\n');
            fired += net.scan(now);
            got.add(String.join(" ", Stream.concat(
                read.variables().stream().filter(one -> !one.isInput()).map(one -> "" + net.get(one.name())),
                read.net().places().stream().map(one -> "" + net.coordinator().tokens(one.index()))).toList()));
        }
        Files.writeString(folder.resolve("inputs"), inputs);
        List<String> wanted = run(folder.resolve("main").toString(), folder.resolve("inputs").toString()).lines().toList();
        assertEquals(SCANS, wanted.size());
        for (int scan = 0; scan < SCANS; scan++) {
            assertEquals(wanted.get(scan), got.get(scan), "scan " + scan + ", inputs " + inputs.toString().lines().toList().get(scan));
        }
        assertTrue(fired > SCANS / 20, fired + " firings are too few to compare anything");
        assertTrue(got.stream().distinct().count() > 4, "the outputs hardly changed");
    }

    /** The main program for the steps of {@code compiled}, which can have another order than those of the chart. */
    private static String main(Sfc chart, PetriNet compiled) {
        StringBuilder prints = new StringBuilder();
        StringBuilder inputs = new StringBuilder();
        for (Variable one : chart.variables()) {
            String name = "_" + one.location().replace("%", "_").replace('.', '_') + "_";
            prints.append(one.isInput() ? "" : "    printf(\"%d \", (int)" + name + ");\n");
            inputs.append(one.isInput() ? "    " + name + " = " + one.name() + ";\n" : "");
        }
        for (Place step : chart.net().places()) {
            prints.append("    printf(\"%d \", (int)p.__step_list[").append(compiled.place(step.name()).index()).append("].X.value);\n");
        }
        return """
            #include <stdio.h>
            #include "iec_std_lib.h"
            TIME __CURRENT_TIME;
            BOOL __DEBUG;
            #define __LOCATED_VAR(type, name, ...) type name##_; type *name = &name##_;
            #include "LOCATED_VARIABLES.h"
            #include "POUS.h"
            #include "POUS.c"
            static CHART p;
            int main(int count, char **words) {
                FILE *in = fopen(words[1], "r");
                long long now;
                int a, b, c;
                CHART_init__(&p, 0);
                while (fscanf(in, "%lld %d %d %d", &now, &a, &b, &c) == 4) {
                    __CURRENT_TIME.tv_sec = now / 1000000000;
                    __CURRENT_TIME.tv_nsec = now % 1000000000;
            """ + inputs + """
                    CHART_body__(&p);
            """ + prints + """
                    printf("\\n");
                }
                return 0;
            }
            """;
    }

    private static Path compiler() {
        String stated = System.getenv("IEC2C");
        List<Path> candidates = new ArrayList<>();
        if (stated != null) {
            candidates.add(Path.of(stated));
        }
        for (String one : System.getenv("PATH").split(File.pathSeparator)) {
            candidates.add(Path.of(one, "iec2c"));
        }
        Path found = candidates.stream().filter(Files::isExecutable).filter(Files::isRegularFile).findFirst().orElse(null);
        assumeTrue(found != null, "there is no iec2c (it comes with OpenPLC Editor and Beremiz; IEC2C names it)");
        return found;
    }

    private String run(String... words) throws IOException, InterruptedException {
        Path log = folder.resolve("log");
        Process process = new ProcessBuilder(words).redirectErrorStream(true).redirectOutput(log.toFile()).start();
        boolean ended = process.waitFor(60, TimeUnit.SECONDS);
        process.destroyForcibly();
        String text = Files.readString(log, StandardCharsets.UTF_8);
        assertEquals(List.of(true, 0), List.of(ended, ended ? process.exitValue() : 0), words[0] + ": " + text);
        return text.lines().map(String::stripTrailing).collect(Collectors.joining("\n"));
    }
}
