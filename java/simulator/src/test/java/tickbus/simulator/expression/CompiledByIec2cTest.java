package tickbus.simulator.expression;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assumptions.assumeTrue;

import java.io.File;
import java.io.IOException;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.TimeUnit;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;

/** The compiler of OpenPLC and Beremiz gives the golden expressions the same results. */
class CompiledByIec2cTest {
    @TempDir
    Path folder;

    @Test
    void iec2cAgreesWithEachResult() throws Exception {
        Path compiler = compiler();
        Path library = compiler.resolveSibling("lib");
        assumeTrue(Files.isRegularFile(library.resolve("ieclib.txt")), "iec2c has no library beside it");
        List<Golden> golden = Golden.all();
        Files.writeString(folder.resolve("program.st"), program(golden));
        run(compiler.toString(), "-f", "-l", "-p", "-I", library.toString(), "-T", folder.toString(),
                folder.resolve("program.st").toString());
        Files.writeString(folder.resolve("main.c"), main(golden));
        run("cc", "-w", "-I", folder.toString(), "-I", library.resolve("C").toString(), "-o",
                folder.resolve("main").toString(), folder.resolve("main.c").toString(), "-lm");
        List<String> results = run(folder.resolve("main").toString()).lines().toList();
        List<String> wanted = new ArrayList<>();
        List<String> got = new ArrayList<>();
        for (int set = 0; set < Golden.INPUTS.length; set++) {
            for (int i = 0; i < golden.size(); i++) {
                String what = golden.get(i).text() + ", set " + set + ": ";
                wanted.add(what + golden.get(i).results()[set]);
                got.add(what + (Double.parseDouble(results.get(set * golden.size() + i)) + 0.0));
            }
        }
        assertEquals(String.join("\n", wanted), String.join("\n", got));
    }

    private static Path compiler() {
        String stated = System.getenv("IEC2C");
        List<Path> candidates = new ArrayList<>();
        if (stated != null) {
            candidates.add(Path.of(stated));
        }
        for (String folder : System.getenv("PATH").split(File.pathSeparator)) {
            candidates.add(Path.of(folder, "iec2c"));
        }
        Path found = candidates.stream().filter(Files::isExecutable).filter(Files::isRegularFile).findFirst().orElse(null);
        assumeTrue(found != null, "there is no iec2c (it comes with OpenPLC Editor and Beremiz; IEC2C names it)");
        return found;
    }

    private static Type type(Golden golden) {
        return Expression.read(golden.text()).compile(new Golden.Inputs(), 1).type();
    }

    /** A program whose outputs are the results. */
    private static String program(List<Golden> golden) {
        StringBuilder text = new StringBuilder("PROGRAM results\n  VAR_INPUT\n");
        for (int i = 0; i < Golden.NAMES.length(); i++) {
            text.append("    in_").append(Golden.NAMES.charAt(i)).append(" : ").append(Golden.type(i)).append(";\n");
        }
        text.append("  END_VAR\n  VAR_OUTPUT\n");
        for (int i = 0; i < golden.size(); i++) {
            text.append("    r").append(i).append(" : ").append(type(golden.get(i))).append(";\n");
        }
        text.append("  END_VAR\n");
        for (int i = 0; i < golden.size(); i++) {
            // The standard's second edition has no conversions that are named by their result alone.
            String expression = golden.get(i).text().replaceAll("\\b([abcijkxyz])\\b", "in_$1")
                    .replace("TO_LINT", "LREAL_TO_LINT").replace("TO_LREAL", "LINT_TO_LREAL");
            text.append("  r").append(i).append(" := ").append(expression).append(";\n");
        }
        return text.append("END_PROGRAM\n").toString();
    }

    private static String main(List<Golden> golden) {
        StringBuilder text = new StringBuilder("""
                #include <stdio.h>
                #include "iec_std_lib.h"
                TIME __CURRENT_TIME;
                BOOL __DEBUG;
                #include "POUS.h"
                #include "POUS.c"
                static RESULTS p;
                int main(void) {
                    RESULTS_init__(&p, 0);
                """);
        for (double[] inputs : Golden.INPUTS) {
            for (int i = 0; i < inputs.length; i++) {
                text.append("    p.IN_").append(Character.toUpperCase(Golden.NAMES.charAt(i))).append(".value = ")
                        .append(inputs[i]).append(";\n");
            }
            text.append("    RESULTS_body__(&p);\n");
            for (int i = 0; i < golden.size(); i++) {
                text.append("    printf(\"%.17g\\n\", (double)p.R").append(i).append(".value);\n");
            }
        }
        return text.append("    return 0;\n}\n").toString();
    }

    private String run(String... words) throws IOException, InterruptedException {
        Path log = folder.resolve("log");
        Process process = new ProcessBuilder(words).redirectErrorStream(true).redirectOutput(log.toFile()).start();
        boolean ended = process.waitFor(60, TimeUnit.SECONDS);
        process.destroyForcibly();
        String text = Files.readString(log, StandardCharsets.UTF_8);
        assertEquals(List.of(true, 0), List.of(ended, ended ? process.exitValue() : 0), words[0] + ": " + text);
        return text;
    }
}
