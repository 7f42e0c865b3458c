package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertNotEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.ByteArrayOutputStream;
import java.io.IOException;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.machines.demo.DriverFolder;

/**
 * The whole chain: simulator, drop-in driver, native library, loopback, the built-in PLC program. First undisturbed,
 * then with faults of the PLC, the rig and the link in turn. Stepped, so that no clock is involved; only the test
 * with the PLC as a separate process, killed and restarted, runs in real time.
 */
@Tag("native")
class DemoTest {
    private static final Path TABLE = Path.of("rig.table");

    @TempDir
    Path folder;

    private Path table;
    private String output;

    @BeforeEach
    void fill() throws IOException {
        DriverFolder.make(folder.resolve("drivers"));
        table = TABLE;
    }

    private void loopback(String... lines) throws IOException {
        Cfg.write(folder.resolve("drivers"), lines);
    }

    /** The project's driver.cfg unchanged except for the port, and the PLC as a process. */
    private int demoOfTwoProcesses() throws IOException {
        String cfg = Files.readString(Path.of("../../driver.cfg"));
        String anyPort = cfg.replace("\"127.0.0.1:20030\"", "\"127.0.0.1:0\"");
        assertNotEquals(cfg, anyPort);
        Files.writeString(folder.resolve("drivers/driver.cfg"), anyPort);
        return demo("--plc", DriverFolder.tickbus().toString());
    }

    private int demo() {
        return demo("--mode", "best-effort");
    }

    private int demo(String... more) {
        ByteArrayOutputStream bytes = new ByteArrayOutputStream();
        PrintStream out = new PrintStream(bytes, true, StandardCharsets.UTF_8);
        List<String> args = new ArrayList<>(List.of("--drivers", folder.resolve("drivers").toString(), "--control",
                table.toString(), "--report", folder.resolve("demo/report.txt").toString()));
        args.addAll(List.of(more));
        int code = Demo.run(args.toArray(String[]::new), out, out);
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
        loopback("program = \"rig\"", "scan = \"10ms\"", "cycle = \"2ms\"", "mode = \"stepped\"");
        assertEquals(0, demo(), () -> output);
        assertTrue(verdict().matches("demo: ok cycles=3 jams=1 restarts=0 ticks=\\d+ missed_edges=0 stale_ticks=0 report=.*"),
                verdict());
    }

    @Test
    void aPlcInAProcessOfItsOwnIsKilledAndComesBack() throws IOException {
        assertEquals(0, demoOfTwoProcesses(), () -> output);
        assertTrue(verdict().matches("demo: ok cycles=3 jams=1 restarts=1 ticks=\\d+ missed_edges=0"
                + " stale_ticks=[1-9]\\d* report=.*"), verdict());
        String report = Files.readString(folder.resolve("demo/report.txt"));
        for (String part : List.of("kills the PLC (process", "rig stood still after", "Life 2 of the PLC")) {
            assertTrue(report.contains(part), report);
        }
        String log = Files.readString(folder.resolve("demo/plc.log"));
        assertEquals(2, log.lines().filter(line -> line.contains("is opening: opening the line")).count(), log);
    }

    @Test
    void aProcessForAPlcThatTheDriverHostsItselfFails() throws IOException {
        loopback("program = \"rig\"", "scan = \"10ms\"", "cycle = \"2ms\"", "mode = \"stepped\"");
        assertEquals(1, demo("--plc", "tickbus", "--mode", "best-effort"), () -> output);
        assertTrue(verdict().contains("so no PLC process can connect to it"), verdict());
    }

    @Test
    void aPlcThatReadsTheLiftsCodeTheOtherWayRoundFails() throws IOException {
        loopback("program = \"rig\"", "program_options = { la1_code = \"lsb-first\" }", "scan = \"10ms\"",
                "cycle = \"2ms\"", "mode = \"stepped\"");
        fails();
        assertTrue(verdict().contains("unexpected fault in stage jam in cycle 1: lift 1"), verdict());
    }

    @Test
    void aRigWithADisconnectedSensorFails() throws IOException {
        loopback("program = \"rig\"", "scan = \"10ms\"", "cycle = \"2ms\"", "mode = \"stepped\"");
        table = folder.resolve("short.table");
        Files.write(table, Files.readAllLines(TABLE).stream().filter(line -> !line.contains("Step 3 complete"))
                .toList());
        fails();
        assertTrue(verdict().contains("in stage jam in cycle 1"), verdict());
    }

    @Test
    void aLinkWithNobodyAtItsOtherEndFails() throws IOException {
        loopback("link = \"nobody\"", "cycle = \"2ms\"");
        fails();
    }
}
