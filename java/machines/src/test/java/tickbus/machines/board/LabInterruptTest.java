package tickbus.machines.board;

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
class LabInterruptTest {
    @Test
    @Timeout(120)
    @DisabledOnOs(value = OS.WINDOWS, disabledReason = "a process cannot be asked to end, only be killed")
    void aSignalEndsAllProcessesAndTellsSo(@TempDir Path folder) throws Exception {
        DriverFolder.ofTestingBoard(folder.resolve("drivers"));
        Process demo = new ProcessBuilder(Path.of(System.getProperty("java.home"), "bin", "java").toString(),
                "--enable-native-access=ALL-UNNAMED", "-Dtickbus.native.dir=" + System.getProperty("tickbus.native.dir"),
                "-cp", System.getProperty("java.class.path"), LabDemo.class.getName(), "--drivers",
                folder.resolve("drivers").toString(), "--control", "lab.table", "--programs", "../../plc/lab", "--report",
                folder.resolve("report.txt").toString(), "--tickbus", DriverFolder.tickbus().toString())
                .redirectError(ProcessBuilder.Redirect.DISCARD).start();
        try (BufferedReader out = demo.inputReader()) {
            String line = out.readLine();
            while (line != null && !line.contains("presses switch 1")) {
                line = out.readLine();
            }
            List<ProcessHandle> members = demo.toHandle().descendants().toList();
            assertEquals(3, members.size());
            // Process.destroy() would close the stream that the verdict comes from.
            demo.toHandle().destroy();
            List<String> rest = out.lines().toList();
            assertEquals("demo-lab: failed reason=interrupted", rest.get(rest.size() - 1));
            assertTrue(demo.waitFor(30, TimeUnit.SECONDS));
            for (ProcessHandle member : members) {
                member.onExit().get(30, TimeUnit.SECONDS);
            }
        } finally {
            demo.destroyForcibly();
        }
    }
}
