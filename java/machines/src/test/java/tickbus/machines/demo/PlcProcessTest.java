package tickbus.machines.demo;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.BufferedReader;
import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import java.util.concurrent.TimeUnit;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.api.condition.DisabledOnOs;
import org.junit.jupiter.api.condition.OS;
import org.junit.jupiter.api.io.TempDir;

/** The PLC's process, replaced by shell scripts. */
@DisabledOnOs(value = OS.WINDOWS, disabledReason = "the processes of this test are shell scripts")
@Timeout(60)
class PlcProcessTest {
    private static final String LIVES_ON = "while true; do sleep 0.05; done";

    @TempDir
    Path folder;

    private PlcProcess process(String script) {
        return new PlcProcess(() -> List.of("sh", "-c", script), 100_000_000L, folder.resolve("demo/plc.log"));
    }

    private static boolean isAlive(PlcProcess plc) {
        return isAlive(plc.name());
    }

    private static boolean isAlive(String name) {
        return ProcessHandle.of(Long.parseLong(name.replace("process ", ""))).map(ProcessHandle::isAlive).orElse(false);
    }

    /** The message of {@code check} about a process that ends: the JVM learns of the end a moment after the system does. */
    private static String complaintOf(PlcProcess plc) {
        return Eventually.get("its end", () -> {
            try {
                plc.check();
                return null;
            } catch (DemoFailure e) {
                return e.getMessage();
            }
        });
    }

    @Test
    void theNewestWholeBlockCountsAndOtherLinesAreNews() {
        try (PlcProcess plc = process("""
                echo 'plc: opening: a=b'
                printf 'plc.scans=7\\nreason=no: none\\nplc.rises.LA1 run=3\\n\\n'
                printf 'plc.scans=9\\nplc.rises.LA1 run=4\\nplc.rises.a\\\\=b=5\\n\\n'
                printf 'plc.scans=10\\nplc.rises.LA1 run=99\\n'
                """ + LIVES_ON)) {
            assertEquals(Plc.Counts.NONE, plc.counts());
            plc.start();
            Eventually.is("its statistics", () -> plc.counts().scans() == 9);
            assertEquals(Map.of("LA1 run", 4L, "a=b", 5L), plc.counts().rises());
            assertTrue(plc.counts().nanoTime() - System.nanoTime() <= 0);
            assertEquals(List.of("plc: opening: a=b"), plc.news());
            assertEquals(List.of(), plc.news());
            plc.check();
        }
    }

    @Test
    void aKilledProcessIsDeadAtOnceAndItsNextLifeKnowsNothing() {
        try (PlcProcess plc = process("trap '' TERM INT; printf 'plc.scans=1\\n\\n'; " + LIVES_ON)) {
            plc.start();
            Eventually.is("its statistics", () -> plc.counts().scans() == 1);
            String first = plc.name();
            plc.kill();
            assertFalse(isAlive(first));
            plc.check();
            assertEquals(1, plc.counts().scans(), "its last counts stay known");
            plc.start();
            assertFalse(plc.name().equals(first));
            Eventually.is("its statistics", () -> plc.counts().scans() == 1);
            assertTrue(isAlive(plc));
        }
    }

    @Test
    void whatItPrintsJustBeforeItDiesIsKnownWhenItIsDead() {
        Path printed = folder.resolve("printed");
        try (PlcProcess plc = process("printf 'plc.scans=1\\n\\n'; for i in 2 3 4; do printf \"plc.scans=$i\\n\\n\"; done; "
                + "touch '" + printed + "'; " + LIVES_ON)) {
            plc.start();
            Eventually.is("all that it prints", () -> Files.exists(printed));
            plc.kill();
            assertEquals(4, plc.counts().scans());
        }
    }

    @Test
    void oneThatEndsByItselfFailsWithItsLastWords() {
        try (PlcProcess plc = process("for i in 1 2 3 4 5 6 7; do echo \"word $i\" >&2; done; exit 3")) {
            plc.start();
            String reason = complaintOf(plc);
            assertTrue(reason.matches("process \\d+ of the PLC ended by itself with exit code 3; its last words: "
                    + "word 3; word 4; word 5; word 6; word 7"), reason);
        }
        try (PlcProcess plc = process("exit 0")) {
            plc.start();
            String reason = complaintOf(plc);
            assertTrue(reason.endsWith("exit code 0; it said nothing on standard error"), reason);
        }
    }

    @Test
    void anExecutableThatIsNotThereIsTold() {
        try (PlcProcess plc = new PlcProcess(() -> List.of(folder.resolve("tickbus").toString(), "plc"), 1,
                folder.resolve("plc.log"))) {
            String reason = assertThrows(DemoFailure.class, plc::start).getMessage();
            assertTrue(reason.startsWith("the PLC cannot be started: ") && reason.contains("--plc"), reason);
        }
        try (PlcProcess nets = new PlcProcess("the nets", "call for help", () -> List.of(folder.resolve("java").toString()), 1,
                folder.resolve("nets.log"))) {
            String reason = assertThrows(DemoFailure.class, nets::start).getMessage();
            assertTrue(reason.startsWith("the nets cannot be started: ") && reason.endsWith("; call for help"), reason);
        }
    }

    @Test
    void closingEndsItEvenIfItDoesNotWantTo() {
        List<String> names = new ArrayList<>();
        for (String script : List.of(LIVES_ON, "trap '' TERM INT; printf 'plc.scans=1\\n\\n'; " + LIVES_ON)) {
            PlcProcess plc = process(script);
            plc.start();
            names.add(plc.name());
            plc.close();
        }
        names.forEach(name -> assertFalse(isAlive(name), name));
    }

    /** A JVM that starts a process and never ends it. */
    static final class Forgetful {
        private Forgetful() {
        }

        public static void main(String[] args) throws IOException {
            @SuppressWarnings("resource")
            PlcProcess plc = new PlcProcess(() -> List.of("sh", "-c", LIVES_ON), 1, Path.of(args[0]));
            plc.start();
            System.out.println(plc.name());
            // Waits until it is killed, or the test is gone.
            System.in.read();
        }
    }

    @Test
    void itEndsWithAJvmThatIsToldToEnd() throws IOException, InterruptedException {
        Process jvm = new ProcessBuilder(Path.of(System.getProperty("java.home"), "bin", "java").toString(), "-cp",
                System.getProperty("java.class.path"), Forgetful.class.getName(), folder.resolve("plc.log").toString())
                .redirectError(ProcessBuilder.Redirect.INHERIT).start();
        try (BufferedReader out = jvm.inputReader()) {
            String name = out.readLine();
            assertTrue(isAlive(name));
            jvm.toHandle().destroy();
            assertTrue(jvm.waitFor(30, TimeUnit.SECONDS));
            Eventually.is("its end", () -> !isAlive(name));
        } finally {
            jvm.destroyForcibly();
        }
        assertEquals("", Files.readString(folder.resolve("plc.log")));
    }
}
