package tickbus.simulator;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.ByteArrayOutputStream;
import java.io.IOException;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.LinkedHashMap;
import java.util.Map;
import java.util.function.Supplier;
import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;

class MainTest {
    @TempDir
    Path folder;

    @TempDir
    Path work;

    private final ByteArrayOutputStream out = new ByteArrayOutputStream();
    private final ByteArrayOutputStream err = new ByteArrayOutputStream();
    private Path table;

    @BeforeEach
    void fill() throws IOException {
        DriverJar.write(work, folder.resolve("driver.jar"), "drivers.Good", "drivers.Good");
        Files.writeString(folder.resolve("a.cfg"), "[driver]\nid = 1\n");
        table = work.resolve("control.table");
        Files.writeString(table, "1:lamp | | not | 1:level\n");
    }

    private int run(String... args) {
        return run(Map.of("press", NoMachine::new), args);
    }

    private int run(Map<String, Supplier<Machine>> machines, String... args) {
        return Main.run(args, machines, new PrintStream(out, true, StandardCharsets.UTF_8),
                new PrintStream(err, true, StandardCharsets.UTF_8));
    }

    private String err() {
        return err.toString(StandardCharsets.UTF_8);
    }

    private String out() {
        return out.toString(StandardCharsets.UTF_8);
    }

    @Test
    void runsForAWhile() {
        int code = run("--drivers", folder.toString(), "--control", table.toString(), "--machine", "none", "--mode",
                "best-effort", "--step", "1ms", "--duration", "1s");
        assertEquals(0, code, err());
        assertTrue(out().strip().endsWith("simulator: ok ticks=1000 simulated=1s late_ticks=0 dropped_ticks=0"), out());
    }

    @Test
    void listsTheComponents() {
        assertEquals(0, run("--drivers", folder.toString(), "--list"));
        assertTrue(out().contains("1:level") && out().contains("1:lamp"), out());
    }

    @Test
    void helpsWithTheFunctions() {
        assertEquals(0, run("--help"));
        assertTrue(out().contains("--duration") && out().contains("deadband(width)"), out());
        assertTrue(out().contains("TON(IN, PT) .Q .ET"), out());
    }

    @Test
    void theMachineIsTheFirstOrNone() {
        String[] line = {"--drivers", folder.toString(), "--control", table.toString(), "--mode", "best-effort",
            "--duration", "10ms"};
        assertEquals(0, run(Map.of(), line), err());
        assertTrue(out().startsWith("machine none, 1 driver(s)"), out());
        assertEquals(2, run(Map.of(), "--machine", "rig"));
        assertTrue(err().startsWith("simulator: --machine is \"rig\"; it must be none\n"), err());
        assertTrue(err().contains("--machine NAME   none (default): only link drivers"), err());
        out.reset();
        Map<String, Supplier<Machine>> machines = new LinkedHashMap<>();
        StringBuilder made = new StringBuilder();
        machines.put("press", () -> {
            made.append("press");
            return new NoMachine();
        });
        machines.put("mill", NoMachine::new);
        assertEquals(0, run(machines, line), err());
        assertEquals("press", made.toString());
        out.reset();
        assertEquals(0, run(machines, "--help"));
        assertTrue(out().contains("--machine NAME   press (default), mill, none;\n"), out());
    }

    @Test
    void runsAMachineOfOnesOwn(@TempDir Path machines) throws IOException {
        MachineJar.write(work, machines.resolve("press.jar"), MachineJar.PRESS);
        String[] line = {"--drivers", folder.toString(), "--control", table.toString(), "--machines", machines.toString(),
            "--machine", "my press", "--mode", "best-effort", "--duration", "10ms"};
        Files.writeString(table, "1:lamp | | | machine:down\nmachine:force | | | 1:level\n");
        assertEquals(0, run(line), err());
        assertTrue(out().startsWith("machine my press, 1 driver(s)"), out());
        out.reset();
        assertEquals(0, run("--list", "--drivers", folder.toString(), "--machines", machines.toString(), "--machine",
                "my press"));
        assertTrue(out().contains("\nmachine my press\n  variable       unit\n"), out());
        assertTrue(out().contains("  model:strokes\n"), out());
        out.reset();
        assertEquals(0, run("--help", "--machines", machines.toString()));
        assertTrue(out().contains("--machine NAME   press (default), my press, none;"), out());
        String[] model = {"--machines", machines.toString(), "--machine", "my press", "--model-cfg",
            work.resolve("model.cfg").toString()};
        assertEquals(0, run(model), err());
        assertTrue(Files.readString(work.resolve("model.cfg")).contains("name    = \"model:strokes\"\naddress = \"%IL0\""));
        assertEquals(1, run(model));
        assertTrue(err().contains("model.cfg: this file exists already; name a new one"), err());
        assertEquals(1, run("--list", "--drivers", folder.toString(), "--machines", work.resolve("no").toString()));
        assertTrue(err().contains("there is no such folder; name the folder that holds the machines' jars"), err());
    }

    @Test
    void notesWhatIsNotConnected() throws IOException {
        Files.writeString(table, "");
        run("--drivers", folder.toString(), "--control", table.toString(), "--machine", "none", "--mode",
                "best-effort", "--duration", "10ms");
        assertTrue(out().contains("writes 1:level; it stays 0"), out());
        assertTrue(out().contains("reads 1:lamp; --list --control " + table + " lists what no row uses\n"), out());
    }

    @Test
    void listsWhatNoRowUses() throws IOException {
        Files.writeString(table, "");
        assertEquals(0, run("--drivers", folder.toString(), "--list", "--control", table.toString(), "--machine", "none"));
        assertTrue(out().contains("1:lamp                 reads it\n"), out());
        assertTrue(out().contains("1:level                writes it; it stays 0\n"), out());
        out.reset();
        Files.writeString(table, "1:lamp | | not | 1:level\n");
        assertEquals(0, run("--drivers", folder.toString(), "--list", "--control", table.toString(), "--machine", "none"));
        assertTrue(out().endsWith("\nrows of " + table + " use every input and output\n"), out());
    }

    @ParameterizedTest
    @CsvSource(delimiter = ';', value = {
        "--drivrs x; there is no option \"--drivrs\"§ did you mean \"--drivers\"?",
        "--list; --drivers is missing",
        "--drivers; --drivers needs a value behind it",
        "--drivers a --drivers b; --drivers is given twice",
        "--machine mill; --machine is \"mill\"§ it must be one of none, press",
        "--machine none --step 0ms; --step is 0ms§ it must be above 0",
        "--machine none --step 5; is no duration",
    })
    void aCommandLineThatIsWrongExitsWith2(String line, String what) {
        assertEquals(2, run(line.split(" ")));
        assertTrue(err().contains(what.replace('§', ';')), err());
        assertTrue(err().contains("usage: simulator"));
    }

    @Test
    void wrongInputExitsWith1AndAFailingDriverWith3() throws IOException {
        assertEquals(1, run("--drivers", folder.resolve("no").toString(), "--list"));
        Files.writeString(table, "1:lamb | | | 1:level\n");
        assertEquals(1, run("--drivers", folder.toString(), "--control", table.toString(), "--machine", "none"));
        assertTrue(err().contains("control.table:1: there is no source \"1:lamb\"; did you mean \"1:lamp\"?"), err());
        Files.writeString(folder.resolve("a.cfg"), "[driver]\nid = 1\n# fail\n");
        assertEquals(3, run("--drivers", folder.toString(), "--list"));
        assertTrue(err().contains("the card is missing"), err());
    }
}
