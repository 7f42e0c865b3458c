package tickbus.simulator.demo;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.ByteArrayOutputStream;
import java.io.IOException;
import java.io.OutputStream;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import java.util.jar.Attributes;
import java.util.jar.JarOutputStream;
import java.util.jar.Manifest;
import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;

/**
 * The whole way: simulator, drop-in driver, native library, loopback, the built-in PLC program. First as it
 * should be, then with the PLC, the rig and the link broken in turn. Stepped, so that no clock plays a part.
 */
@Tag("native")
class DemoTest {
    private static final Path CFG = Path.of("../../driver.cfg");
    private static final Path TABLE = Path.of("rig.table");

    @TempDir
    Path folder;

    private Path table;
    private String output;

    /** The driver's classes are on the test's class path; the folder's jar only has to name them. */
    @BeforeEach
    void fill() throws IOException {
        Manifest manifest = new Manifest();
        manifest.getMainAttributes().put(Attributes.Name.MANIFEST_VERSION, "1.0");
        manifest.getMainAttributes().putValue("Device-Driver-Class", "DeviceDrivers.FieldbusDriver");
        Files.createDirectories(folder.resolve("drivers"));
        try (OutputStream file = Files.newOutputStream(folder.resolve("drivers/driver.jar"));
                JarOutputStream jar = new JarOutputStream(file, manifest)) {
            jar.finish();
        }
        table = TABLE;
    }

    /** Takes the project's driver.cfg with the lines of its [fieldbus] table after {@code kind} replaced. */
    private void fieldbus(String... lines) throws IOException {
        List<String> cfg = new ArrayList<>(Files.readAllLines(CFG));
        int kind = cfg.indexOf("[fieldbus]") + 1;
        assertTrue(kind > 0 && cfg.get(kind).startsWith("kind"), "driver.cfg begins [fieldbus] with its kind");
        while (!cfg.get(kind + 1).isBlank()) {
            cfg.remove(kind + 1);
        }
        cfg.addAll(kind + 1, Arrays.asList(lines));
        Files.write(folder.resolve("drivers/driver.cfg"), cfg);
    }

    private int demo() {
        ByteArrayOutputStream bytes = new ByteArrayOutputStream();
        PrintStream out = new PrintStream(bytes, true, StandardCharsets.UTF_8);
        int code = Demo.run(new String[] {"--drivers", folder.resolve("drivers").toString(), "--control",
            table.toString(), "--report", folder.resolve("demo/report.txt").toString(), "--mode", "best-effort"},
                out, out);
        output = bytes.toString(StandardCharsets.UTF_8);
        return code;
    }

    private String verdict() {
        return output.strip().substring(output.strip().lastIndexOf('\n') + 1);
    }

    private void fails() {
        assertEquals(1, demo(), () -> output);
        assertTrue(verdict().startsWith("demo: failed reason="), verdict());
    }

    @Test
    void threeCyclesAndAJam() throws IOException {
        fieldbus("program = \"rig\"", "scan = \"10ms\"", "cycle = \"2ms\"", "mode = \"stepped\"");
        assertEquals(0, demo(), () -> output);
        assertTrue(verdict().matches("demo: ok cycles=3 jams=1 ticks=\\d+ missed_edges=0 stale_ticks=0 report=.*"),
                verdict());
    }

    @Test
    void aPlcThatReadsTheLiftsCodeTheOtherWayRoundFails() throws IOException {
        fieldbus("program = \"rig\"", "program_options = { la1_code = \"lsb-first\" }", "scan = \"10ms\"",
                "cycle = \"2ms\"", "mode = \"stepped\"");
        fails();
        assertTrue(verdict().contains("unexpected fault in stage cycle 1: lift 1"), verdict());
    }

    @Test
    void aRigWithADisconnectedSensorFails() throws IOException {
        fieldbus("program = \"rig\"", "scan = \"10ms\"", "cycle = \"2ms\"", "mode = \"stepped\"");
        table = folder.resolve("short.table");
        Files.write(table, Files.readAllLines(TABLE).stream().filter(line -> !line.contains("Step 3 complete"))
                .toList());
        fails();
        assertTrue(verdict().contains("in stage cycle 1"), verdict());
    }

    @Test
    void aLinkWithNobodyAtItsOtherEndFails() throws IOException {
        fieldbus("link = \"nobody\"", "cycle = \"2ms\"");
        fails();
    }
}
