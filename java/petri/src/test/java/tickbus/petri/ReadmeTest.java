package tickbus.petri;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.ByteArrayOutputStream;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.Optional;
import org.junit.jupiter.api.Test;
import tickbus.petri.analysis.Reachability;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Coordinator;

/** The example of docs/petri.md, which must be there word for word. */
class ReadmeTest {
    @Test
    void theExampleOfTheDocumentationRuns() throws Exception {
        boolean[] sensors = {true, false};
        List<Double> motor = new ArrayList<>();
        ByteArrayOutputStream printed = new ByteArrayOutputStream();
        PrintStream console = System.out;
        System.setOut(new PrintStream(printed, true, StandardCharsets.UTF_8));
        // example
        PetriNet net = PetriNet.named("press")
            .place("idle", 1).place("moving").place("pressing").delay(500_000_000L).place("guard open")
            .transition("start").input("idle").output("moving").inhibitor("guard open", 1)
            .transition("arrive").input("moving").output("pressing")
            .transition("release").input("pressing").output("idle")
            .transition("open").output("guard open").inhibitor("guard open", 1)
            .transition("close").input("guard open")
            .build();

        Reachability graph = Reachability.explore(net, 100_000);
        System.out.println(graph + ", safe: " + graph.isSafe() + ", live: " + graph.isLive());
        graph.deadlock().ifPresent(deadlock -> System.out.println("stuck after " + deadlock.firings()));

        Coordinator press = Coordinator.of(net).seed(42)
            .inputs("part there", "at the bottom", "guard")
            .reader(values -> readSensors(values, sensors))
            .output("motor", 0)
            .writer(values -> motor.add(values[0]))
            .when("start", in -> in.isOn("part there"))
            .when("arrive", in -> in.isOn("at the bottom"))
            .when("open", in -> in.isOn("guard"))
            .when("close", in -> !in.isOn("guard"))
            .onEntry("moving", (in, out) -> out.set("motor", true))
            .onExit("moving", (in, out) -> out.set("motor", false))
            .build();
        press.scan(0);                       // nanoseconds, on your clock
        // end
        System.setOut(console);
        assertEquals("net press: 6 markings, 11 firings, safe: YES, live: YES\n", printed.toString(StandardCharsets.UTF_8));
        assertEquals(List.of(1.0), motor);
        sensors[1] = true;
        press.scan(10_000_000);
        assertEquals(List.of(1.0, 0.0), motor);
        assertEquals("{pressing}", press.marking().toString());
        assertEquals(510_000_000L, press.nextDue());
        sensors[0] = false;
        press.scan(510_000_000);
        assertEquals("{idle}", press.marking().toString());
        assertEquals(Optional.empty(), press.stop());

        Path root = Path.of(System.getProperty("tickbus.root", "../.."));
        String source = Files.readString(root.resolve("java/petri/src/test/java/tickbus/petri/ReadmeTest.java"));
        String example = source.substring(source.indexOf("// example\n") + 11, source.indexOf("        // end\n"))
            .replaceAll("(?m)^ {8}", "").replace("readSensors(values, sensors)", "readSensors(values)")
            .replace("motor.add(values[0])", "setMotor(values[0])");
        assertTrue(Files.readString(root.resolve("docs/petri.md")).contains(example), example);
    }

    private static void readSensors(double[] values, boolean[] sensors) {
        values[0] = sensors[0] ? 1 : 0;
        values[1] = sensors[1] ? 1 : 0;
    }
}
