package tickbus;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertNotEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.stream.IntStream;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;

@Tag("native")
class InjectedFaultTest {
    private static final long TICK = 1_000_000;

    @TempDir
    Path directory;

    private long now;

    private Tickbus mirror(String... lines) {
        return DriverCfg.mirror(1)
            .signal("in", "%IX0.0")
            .signal("out", "%QX0.0")
            .signal("level", "%IW2", "type = \"INT\"", "unit = \"mm\"")
            .signal("copy", "%QW2", lines)
            .open(directory);
    }

    private void tick(Tickbus bus) {
        for (int i = 0; i < 3; i++) {
            now += TICK;
            bus.exchange(now);
        }
    }

    @Test
    void aStuckSignalIsStuckUntilItsFaultEnds() {
        try (Tickbus bus = mirror("type = \"INT\"")) {
            Signal in = bus.signal("in");
            in.set(1);
            tick(bus);
            assertTrue(bus.signal("out").getBoolean());
            InjectedFault stuck = bus.inject("""
                kind   = "stuck"
                signal = "in"
                value  = false
                """);
            assertEquals(InjectedFault.State.WAITING, stuck.state());
            tick(bus);
            assertTrue(stuck.isActive());
            assertEquals("stuck in (stuck): \"in\" is stuck at 0", stuck.toString());
            assertFalse(bus.signal("out").getBoolean(), "what the PLC sees");
            assertTrue(in.getBoolean(), "what the simulation wrote stays its own");
            assertEquals("stuck in", bus.statistics().get("fault.active"));
            stuck.end();
            tick(bus);
            assertEquals(InjectedFault.State.OVER, stuck.state());
            assertEquals(1, stuck.begun());
            assertTrue(bus.signal("out").getBoolean());
            assertEquals("", bus.statistics().get("fault.active"));
            assertEquals("1", bus.statistics().get("fault.begun"));
        }
    }

    @Test
    void aPulledCableIsStaleAndSaysThatItWasPulled() {
        try (Tickbus bus = mirror("type = \"INT\"")) {
            tick(bus);
            try (InjectedFault cable = bus.inject("kind = \"link-down\"\nname = \"cable\"")) {
                tick(bus);
                assertTrue(cable.isActive());
                assertEquals("failed", bus.statistics().get("state"));
                assertEquals("injected", bus.statistics().get("cause"));
                assertTrue(bus.statistics().get("reason").contains("\"cable\""), bus.statistics()::toString);
                now += 1_000_000_000;
                assertEquals(Status.STALE.code(), bus.exchange(now));
            }
            assertEquals(Status.FRESH.code(), bus.exchange(now + 1));
            assertEquals("running", bus.statistics().get("state"));
        }
    }

    @Test
    void mistakesAreToldAtTheirPlaces() {
        try (Tickbus bus = mirror("type = \"INT\"")) {
            FieldbusException wrong = assertThrows(FieldbusException.class, () -> bus.inject("""
                kind   = "offset"
                signal = "levle"
                by     = "5 cm"
                """));
            assertEquals(Status.BAD_ARGUMENT, wrong.status());
            String told = "fault:2:10: there is no signal \"levle\"; did you mean \"level\"?";
            assertTrue(wrong.getMessage().contains(told), wrong::getMessage);
            wrong = assertThrows(FieldbusException.class, () -> bus.inject("""
                kind   = "offset"
                signal = "level"
                by     = "5 cm"
                """));
            told = "fault:3:10: \"level\" is in mm, not in cm; write the number in mm";
            assertTrue(wrong.getMessage().contains(told), wrong::getMessage);
            assertEquals(List.of(), bus.faults());
        }
    }

    @Test
    void faultsOfTheModelAreHandedOverInTheTickInWhichTheyBeginAndEnd() {
        try (Tickbus bus = mirror("type = \"INT\"")) {
            List<String> told = new ArrayList<>();
            FaultHandler handler = (name, value) -> told.add(name + "=" + value);
            assertEquals(0, bus.pollFaults(handler), "nothing is declared");
            FieldbusException wrong = assertThrows(FieldbusException.class,
                () -> bus.inject("kind = \"model\"\nname = \"leak\""));
            assertEquals(Status.BAD_ARGUMENT, wrong.status());
            assertTrue(wrong.getMessage().contains("let the simulation declare it"), wrong::getMessage);
            List<String> names = IntStream.range(0, 40).mapToObj(i -> "leak " + i).toList();
            bus.declareFaults(names);
            wrong = assertThrows(FieldbusException.class, () -> bus.declareFaults(List.of("a", "a")));
            assertEquals(Status.BAD_ARGUMENT, wrong.status());
            wrong = assertThrows(FieldbusException.class,
                () -> bus.inject("kind = \"model\"\nname = \"leek 7\""));
            assertTrue(wrong.getMessage().contains("did you mean \"leak 7\"?"), wrong::getMessage);
            bus.receive(++now);
            InjectedFault fault = bus.inject("kind = \"model\"\nname = \"leak 7\"\nvalue = 0.4");
            assertEquals(0, bus.pollFaults(handler), "it begins with the next tick");
            bus.receive(++now);
            assertEquals(1, bus.pollFaults(handler));
            assertEquals(0, bus.pollFaults(handler));
            fault.end();
            bus.exchange(++now);
            assertEquals(1, bus.pollFaults(handler));
            assertEquals(List.of("leak 7=0.4", "leak 7=0.0"), told);
            told.clear();
            names.forEach(name -> bus.inject("kind = \"model\"\nname = \"" + name + "\""));
            bus.exchange(++now);
            assertEquals(40, bus.pollFaults(handler), "more than one native call fetches");
            assertEquals(names.stream().map(name -> name + "=1.0").toList(), told);
        }
    }

    @Test
    void faultsOfManyTestsFollowEachOther() {
        try (Tickbus bus = mirror("type = \"INT\"")) {
            int last = 0;
            for (int i = 0; i < 80; i++) {
                InjectedFault fault = bus.inject("kind = \"invert\"\nsignal = \"in\"");
                assertNotEquals(last, fault.id());
                last = fault.id();
                bus.exchange(now++);
                fault.end();
                bus.exchange(now++);
            }
            assertEquals("80", bus.statistics().get("fault.begun"));
            assertTrue(bus.faults().size() <= 64);
        }
    }
}
