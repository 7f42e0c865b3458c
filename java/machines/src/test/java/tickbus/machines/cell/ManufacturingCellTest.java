package tickbus.machines.cell;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Arrays;
import java.util.List;
import java.util.Map;
import java.util.TreeMap;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import org.junit.jupiter.api.Test;

/** The cell's mechanics, with the test at its valves. */
class ManufacturingCellTest {
    private static final long STEP = 5_000_000;
    private static final int PATIENCE = 1000;

    private final ManufacturingCell cell = new ManufacturingCell();

    private void set(String input, double value) {
        int index = cell.inputs().indexOf(input);
        assertTrue(index >= 0, input);
        cell.input(index, value);
    }

    private void on(String... inputs) {
        Arrays.stream(inputs).forEach(input -> set(input, 1));
    }

    private void off(String... inputs) {
        Arrays.stream(inputs).forEach(input -> set(input, 0));
    }

    private double get(String output) {
        int index = cell.outputs().indexOf(output);
        assertTrue(index >= 0, output);
        return cell.output(index);
    }

    private void until(String output) {
        for (int i = 0; get(output) == 0; i++) {
            assertTrue(i < PATIENCE, "not " + output);
            cell.step(STEP);
        }
    }

    private void steps(int count) {
        for (int i = 0; i < count; i++) {
            cell.step(STEP);
        }
    }

    private void sleeveInTheGripper(Colour colour) {
        cell.fillSleeves(List.of(colour));
        on("S1 loader");
        until("S1 belt back");
        off("S1 loader");
        on("S1 belt advance");
        until("S1 belt front");
        off("S1 belt advance");
        on("S1 arm lower");
        until("S1 arm down");
        on("S1 gripper");
        steps(20);
        assertEquals(0, get("S1 belt front"), "it is in the gripper");
        off("S1 arm lower");
        until("S1 arm up");
    }

    private void sleeveOnThePallet(Colour colour) {
        on("Belt");
        until("Pallet at stop 1");
        sleeveInTheGripper(colour);
        on("S1 arm out");
        until("S1 arm right");
        on("S1 arm lower");
        until("S1 arm down");
        off("S1 gripper");
        steps(2);
    }

    @Test
    void theSensorsTellTheColours() {
        for (Colour colour : Colour.values()) {
            ManufacturingCell fresh = new ManufacturingCell();
            fresh.fillSleeves(List.of(colour));
            fresh.input(fresh.inputs().indexOf("S1 loader"), 1);
            for (int i = 0; i < 30; i++) {
                fresh.step(STEP);
            }
            assertEquals(1, fresh.output(fresh.outputs().indexOf("S1 capacitive")), colour.name());
            assertEquals(colour == Colour.BLACK ? 0 : 1, fresh.output(fresh.outputs().indexOf("S1 optical")), colour.name());
            assertEquals(colour == Colour.METALLIC ? 1 : 0, fresh.output(fresh.outputs().indexOf("S1 inductive")), colour.name());
        }
    }

    @Test
    void aSleeveComesOnThePallet() {
        sleeveOnThePallet(Colour.RED);
        assertEquals(Colour.RED, cell.transport().at(1).piece().colour());
        assertEquals(0, cell.counters().fallen());
        assertEquals(0, cell.counters().collisions());
    }

    @Test
    void aSleeveThatIsLetGoInTheAirFalls() {
        sleeveInTheGripper(Colour.RED);
        off("S1 gripper");
        steps(2);
        assertEquals(1, cell.counters().fallen());
    }

    @Test
    void anArmThatIsMovedWhileItIsDownCollides() {
        on("S1 arm lower");
        until("S1 arm down");
        on("S1 arm out");
        steps(3);
        assertEquals(3, cell.counters().collisions());
    }

    @Test
    void aPressWithoutAPieceWastesItsParts() {
        cell.fillParts(1);
        on("S3 parts feeder");
        until("S3 parts forward");
        assertEquals(0, get("S3 parts there"));
        on("S3 press");
        until("S3 press down");
        assertEquals(1, cell.counters().wasted());
    }

    private byte[] memory(int pallet) {
        return cell.transport().pallets().get(pallet - 1).carrier().read(0, CodeCarrier.BYTES);
    }

    @Test
    void aHeadLendsItsCarrierToTheReaderAndTakesOverWhatThatWrites() {
        on("Belt");
        cell.transport().pallets().get(1).carrier().write(4, new byte[] {(byte) 0xFE, 1, 2, 3});
        until("Pallet at stop 3");
        steps(1);
        assertEquals(1, get("Head 3 carrier"));
        assertEquals(0xFE010203L, get("Head 3 brings 4"));
        set("Head 3 holds 0", 0xAAAAAAAAL);
        steps(1);
        assertEquals(0, memory(2)[0], "the reader has not taken it yet");
        on("Head 3 taken");
        set("Head 3 holds 0", 0x05060708L);
        set("Head 3 holds 4", 0xFE010203L);
        set("Head 3 holds 28", 0xFFFFFFFFL);
        steps(1);
        assertArrayEquals(new byte[] {5, 6, 7, 8, (byte) 0xFE, 1, 2, 3}, Arrays.copyOf(memory(2), 8));
        assertEquals(-1, memory(2)[31]);
        assertEquals(0x05060708L, get("Head 3 brings 0"));
    }

