package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.BufferedReader;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.concurrent.TimeUnit;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.condition.DisabledOnOs;
import org.junit.jupiter.api.condition.OS;
import org.junit.jupiter.api.io.TempDir;

class InterruptTest {
    @Test
    @DisabledOnOs(value = OS.WINDOWS, disabledReason = "a process cannot be asked to end, only be killed")
    void aSignalClosesTheDriversAndTellsSo(@TempDir Path folder) throws Exception {
        Process demo = new ProcessBuilder(Path.of(System.getProperty("java.home"), "bin", "java").toString(), "-cp",
                System.getProperty("java.class.path"), PlcMain.class.getName(), "rig.table",
                folder.resolve("report.txt").toString()).redirectErrorStream(true).start();
        try (BufferedReader out = demo.inputReader()) {
            String line = out.readLine();
            while (line != null && !line.contains("phase home")) {
                line = out.readLine();
            }
            // Process.destroy() would close the stream that the verdict comes from.
            demo.toHandle().destroy();
            List<String> rest = out.lines().toList();
            assertEquals(List.of("driver closed", "demo: failed reason=interrupted"),
                    rest.subList(Math.max(0, rest.size() - 2), rest.size()));
            assertTrue(demo.waitFor(30, TimeUnit.SECONDS));
            assertTrue(demo.exitValue() != 0, "exit code " + demo.exitValue());
            assertTrue(Files.readString(folder.resolve("report.txt")).contains("reason=interrupted"));
        } finally {
            demo.destroyForcibly();
        }
    }
}
