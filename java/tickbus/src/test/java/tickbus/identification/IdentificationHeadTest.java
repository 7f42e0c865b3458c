package tickbus.identification;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.ByteBuffer;
import java.nio.file.Files;
import java.nio.file.Path;
import java.time.LocalDateTime;
import java.util.Arrays;
import java.util.Set;
import java.util.function.BooleanSupplier;
import org.junit.jupiter.api.AfterEach;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.condition.DisabledOnOs;
import org.junit.jupiter.api.condition.OS;
import org.junit.jupiter.api.io.TempDir;
import tickbus.InjectedFault;
import tickbus.Tickbus;
import tickbus.identification.PalletRecord.Content;
import tickbus.identification.PalletRecord.Piece;

/** A controller and a machine at the two ends of a pseudo-terminal. */
@Tag("native")
@DisabledOnOs(OS.WINDOWS)
class IdentificationHeadTest {
    @TempDir
    Path directory;

    private Tickbus machine;
    private Tickbus controller;

    @AfterEach
    void close() {
        for (Tickbus bus : new Tickbus[] {controller, machine}) {
            if (bus != null) {
                bus.close();
            }
        }
    }

    /** A controller with these signals, whose names are their addresses. */
    private Tickbus openController(String... addresses) throws IOException {
        StringBuilder text = new StringBuilder("[driver]\nid = 2\nname = \"few\"\n[fieldbus]\nkind = \"ivi-client\"\n"
            + "role = \"controller\"\nreconnect = [\"10ms\"]\ndevice = \"" + directory.resolve("reader") + "\"\n");
        for (String address : addresses) {
            text.append("[[signal]]\nname = \"").append(address).append("\"\naddress = \"").append(address)
                .append("\"\n");
        }
        return Tickbus.open(Files.writeString(directory.resolve("few.cfg"), text));
    }

    /** Opens both ends as docs/identification.md has them. */
    private void openBoth() throws IOException {
        String docs = Files.readString(Path.of(System.getProperty("tickbus.root"), "docs/identification.md"));
        String[] parts = docs.replace("/tmp/reader", directory.resolve("reader").toString()).split("```toml\\R|```\\R");
        machine = Tickbus.open(Files.writeString(directory.resolve("machine.cfg"), parts[1]));
        // The default is to try again after a second.
        String client = parts[3].replace("[fieldbus]", "[fieldbus]\nreconnect = [\"10ms\"]");
        controller = Tickbus.open(Files.writeString(directory.resolve("controller.cfg"), client));
    }

    private void until(BooleanSupplier reached) {
        long deadline = System.nanoTime() + 20_000_000_000L;
        while (!reached.getAsBoolean()) {
            assertTrue(System.nanoTime() < deadline, () -> "did not come in 20 s\n" + controller.statistics());
            machine.exchange();
            controller.exchange();
            Thread.onSpinWait();
        }
    }

    /** The machine lets a pallet arrive. */
    private void arrive(byte[] octets) {
        ByteBuffer padded = ByteBuffer.wrap(Arrays.copyOf(octets, 24));
        for (String name : new String[] {"brings 0", "brings 8", "brings 16"}) {
            machine.signal(name).setLong(padded.getLong());
        }
        machine.signal("pallet there").setBoolean(true);
    }

    /** The machine lets the pallet leave; returns what its carrier holds. */
    private byte[] leave() {
        machine.signal("pallet there").setBoolean(false);
        until(() -> !machine.signal("pallet taken").getBoolean());
        ByteBuffer octets = ByteBuffer.allocate(24);
        for (String name : new String[] {"holds 0", "holds 8", "holds 16"}) {
            octets.putLong(machine.signal(name).getLong());
        }
        return octets.array();
    }

