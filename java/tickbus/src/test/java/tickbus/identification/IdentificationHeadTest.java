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
import tickbus.Tickbus;
import tickbus.identification.PalletRecord.Content;
import tickbus.identification.PalletRecord.Piece;

/** A controller and a machine at the two ends of a pseudo-terminal. */
@Tag("native")
@DisabledOnOs(OS.WINDOWS)
class IdentificationHeadTest {
    private static final String[] CONTROLLER = {"%QB0", "%QB1", "%QW2", "%QL4", "%QL12", "%QL20", "%IB0", "%IB1", "%IX2.0",
        "%IB3", "%IL4", "%IL12", "%IL20"};
    private static final String[] MACHINE = {"%IX0.0", "%IL8", "%IL16", "%IL24", "%QX0.0", "%QB1", "%QL8", "%QL16", "%QL24"};

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

    /** A driver with these signals, whose names are their addresses. */
    private Tickbus open(String kind, String device, String more, String... addresses) throws IOException {
        StringBuilder text = new StringBuilder("[driver]\nid = 1\nname = \"" + kind + "\"\n[fieldbus]\nkind = \"" + kind
            + "\"\ndevice = \"" + device + directory.resolve("reader") + "\"\nreconnect = [\"10ms\"]\n" + more + "\n");
        for (String address : addresses) {
            text.append("[[signal]]\nname = \"").append(address).append("\"\naddress = \"").append(address).append("\"\n");
        }
        return Tickbus.open(Files.writeString(directory.resolve(kind + ".cfg"), text));
    }

    private void openBoth() throws IOException {
        machine = open("ivi-reader", "pty:", "", MACHINE);
        controller = open("ivi-client", "", "role = \"controller\"", CONTROLLER);
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
        for (String address : new String[] {"%IL8", "%IL16", "%IL24"}) {
            machine.signal(address).setLong(padded.getLong());
        }
        machine.signal("%IX0.0").setBoolean(true);
    }

    /** The machine lets the pallet leave; returns what its carrier holds. */
    private byte[] leave() {
        machine.signal("%IX0.0").setBoolean(false);
        until(() -> !machine.signal("%QX0.0").getBoolean());
        ByteBuffer octets = ByteBuffer.allocate(24);
        for (String address : new String[] {"%QL8", "%QL16", "%QL24"}) {
            octets.putLong(machine.signal(address).getLong());
        }
        return octets.array();
    }

    @Test
    void aControllerReadsChangesAndWritesAPallet() throws IOException {
        openBoth();
        IdentificationHead head = new IdentificationHead(controller);
        PalletRecord pallet = new PalletRecord(LocalDateTime.of(2004, 3, 9, 16, 5, 59), Piece.METALLIC, Set.of(Content.SLEEVE));
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
        assertEquals(1, machine.signal("%QB1").get(), "writes");
    }

    @Test
    void octetsGoToAnyAddressAndUnsignedSignalsOfAnyWidth() throws IOException {
        machine = open("ivi-reader", "pty:", "", MACHINE);
        controller = open("ivi-client", "", "role = \"controller\"", "%QB0", "%QB1", "%QW2", "%QB4", "%QD5", "%IB0", "%IB1",
            "%IX2.0", "%IB3", "%IW4", "%IB6", "%ID7");
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
    void aSignalThatIsNotThereIsNamed() throws IOException {
        controller = open("ivi-client", "", "role = \"controller\"", Arrays.copyOfRange(CONTROLLER, 1, 13));
        String told = assertThrows(IllegalArgumentException.class, () -> new IdentificationHead(controller)).getMessage();
        assertTrue(told.contains("needs a signal at %QB0"), told);
    }
}
