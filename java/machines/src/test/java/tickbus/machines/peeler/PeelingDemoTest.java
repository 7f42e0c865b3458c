package tickbus.machines.peeler;

import static org.junit.jupiter.api.Assertions.assertEquals;
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
import org.junit.jupiter.api.condition.DisabledOnOs;
import org.junit.jupiter.api.condition.OS;
import org.junit.jupiter.api.io.TempDir;
import tickbus.machines.demo.DriverFolder;

/** The whole chain: simulator, two drivers, native library, two sockets, two PLC processes. */
@Tag("native")
class PeelingDemoTest {
    @TempDir
    Path folder;

    private String output;

    @BeforeEach
    void fill() throws IOException {
        DriverFolder.ofPeelingLine(folder.resolve("drivers"));
    }

    private int demo(Path plc, String... more) {
        ByteArrayOutputStream bytes = new ByteArrayOutputStream();
        PrintStream out = new PrintStream(bytes, true, StandardCharsets.UTF_8);
        List<String> args = new ArrayList<>(List.of("--drivers", folder.resolve("drivers").toString(), "--control",
                "peeler.table", "--report", folder.resolve("demo/report.txt").toString(), "--plc", plc.toString()));
        args.addAll(List.of(more));
        int code = PeelingDemo.run(args.toArray(String[]::new), out, out);
        output = bytes.toString(StandardCharsets.UTF_8);
        return code;
    }

    private String verdict() {
        return output.strip().substring(output.strip().lastIndexOf('\n') + 1);
    }

    @Test
    void twoPlcsPeelABlock() throws IOException {
        assertEquals(0, demo(DriverFolder.tickbus(), "--logs", "1"), () -> output);
        assertTrue(verdict().matches("demo-peeler: ok logs=1 veneer_m=\\d+\\.\\d commands_per_s=\\d+\\.\\d\\d"
                + " busiest_per_s=\\d+\\.\\d\\d busiest_in_1s=\\d+ mean_ms=\\d+\\.\\d\\d report=.*"), verdict());
        String report = Files.readString(folder.resolve("demo/report.txt"));
        for (String part : List.of("charger -> simulation", "simulation -> lathe", "2018", "15.61", "whole ribbon",
                "is round, the ribbon is whole", "mean of all 25")) {
            assertTrue(report.contains(part), report);
        }
    }

    @Test
    @DisabledOnOs(value = OS.WINDOWS, disabledReason = "the process of this test is a shell script")
    void aPlcThatDiesIsToldByName() throws IOException {
        Path dying = folder.resolve("tickbus");
        Files.writeString(dying, "#!/bin/sh\nif [ \"$2\" = lathe ]; then echo 'out of ideas' >&2; exit 3; fi\n"
                + "exec sleep 60\n");
        assertTrue(dying.toFile().setExecutable(true));
        assertEquals(1, demo(dying), () -> output);
        assertTrue(verdict().matches("demo-peeler: failed reason=\"lathe: process \\d+ of the PLC ended by itself with"
                + " exit code 3; its last words: out of ideas\""), verdict());
    }

    @Test
    void anExecutableThatIsNotThereIsTold() throws IOException {
        assertEquals(1, demo(folder.resolve("nothing here")), () -> output);
        assertTrue(verdict().startsWith("demo-peeler: failed reason=\"the PLC cannot be started: "), verdict());
        assertTrue(Files.readString(folder.resolve("demo/report.txt")).contains("cannot be started"));
    }

    @Test
    void aWrongCommandLineIsTold() {
        assertEquals(2, demo(folder, "--log", "3"));
        assertTrue(verdict().contains("there is no option '--log'; did you mean '--logs'?"), verdict());
    }
}