    @Test
    void whatTheReaderHasWrittenBelongsToThePalletThatLeft() {
        on("Belt");
        until("Head 3 carrier");
        on("Head 3 taken");
        steps(1);
        on("Open stop 3");
        for (int i = 0; get("Pallet at stop 3") == 1; i++) {
            assertTrue(i < PATIENCE);
            steps(1);
        }
        assertEquals(0, get("Head 3 carrier"));
        set("Head 3 holds 0", 0x01000000);
        steps(1);
        assertEquals(1, memory(2)[0]);
        off("Open stop 3");
        on("Open stop 1", "Open stop 2");
        until("Pallet at stop 3");
        steps(1);
        assertEquals(0, get("Head 3 carrier"), "while the reader still has the one before");
        off("Head 3 taken");
        steps(1);
        assertEquals(1, get("Head 3 carrier"));
        assertEquals(0, get("Head 3 brings 0"));
    }

    @Test
    void aMissedCarrierIsSeenAfterTheHeadHasBeenBack() {
        on("Belt");
        cell.missCarrier();
        until("Pallet at stop 1");
        on("S1 reader");
        steps(100);
        assertEquals(1, get("S1 reader forward"));
        assertEquals(0, get("Head 1 carrier"));
        off("S1 reader");
        until("S1 reader back");
        on("S1 reader");
        until("Head 1 carrier");
        assertEquals(1, cell.counters().carriersMissed());
    }

    @Test
    void aBlockBeyondACarriersMemoryIsRefused() {
        CodeCarrier carrier = new CodeCarrier();
        carrier.write(30, new byte[] {1, 2});
        assertArrayEquals(new byte[] {1, 2}, carrier.read(30, 2));
        assertEquals("a block of 3 bytes from 30 in a code carrier of 32 bytes",
            assertThrows(IndexOutOfBoundsException.class, () -> carrier.write(30, new byte[3])).getMessage());
        assertThrows(IndexOutOfBoundsException.class, () -> carrier.read(-1, 2));
    }

    @Test
    void aJammedLoaderStopsHalfWayUntilItHasBeenBack() {
        cell.fillSleeves(List.of(Colour.RED));
        cell.jamLoader();
        on("S1 loader");
        steps(100);
        assertTrue(cell.isJammed());
        assertEquals(0, get("S1 loader forward"));
        off("S1 loader");
        until("S1 loader back");
        on("S1 loader");
        until("S1 belt back");
        assertFalse(cell.isJammed());
        assertEquals(1, cell.counters().loaderJams());
    }

    @Test
    void aStuckPalletGetsFreeWhenTheBeltRunsBack() {
        on("Belt");
        until("Pallet at stop 1");
        cell.jamPallet();
        on("Open stop 1");
        steps(400);
        assertTrue(cell.isJammed());
        assertEquals(0, get("Pallet at stop 2"));
        off("Belt");
        on("Belt back");
        steps(21);
        assertFalse(cell.isJammed());
        off("Belt back");
        on("Belt");
        until("Pallet at stop 2");
        assertEquals(1, cell.counters().palletJams());
    }

    @Test
    void palletsStandOneBehindTheOther() {
        on("Belt", "Open stop 1", "Open stop 3", "Open stop 4");
        steps(2000);
        long[] at = cell.transport().pallets().stream().mapToLong(pallet -> pallet.micrometres).sorted().toArray();
        assertArrayEquals(new long[] {200_000, 350_000, 500_000}, at);
    }

    @Test
    void theEmergencyStopHoldsEverything() {
        on("Belt", "S1 loader");
        cell.emergency(true);
        steps(100);
        assertEquals(1, get("S1 emergency"));
        assertEquals(1, get("S1 loader back"));
        assertEquals(0, get("Pallet at stop 1"));
        cell.emergency(false);
        steps(100);
        assertEquals(1, get("S1 loader back"), "letting it go starts nothing");
        cell.rearm(true);
        steps(100);
        assertEquals(1, get("S1 loader forward"));
    }

    @Test
    void station1HasThePapersNumbers() throws IOException {
        Map<Integer, String> inputs = new TreeMap<>();
        Map<Integer, String> outputs = new TreeMap<>();
        Matcher signal = Pattern.compile("name *= \"(S1 [^\"]+)\".*# (\\w+).*\\naddress = \"%([IQ])X(\\d+)\\.(\\d)\"")
            .matcher(Files.readString(Path.of("../../plc/cell/cell.cfg")));
        while (signal.find()) {
            int number = 8 * Integer.parseInt(signal.group(4)) + Integer.parseInt(signal.group(5));
            (signal.group(3).equals("I") ? inputs : outputs).put(number, signal.group(2));
        }
        assertEquals("{0=Cinta_atras, 1=Cinta_adelante, 2=Pinza_izda, 3=Pinza_drcha, 4=Pinza_arriba, 5=Pinza_abajo, "
            + "6=Cargador_adelante, 7=Cargador_atras, 8=Emergencia, 9=Marcha, 10=Manual_automatico, 11=Ind_int, 12=Rearme, "
            + "13=Inductivo_camisa, 14=Optico_camisa, 16=Capacitivo_camisa, 17=Lector_adelante, 18=Lector_atras, "
            + "19=Optico_lector}", inputs.toString());
        assertEquals("{0=Cinta_avanza, 1=Cinta_retrocede, 2=Pinza_fuera, 3=Pinza_dentro, 4=Pinza_sube_baja, 5=Cargador, "
            + "6=Pinza, 7=Lector}", outputs.toString());
    }
}
