package tickbus.machines.peeler;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.BufferedReader;
import java.nio.file.Path;
import java.util.List;
import java.util.concurrent.TimeUnit;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.api.condition.DisabledOnOs;
import org.junit.jupiter.api.condition.OS;
import org.junit.jupiter.api.io.TempDir;
import tickbus.machines.demo.DriverFolder;

/** Ctrl-C in the middle of the demo. */
@Tag("native")
class PeelingInterruptTest {
    @Test
    @Timeout(120)
    @DisabledOnOs(value = OS.WINDOWS, disabledReason = "a process cannot be asked to end, only be killed")
    void aSignalEndsAllThreeProcessesAndTellsSo(@TempDir Path folder) throws Exception {
        DriverFolder.ofPeelingLine(folder.resolve("drivers"));
        Process demo = new ProcessBuilder(Path.of(System.getProperty("java.home"), "bin", "java").toString(),
                "--enable-native-access=ALL-UNNAMED", "-Dtickbus.native.dir=" + System.getProperty("tickbus.native.dir"),
                "-cp", System.getProperty("java.class.path"), PeelingDemo.class.getName(), "--drivers",
                folder.resolve("drivers").toString(), "--control", "peeler.table", "--report",
                folder.resolve("report.txt").toString(), "--plc", DriverFolder.tickbus().toString(), "--logs", "1000",
                "--time-limit", "60min").redirectError(ProcessBuilder.Redirect.DISCARD).start();
        try (BufferedReader out = demo.inputReader()) {
            String line = out.readLine();
            while (line != null && !line.contains("Lathe: running")) {
                line = out.readLine();
            }
            List<ProcessHandle> plcs = demo.toHandle().descendants().toList();
            assertEquals(2, plcs.size());
            // Process.destroy() would close the stream that the verdict comes from.
            demo.toHandle().destroy();
            List<String> rest = out.lines().toList();
            assertEquals("demo-peeler: failed reason=interrupted", rest.get(rest.size() - 1));
            assertTrue(demo.waitFor(30, TimeUnit.SECONDS));
            for (ProcessHandle plc : plcs) {
                plc.onExit().get(30, TimeUnit.SECONDS);
            }
        } finally {
            demo.destroyForcibly();
        }
    }
}
