package tickbus.cell;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertNotNull;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.BufferedReader;
import java.io.ByteArrayOutputStream;
import java.io.IOException;
import java.io.OutputStream;
import java.io.PrintStream;
import java.net.URI;
import java.net.http.HttpClient;
import java.net.http.HttpRequest;
import java.net.http.HttpResponse;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.TimeUnit;
import java.util.jar.Attributes;
import java.util.jar.JarOutputStream;
import java.util.jar.Manifest;
import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.condition.DisabledOnOs;
import org.junit.jupiter.api.condition.OS;
import org.junit.jupiter.api.io.TempDir;
import tickbus.machines.cell.CellDemo;

/** The whole chain: simulator, driver, Modbus, the nets' process. */
@Tag("native")
class CellDemoTest {
    @TempDir
    Path folder;

    private String output;

    /** The driver's classes are on the test's class path; the folder's jar only names them. */
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
        String cfg = Files.readString(root().resolve("plc/cell/cell.cfg"));
        Files.writeString(folder.resolve("drivers/cell.cfg"), cfg.replace("127.0.0.1:15020", "127.0.0.1:0"));
        copy("reader.cfg", folder.resolve("drivers/reader.cfg"));
        copy("identification.cfg", folder.resolve("identification.cfg"));
    }

    /** With a port in the test's own folder. */
    private void copy(String cfg, Path to) throws IOException {
        String text = Files.readString(root().resolve("plc/cell").resolve(cfg));
        assertTrue(text.contains("/tmp/tickbus-cell-reader"), cfg);
        Files.writeString(to, text.replace("/tmp/tickbus-cell-reader", folder.resolve("reader").toString()));
    }

    private static Path root() {
        return Path.of(System.getProperty("tickbus.root"));
    }

    private List<String> arguments(String nets, String... more) {
        List<String> arguments = new ArrayList<>(List.of("--drivers", folder.resolve("drivers").toString(), "--control",
            root().resolve("java/machines/cell.table").toString(), "--report", folder.resolve("demo/report.txt").toString(),
            "--nets", nets, "--identification", folder.resolve("identification.cfg").toString()));
        arguments.addAll(List.of(more));
        return arguments;
    }

    private int demo(String nets, String... more) {
        ByteArrayOutputStream bytes = new ByteArrayOutputStream();
        PrintStream out = new PrintStream(bytes, true, StandardCharsets.UTF_8);
        int code = CellDemo.run(arguments(nets, more).toArray(String[]::new), out, out);
        output = bytes.toString(StandardCharsets.UTF_8);
        return code;
    }

    private String verdict() {
        return output.strip().substring(output.strip().lastIndexOf('\n') + 1);
    }

    /** The nets' process finds the native library by the same property as this one. */
    private static String nets() {
        return System.getProperty("java.class.path");
    }

    @Test
    @DisabledOnOs(value = OS.WINDOWS, disabledReason = "there are no pseudo-terminals")
    void netsMakeFourCylindersOverModbusAndFreeAJammedLoader() throws IOException {
        assertEquals(0, demo(nets(), "--cylinders", "4"), () -> output);
        assertTrue(verdict().matches("demo-cell: ok cylinders=4 kinds=\\S+ deadlocks=0 markings=\\d+ jams=1 recovered=1"
            + " vacuum_lost=0 missed=1 refills=0 emergency_stops=0 restarts=0 ticks=\\d+ report=.*"), verdict());
        assertFalse(output.contains("no row of the control table"), output);
        String report = Files.readString(folder.resolve("demo/report.txt"));
        for (String part : List.of("the loader will jam", "head 1 will miss a carrier", "station 1: ", " firings, now {",
                "all_markings", "Cylinders", "after the last", "The stations while the cell ran", "starved",
                "the control that begins", "nets: homed", "Statistics of driver 1998", "Statistics of driver 1999")) {
            assertTrue(report.contains(part), report);
        }
        for (String net : List.of("station-1", "station-3", "station-4", "transport", "cell")) {
            assertTrue(Files.readString(folder.resolve("demo/nets/" + net + ".svg")).contains("net-dot"), net);
            assertFalse(Files.readString(folder.resolve("demo/nets/" + net + ".firings")).isEmpty(), net);
        }
    }

    /** As on systems that have no pseudo-terminals. */
    @Test
    @DisabledOnOs(value = OS.WINDOWS, disabledReason = "the path of the port begins with a slash")
    void aReaderWithoutAPortIsExplained() throws IOException {
        Path cfg = folder.resolve("drivers/reader.cfg");
        Files.writeString(cfg, Files.readString(cfg).replace(folder.resolve("reader").toString(), folder + "/no/such/folder"));
        assertEquals(1, demo(nets()), () -> output);
        assertTrue(verdict().contains("the driver makes no serial port, so no PLC process can open it"), verdict());
    }

    @Test
    void aFolderWithoutTheReadersDriverIsExplained() throws IOException {
        Files.delete(folder.resolve("drivers/reader.cfg"));
        assertEquals(1, demo(nets()), () -> output);
        assertTrue(verdict().contains("1999"), verdict());
    }

    @Test
    @DisabledOnOs(value = OS.WINDOWS, disabledReason = "there are no pseudo-terminals")
    void aProgramThatIsNotThereIsNamed() throws IOException {
        Path earlier = folder.resolve("demo/nets/cell.svg");
        Files.createDirectories(earlier.getParent());
        Files.writeString(earlier, "of an earlier attempt");
        assertEquals(1, demo(folder.toString()), () -> output);
        assertFalse(Files.exists(earlier));
        assertTrue(verdict().matches("demo-cell: failed reason=\"process \\d+ of the nets ended by itself with exit code 1; .*"
            + "tickbus.cell.CellControl.*"), verdict());
    }

    @Test
    @DisabledOnOs(value = OS.WINDOWS, disabledReason = "there are no pseudo-terminals")
    void aTimeLimitIsKept() throws IOException {
        assertEquals(1, demo(nets(), "--time-limit", "200ms"), () -> output);
        assertTrue(verdict().contains("the time limit of 200ms of simulation time is over with 0 of 12 cylinders; the analysis of the "
            + "nets is not done"), verdict());
        assertTrue(Files.readString(folder.resolve("demo/report.txt")).contains("the time limit"));
    }

    @Test
    void aWrongCommandLineIsExplained() {
        assertEquals(2, demo(nets(), "--cylinder", "3"));
        assertTrue(verdict().contains("there is no option '--cylinder'; did you mean '--cylinders'?"), verdict());
    }

    private Process start(String... more) throws IOException {
        List<String> command = new ArrayList<>(List.of(Path.of(System.getProperty("java.home"), "bin", "java").toString(),
            "--enable-native-access=ALL-UNNAMED", "-Dtickbus.native.dir=" + System.getProperty("tickbus.native.dir"),
            "-cp", nets(), CellDemo.class.getName()));
        command.addAll(arguments(nets(), more));
        return new ProcessBuilder(command).redirectErrorStream(true).start();
    }

    private static List<ProcessHandle> netsAfterACylinder(Process demo, BufferedReader out) throws IOException {
        List<String> lines = new ArrayList<>();
        String line = out.readLine();
        while (line != null && !line.contains("cylinder 1,")) {
            lines.add(line);
            line = out.readLine();
        }
        List<ProcessHandle> nets = demo.children().toList();
        assertEquals(1, nets.size(), lines::toString);
        return nets;
    }

    @Test
    @DisabledOnOs(value = OS.WINDOWS, disabledReason = "there are no pseudo-terminals")
    void theNetsEndWhenTheDemoIsKilled() throws Exception {
        Process demo = start();
        ProcessHandle nets = null;
        try (BufferedReader out = demo.inputReader()) {
            nets = netsAfterACylinder(demo, out).get(0);
            demo.toHandle().destroyForcibly();
            nets.onExit().get(30, TimeUnit.SECONDS);
        } finally {
            demo.destroyForcibly();
            if (nets != null) {
                nets.destroyForcibly();
            }
        }
    }

    @Test
    @DisabledOnOs(value = OS.WINDOWS, disabledReason = "a process cannot be asked to end, only be killed")
    void aSignalEndsTheNetsToo() throws Exception {
        Process demo = start();
        try (BufferedReader out = demo.inputReader()) {
            List<ProcessHandle> nets = netsAfterACylinder(demo, out);
            // Process.destroy() would close the stream that the verdict comes from.
            demo.toHandle().destroy();
            List<String> rest = out.lines().toList();
            assertEquals("demo-cell: failed reason=interrupted", rest.get(rest.size() - 1));
            assertTrue(demo.waitFor(30, TimeUnit.SECONDS));
            assertTrue(demo.exitValue() != 0, "exit code " + demo.exitValue());
            assertFalse(nets.get(0).isAlive());
        } finally {
            demo.destroyForcibly();
        }
    }

    /** A machine that stalled begins again; a machine whose nets were killed meanwhile has failed. */
    @Test
    @DisabledOnOs(value = OS.WINDOWS, disabledReason = "a process cannot be suspended")
    void aKilledProcessOfTheNetsIsNoStall() throws Exception {
        Process demo = start();
        try (BufferedReader out = demo.inputReader()) {
            ProcessHandle nets = netsAfterACylinder(demo, out).get(0);
            signal("STOP", demo);
            nets.destroyForcibly();
            // Longer than the limit of a stall.
            Thread.sleep(1500);
            signal("CONT", demo);
            List<String> rest = out.lines().toList();
            assertTrue(rest.get(rest.size() - 1).matches("demo-cell: failed reason=\"process \\d+ of the nets ended by itself with exit "
                + "code 137.*"), rest.toString());
            assertTrue(rest.stream().noneMatch(line -> line.contains("does not count")), rest.toString());
        } finally {
            demo.destroyForcibly();
        }
    }

    private static void signal(String name, Process process) throws Exception {
        assertEquals(0, new ProcessBuilder("kill", "-" + name, String.valueOf(process.pid())).start().waitFor());
    }

    /** One cylinder per round, so that no round has a mishap. */
    @Test
    @DisabledOnOs(value = OS.WINDOWS, disabledReason = "a process cannot be asked to end, only be killed")
    void withAPageTheNetsAreSeenLiveAndRoundFollowsRoundUntilASignal() throws Exception {
        Process demo = start("--cylinders", "1", "--page");
        try (BufferedReader out = demo.inputReader()) {
            String line = out.readLine();
            String page = null;
            // If this machine stalls, the demo restarts, with one cylinder and another page.
            while (line != null && !(line.contains("cylinders=2 ") && line.contains("; the next one begins"))) {
                page = line.contains("live at ") ? line.substring(line.indexOf("http")) : page;
                line = out.readLine();
            }
            assertNotNull(line);
            HttpRequest request = HttpRequest.newBuilder(URI.create(page + "/state")).build();
            HttpResponse<String> state;
            do {
                // The first answer asks the program for its state.
                state = HttpClient.newHttpClient().send(request, HttpResponse.BodyHandlers.ofString());
                assertEquals(200, state.statusCode());
            } while (state.body().contains("\"nets\":null"));
            assertEquals(6, state.body().split("\"phases\":").length - 1, state.body());
            // Process.destroy() would close the stream that the verdict comes from.
            demo.toHandle().destroy();
            List<String> rest = out.lines().toList();
            assertTrue(rest.get(rest.size() - 1).matches("demo-cell: ok cylinders=[2-9] .*"), rest.toString());
            assertTrue(demo.waitFor(30, TimeUnit.SECONDS));
        } finally {
            demo.destroyForcibly();
        }
    }
}
