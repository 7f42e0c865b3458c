package tickbus.cell;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import java.util.TreeMap;
import java.util.concurrent.atomic.AtomicInteger;
import java.util.function.BooleanSupplier;
import org.junit.jupiter.api.AfterEach;
import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import tickbus.Signal;
import tickbus.Tickbus;
import tickbus.demo.cell.Colour;
import tickbus.demo.cell.ManufacturingCell;
import tickbus.demo.cell.PieceKind;
import tickbus.demo.cell.Workpiece;
import tickbus.petri.control.BoundNet;
import tickbus.petri.control.NetController;

/** The nets and the cell, over a bus in simulation time. */
@Tag("native")
class CellLoopTest {
    private static final AtomicInteger LINKS = new AtomicInteger();
    private static final long STEP = 5_000_000;
    private static final int PARTS = 20;

    private final ManufacturingCell cell = new ManufacturingCell();
    private Tickbus machine;
    private Tickbus plc;
    private NetController nets;
    private List<Signal> written;
    private List<Signal> read;
    private int[] writes;
    private int[] reads;
    private final Map<String, Integer> fired = new TreeMap<>();
    private long nanos;

    @BeforeEach
    void open() {
        Path cfg = Path.of(System.getProperty("tickbus.root"), "plc/cell/cell.cfg");
        String link = "[fieldbus]\nkind = \"loopback\"\nmode = \"stepped\"\nlink = \"cell " + LINKS.incrementAndGet() + "\"\nrole = ";
        machine = Tickbus.open(cfg, link + "\"device\"\n");
        plc = Tickbus.open(cfg, link + "\"controller\"\n");
        BoundNet[] all = CellNets.all();
        for (BoundNet one : all) {
            one.listener((scan, at, transition, choices) ->
                fired.merge(one.net().name() + "." + one.net().transition(transition).name(), 1, Integer::sum));
        }
        nets = NetController.of(plc, all);
        written = machine.signals().stream().filter(Signal::isWritten).toList();
        read = machine.signals().stream().filter(signal -> !signal.isWritten()).toList();
        writes = written.stream().mapToInt(signal -> cell.outputs().indexOf(signal.name())).toArray();
        reads = read.stream().mapToInt(signal -> cell.inputs().indexOf(signal.name())).toArray();
        cell.fillSleeves(List.of(Colour.BLACK, Colour.RED, Colour.METALLIC, Colour.RED, Colour.RED, Colour.BLACK,
            Colour.METALLIC, Colour.METALLIC, Colour.BLACK, Colour.BLACK, Colour.RED, Colour.METALLIC));
        cell.fillParts(PARTS);
        cell.fillHeads(20);
        cell.fillCaps(20);
        cell.start(true);
    }

    @AfterEach
    void close() {
        plc.close();
        machine.close();
    }

    private void tick() {
        machine.receive(nanos);
        for (int i = 0; i < reads.length; i++) {
            cell.input(reads[i], read.get(i).get());
        }
        cell.step(STEP);
        for (int i = 0; i < writes.length; i++) {
            written.get(i).set(cell.output(writes[i]));
        }
        machine.send();
        nets.scan(nanos);
        nanos += STEP;
    }

    private void until(String what, BooleanSupplier so) {
        long limit = nanos + 60_000_000_000L;
        while (!so.getAsBoolean()) {
            assertTrue(nanos < limit, () -> "not " + what + " within a minute: " + state());
            tick();
        }
    }

    private String state() {
        List<String> markings = new ArrayList<>();
        for (String net : List.of("station 1", "station 3", "station 4", "transport", "cell")) {
            markings.add(net + " " + nets.coordinator(net).marking());
        }
        return markings + ", delivered " + cell.delivered().size() + ", " + nets.stops();
    }

    private void delivers(int count) {
        until(count + " cylinders", () -> cell.delivered().size() >= count);
        assertEquals(List.of(), nets.stops());
    }

    private int times(String transition) {
        return fired.getOrDefault(transition, 0);
    }

