package tickbus.petri.control;

import static org.junit.jupiter.api.Assertions.assertEquals;

import java.nio.file.Path;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.Tickbus;
import tickbus.petri.net.PetriNet;

/** One net over each bus that has the role controller and whose other end tickbus also has. */
@Tag("native")
class BusesTest {
    /** The client's driver.cfg must name a server for tickbus to write to it. */
    private static final String WRITE_TO = "write_to = \"tickbus Gripper\"\n";

    @TempDir
    Path folder;

    /** The machine closes its gripper on command; the net counts how often it has. */
    private void gripsThrice(Tickbus machine, Tickbus plc) {
        PetriNet net = PetriNet.named("gripper").place("open", 1).place("closing").place("opening")
            .transition("grip").input("open").output("closing")
            .transition("held").input("closing").output("opening")
            .transition("released").input("opening").output("open").build();
        NetController nets = NetController.of(plc, BoundNet.of(net)
            .when("grip").on("Piece at stop").when("held").on("Gripper closed").when("released").off("Gripper closed")
            .during("closing").set("Gripper")
            .firing("held").run((in, out) -> out.set("Pieces", out.get("Pieces") + 1)).writes("Pieces"));
        machine.signal("Piece at stop").setBoolean(true);
        long begin = System.nanoTime();
        Line.until("three pieces", () -> machine.signal("Pieces").get() >= 3, () -> {
            machine.receive();
            machine.signal("Gripper closed").setBoolean(machine.signal("Gripper").getBoolean());
            machine.send();
            nets.scan(System.nanoTime() - begin);
        });
        assertEquals(0, nets.stops().size());
    }

    private static String address(Tickbus server) {
        Line.until("listening", () -> server.statistics().containsKey("address"), server::exchange);
        return "\"" + server.statistics().get("address") + "\"\n";
    }

    @Test
    void overTheLoopback() {
        String link = "kind = \"loopback\"\nlink = \"nets over the loopback\"\nrole = ";
        try (Tickbus machine = Line.open(folder, 1, link + "\"device\"\n");
                Tickbus plc = Line.open(folder, 2, link + "\"controller\"\n")) {
            gripsThrice(machine, plc);
        }
    }

    @Test
    void overModbus() {
        try (Tickbus machine = Line.open(folder, 1, "kind = \"modbus-server\"\naddress = \"127.0.0.1:0\"\ncycle = \"2ms\"\n")) {
            String client = "kind = \"modbus-client\"\nrole = \"controller\"\ncycle = \"2ms\"\naddress = " + address(machine);
            try (Tickbus plc = Line.open(folder, 2, client + WRITE_TO)) {
                gripsThrice(machine, plc);
            }
        }
    }

    @Test
    void overS7() {
        try (Tickbus machine = Line.open(folder, 1, "kind = \"s7-server\"\naddress = \"127.0.0.1:0\"\ncycle = \"2ms\"\n")) {
            String client = "kind = \"s7-client\"\nrole = \"controller\"\ncycle = \"2ms\"\naddress = " + address(machine);
            try (Tickbus plc = Line.open(folder, 2, client + WRITE_TO)) {
                gripsThrice(machine, plc);
            }
        }
    }
}
