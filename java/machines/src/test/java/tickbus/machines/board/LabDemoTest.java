package tickbus.machines.board;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.ByteArrayOutputStream;
import java.io.IOException;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.condition.DisabledOnOs;
import org.junit.jupiter.api.condition.OS;
import org.junit.jupiter.api.io.TempDir;
import tickbus.machines.demo.DriverFolder;

/** The whole laboratory: simulator, driver, native library, a dispatcher and two controllers as processes. */
@Tag("native")
class LabDemoTest {
    @TempDir
    Path folder;

    private Path programs;
    private String output;

    @BeforeEach
    void fill() throws IOException {
        DriverFolder.ofTestingBoard(folder.resolve("drivers"));
        programs = Files.createDirectory(folder.resolve("programs"));
        for (String name : List.of("tanks.toml", "tanks.patch", "panel.toml", "panel.patch")) {
            Files.copy(Path.of("../../plc/lab", name), programs.resolve(name));
        }
    }

    private int demo(Path tickbus) {
        ByteArrayOutputStream bytes = new ByteArrayOutputStream();
        PrintStream out = new PrintStream(bytes, true, StandardCharsets.UTF_8);
        int code = LabDemo.run(new String[] {"--drivers", folder.resolve("drivers").toString(), "--control", "lab.table",
            "--programs", programs.toString(), "--report", folder.resolve("demo/report.txt").toString(), "--tickbus",
            tickbus.toString()}, out, out);
        output = bytes.toString(StandardCharsets.UTF_8);
        return code;
    }

    private String verdict() {
        return output.strip().substring(output.strip().lastIndexOf('\n') + 1);
    }

    private void change(String name, String from, String to) throws IOException {
        String text = Files.readString(programs.resolve(name));
        assertTrue(text.contains(from), text);
        Files.writeString(programs.resolve(name), text.replace(from, to));
    }

    @Test
    void theLaboratoryDoesWhatItShould() throws IOException {
        assertEquals(0, demo(DriverFolder.tickbus()), () -> output);
        assertTrue(verdict().matches("demo-lab: ok levels=\\d+\\.\\d\\.\\.\\d+\\.\\d,\\d+\\.\\d\\.\\.\\d+\\.\\d"
                + " held_s=\\d+\\.\\d lamps=5 lamp_ms=\\d+ edges=20/20 woke_ms=\\d+ overtaken=0 report=.*"), verdict());
        String report = Files.readString(folder.resolve("demo/report.txt"));
        for (String part : List.of("kills TANKS", "starts TANKS again, without its list of connections",
                "TANKS has joined the dispatcher", "PANEL has counted 20", "Statistics of driver 2100, BOARD")) {
            assertTrue(report.contains(part), report);
        }
        assertTrue(Files.readString(folder.resolve("demo/board.svg")).contains("gauge"));
    }

    @Test
    void aLevelThatIsNotHeldIsTold() throws IOException {
        change("tanks.toml", "on = 30, off = 50", "on = 30, off = 80");
        assertEquals(1, demo(DriverFolder.tickbus()), () -> output);
        assertTrue(verdict().matches("demo-lab: failed reason=\"the level of tank 2 is \\d+\\.\\d %, it should be 30 to 50 %\""),
                verdict());
    }

    @Test
    void aMissingConnectionIsReported() throws IOException {
        change("tanks.patch", " Q3:BOARD:I3", "");
        assertEquals(1, demo(DriverFolder.tickbus()), () -> output);
        assertEquals("demo-lab: failed reason=\"it was expected within 2000 ms that lamp 3 follows switch 3\"", verdict());
    }

    @Test
    void aProgramWithAMistakeIsTold() throws IOException {
        change("panel.toml", "\"I2\"", "\"I9\"");
        assertEquals(1, demo(DriverFolder.tickbus()), () -> output);
        assertTrue(verdict().matches("demo-lab: failed reason=\"process \\d+ of PANEL ended by itself with exit code 1;"
                + " its last words: .*panel\\.toml:\\d+:\\d+: there is no input I9; write I1 to I8; logo: failed mistakes=1\""),
                verdict());
    }

    @Test
    @DisabledOnOs(value = OS.WINDOWS, disabledReason = "the process of this test is a shell script")
    void aDispatcherThatDiesIsTold() throws IOException {
        Path dying = folder.resolve("tickbus");
        Files.writeString(dying, "#!/bin/sh\necho 'out of ideas' >&2; exit 3\n");
        assertTrue(dying.toFile().setExecutable(true));
        assertEquals(1, demo(dying), () -> output);
        assertTrue(verdict().matches("demo-lab: failed reason=\"process \\d+ of the dispatcher ended by itself with exit"
                + " code 3; its last words: out of ideas\""), verdict());
    }

    @Test
    void aWrongCommandLineIsTold() {
        PrintStream nowhere = new PrintStream(new ByteArrayOutputStream());
        assertEquals(2, LabDemo.run(new String[] {"--driver", "here"}, nowhere, nowhere));
        assertEquals(0, LabDemo.run(new String[] {"--help"}, nowhere, nowhere));
    }
}