    @Test
    void twelveSleevesBecomeTwoCylindersOfEachKind() {
        delivers(12);
        Map<PieceKind, Integer> kinds = new TreeMap<>();
        for (Workpiece piece : cell.delivered()) {
            assertTrue(piece.isComplete(), "piece " + piece.number());
            kinds.merge(PieceKind.of(piece), 1, Integer::sum);
        }
        assertEquals(6, kinds.size(), kinds::toString);
        assertTrue(kinds.values().stream().allMatch(count -> count == 2), kinds::toString);
        assertEquals(0, cell.counters().fallen());
        assertEquals(0, cell.counters().wasted());
        assertEquals(0, cell.counters().collisions());
        assertEquals(0, times("station 1.loader jams"));
        assertEquals(0, times("transport.stuck before 1"));
    }

    @Test
    void theSameRunTwiceFiresTheSame() {
        delivers(3);
        Map<String, Integer> first = new TreeMap<>(fired);
        long end = nanos;
        close();
        CellLoopTest again = new CellLoopTest();
        again.open();
        again.delivers(3);
        again.close();
        assertEquals(end, again.nanos);
        assertEquals(first, again.fired);
        open();
    }

    @Test
    void aJammedLoaderGoesBackAndTriesAgain() {
        cell.jamLoader();
        delivers(1);
        assertEquals(1, times("station 1.try again"));
        assertEquals(1, cell.counters().loaderJams());
    }

    @Test
    void aStuckPalletIsFreedByTheBeltGoingBack() {
        delivers(1);
        cell.jamPallet();
        delivers(6);
        assertEquals(1, cell.counters().palletJams());
        assertEquals(1, List.of(1, 2, 3, 4).stream().mapToInt(stop -> times("transport.free before " + stop)).sum());
        assertFalse(cell.isJammed());
    }

    @Test
    void aPieceThatTheVacuumDropsIsTakenAgain() {
        cell.loseVacuum();
        delivers(2);
        assertEquals(1, cell.counters().vacuumLosses());
        assertEquals(1, times("station 4.vacuum lost"));
        assertEquals(0, cell.counters().fallen());
    }

    @Test
    void anEmptyMagazineIsShownAndWorkGoesOnWhenItIsFilled() {
        cell.fillParts(1 - PARTS);
        until("an empty magazine", cell::showsEmptyParts);
        delivers(1);
        assertTrue(cell.showsEmptyParts());
        cell.fillParts(PARTS);
        delivers(3);
        assertEquals(1, times("station 3.parts filled"));
        assertFalse(cell.showsEmptyParts());
    }

    @Test
    void withoutSleevesStation1WaitsForTheRearmButton() {
        delivers(12);
        until("an empty magazine", () -> nets.coordinator("station 1").marking().get("no sleeve") == 1);
        cell.fillSleeves(List.of(Colour.RED));
        cell.rearm(true);
        delivers(13);
        assertEquals(PieceKind.RED, PieceKind.of(cell.delivered().get(12)));
    }

    @Test
    void theSwitchStopsTheSupplyAndWhatIsBegunIsFinished() {
        delivers(2);
        cell.start(false);
        until("stopped", () -> !cell.showsRunning());
        until("no sleeve on its way out", () -> nets.coordinator("station 1").marking().get("loading") == 0);
        int begun = cell.counters().begun();
        delivers(begun);
        for (int i = 0; i < 1000; i++) {
            tick();
        }
        assertEquals(begun, cell.delivered().size());
    }

    @Test
    void theEmergencyStopHaltsEverythingAndWorkGoesOnAfterIt() {
        delivers(1);
        cell.emergency(true);
        for (int i = 0; i < 1000; i++) {
            tick();
        }
        assertEquals(1, cell.delivered().size());
        cell.emergency(false);
        delivers(12);
        assertEquals(0, times("station 1.loader jams"));
        assertEquals(0, cell.counters().palletJams());
    }
}
