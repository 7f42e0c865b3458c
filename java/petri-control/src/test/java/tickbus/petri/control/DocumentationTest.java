package tickbus.petri.control;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.Tickbus;
import tickbus.petri.net.PetriNet;

/** The example of docs/petri.md, which must be there word for word. */
@Tag("native")
class DocumentationTest {
    private static final Path ROOT = Path.of(System.getProperty("tickbus.root"));

    @TempDir
    Path folder;

    private Tickbus machine;
    private final List<String> seen = new ArrayList<>();

    @Test
    void theExampleOfTheDocumentationRuns() throws Exception {
        String page = Files.readString(ROOT.resolve("docs/petri.md"));
        int begin = page.indexOf("```toml\n", page.indexOf("## A net drives a bus")) + 8;
        Path cfg = Files.writeString(folder.resolve("gripper.cfg"), page.substring(begin, page.indexOf("```", begin)));
        try (Tickbus other = Tickbus.open(cfg, "[fieldbus]\nkind = \"loopback\"\nlink = \"gripper\"\nrole = \"device\"\n")) {
            machine = other;
            example(cfg);
        }
        assertEquals(List.of("{waiting}", "{gripping}", "{holding}"), seen);
        assertTrue(page.contains(source()), source());
    }

    private void example(Path cfg) {
        // example
        PetriNet net = PetriNet.named("gripper")
            .place("waiting", 1).place("gripping").place("holding")
            .transition("grip").input("waiting").output("gripping")
            .transition("held").input("gripping").output("holding")
            .transition("release").input("holding").output("waiting")
            .build();

        try (Tickbus bus = Tickbus.open(cfg)) {
            NetController gripper = NetController.of(bus, BoundNet.of(net)
                .when("grip").on("Piece at stop").rising()
                .when("held").on("Gripper closed")
                .when("release").off("Piece at stop")
                .during("gripping").set("Gripper")
                .during("holding").set("Gripper").set("Lamp"));
            gripper.run(10_000_000, () -> play(gripper));       // a scan every 10 ms
            gripper.stops().forEach(stop -> System.err.println(stop.message()));
        }
        // end
    }

    /** The machine's part: a piece comes, the gripper closes, the piece goes; false when the gripper is open again. */
    private boolean play(NetController gripper) {
        machine.receive();
        String marking = gripper.coordinator("gripper").marking().toString();
        if (!seen.contains(marking) && gripper.coordinator("gripper").scans() > 0) {
            seen.add(marking);
        }
        boolean lamp = machine.signal("Lamp").getBoolean();
        machine.signal("Piece at stop").setBoolean(!seen.isEmpty() && !lamp && !seen.contains("{holding}"));
        machine.signal("Gripper closed").setBoolean(machine.signal("Gripper").getBoolean());
        machine.send();
        return !gripper.stopped() && !(seen.contains("{holding}") && marking.equals("{waiting}"));
    }

    private static String source() throws IOException {
        String source = Files.readString(
            ROOT.resolve("java/petri-control/src/test/java/tickbus/petri/control/DocumentationTest.java"));
        return source.substring(source.indexOf("// example\n") + 11, source.indexOf("        // end\n"))
            .replaceAll("(?m)^ {8}", "").replace("Tickbus.open(cfg)", "Tickbus.open(Path.of(\"gripper.cfg\"))")
            .replace("() -> play(gripper));", "() -> !gripper.stopped());");
    }
}