    @Test
    void aControllerReadsChangesAndWritesAPallet() throws IOException {
        openBoth();
        IdentificationHead head = new IdentificationHead(controller);
        PalletRecord pallet =
            new PalletRecord(LocalDateTime.of(2004, 3, 9, 16, 5, 59), Piece.METALLIC, Set.of(Content.SLEEVE));
        assertFalse(head.isPresent());
        arrive(pallet.toOctets());
        until(head::isPresent);

        head.readPallet();
        assertFalse(head.isDone());
        assertThrows(IllegalStateException.class, head::readPallet, "one command at a time");
        assertThrows(IllegalStateException.class, head::status);
        until(head::isDone);
        assertEquals(IdentificationHead.DONE, head.status());
        assertEquals(pallet, head.pallet());

        PalletRecord changed = head.pallet().with(Content.PISTON).at(LocalDateTime.of(2004, 3, 9, 16, 6, 3));
        head.writePallet(changed);
        until(head::isDone);
        assertEquals(IdentificationHead.DONE, head.status());
        assertEquals(0, head.data().length);
        assertArrayEquals(Arrays.copyOf(changed.toOctets(), 24), leave());

        until(() -> !head.isPresent());
        head.readPallet();
        until(head::isDone);
        assertEquals(IdentificationHead.NO_CARRIER, head.status());
        assertTrue(assertThrows(IllegalStateException.class, head::pallet).getMessage().contains("status 03"));

        arrive(changed.toOctets());
        until(head::isPresent);
        head.readPallet();
        until(head::isDone);
        assertEquals(changed, head.pallet());
        assertEquals(1, machine.signal("writes").get());
    }

    @Test
    void octetsGoToAnyAddressAndUnsignedSignalsOfAnyWidth() throws IOException {
        openBoth();
        controller.close();
        controller = openController("%QB0", "%QB1", "%QW2", "%QB4", "%QD5", "%IB0", "%IB1", "%IX2.0", "%IB3", "%IW4",
            "%IB6", "%ID7");
        IdentificationHead head = new IdentificationHead(controller);
        arrive(new byte[] {0, 1, 2, 3, 4, 5, 6, 7, 8, (byte) 0xFF});
        until(head::isPresent);
        head.write(2, new byte[] {3, (byte) 0xFE});
        until(head::isDone);
        head.read(1, 6);
        until(head::isDone);
        assertArrayEquals(new byte[] {1, 3, (byte) 0xFE, 4, 5, 6}, head.data());
        assertTrue(assertThrows(IllegalArgumentException.class, () -> head.read(0, 8)).getMessage()
            .contains("8 octets do not fit"));
        assertThrows(IllegalArgumentException.class, () -> head.write(0, new byte[6]));
        assertThrows(IllegalArgumentException.class, () -> head.read(0x10000, 1));
    }

    @Test
    void whileTheLineIsDownItIsNamedAndWhatWasDoneIsKnownAgainAfterwards() throws IOException {
        openBoth();
        IdentificationHead head = new IdentificationHead(controller);
        arrive(new byte[] {5});
        until(head::isPresent);
        head.read(0, 1);
        until(head::isDone);
        InjectedFault fault = machine.inject("kind = \"link-down\"");
        until(() -> controller.statistics().get("state").equals("opening"));
        String named = assertThrows(IllegalStateException.class, head::data).getMessage();
        assertTrue(named.contains("the line is opening: ") && named.contains("did not answer within"), named);
        // A finished command cannot be taken back.
        head.cancel();
        assertFalse(head.isDone());
        fault.end();
        until(head::isDone);
        assertEquals(IdentificationHead.DONE, head.status());
        assertArrayEquals(new byte[] {5}, head.data());
    }

    @Test
    void aCommandThatHasNotGoneOutIsTakenBack() throws IOException {
        openBoth();
        controller.close();
        String patient = Files.readString(directory.resolve("controller.cfg"));
        controller = Tickbus.open(Files.writeString(directory.resolve("controller.cfg"),
            patient.replace("[fieldbus]", "[fieldbus]\nmax_age = \"60s\"")));
        IdentificationHead head = new IdentificationHead(controller);
        arrive(new byte[] {5});
        until(head::isPresent);
        InjectedFault fault = controller.inject("kind = \"link-down\"");
        until(fault::isActive);
        head.write(0, new byte[] {7});
        controller.exchange();
        head.cancel();
        assertFalse(head.isDone());
        controller.exchange();
        fault.end();
        until(head::isDone);
        assertEquals(IdentificationHead.CANCELLED, head.status());
        assertTrue(assertThrows(IllegalStateException.class, head::data).getMessage().contains("was taken back"));
        head.read(0, 1);
        until(head::isDone);
        assertArrayEquals(new byte[] {5}, head.data());
        assertEquals(0, machine.signal("writes").get());
    }

    @Test
    void aSignalThatIsNotThereIsNamed() throws IOException {
        controller = openController("%QB1", "%QW2", "%IB0", "%IB1", "%IX2.0", "%IB3");
        String told =
            assertThrows(IllegalArgumentException.class, () -> new IdentificationHead(controller)).getMessage();
        assertTrue(told.contains("needs a signal at %QB0"), told);
    }
}
