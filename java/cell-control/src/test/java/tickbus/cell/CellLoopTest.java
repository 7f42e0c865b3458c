package tickbus.cell;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.time.LocalDateTime;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import java.util.Set;
import java.util.TreeMap;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import tickbus.Signal;
import tickbus.identification.IdentificationHead;
import tickbus.identification.PalletRecord;
import tickbus.identification.PalletRecord.Content;
import tickbus.identification.PalletRecord.Piece;
import tickbus.machines.cell.Colour;
import tickbus.machines.cell.Pallet;
import tickbus.machines.cell.PieceKind;
import tickbus.machines.cell.Workpiece;

/** The nets make cylinders in the cell, without mishaps and with them. */
@Tag("native")
class CellLoopTest extends CellLoop {
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
        assertEquals(0, heads.failures());
    }

    /** Checks the machine's carriers, not what the nets believe. */
    @Test
    void theRecordGrowsFromStationToStation() {
        List<PalletRecord> seen = new ArrayList<>();
        until("a cylinder", () -> {
            for (Pallet pallet : cell.transport().pallets()) {
                PalletRecord now = PalletRecord.ofOctets(pallet.carrier().read(0, PalletRecord.LENGTH));
                if (now.time() != null && !seen.contains(now)) {
                    seen.add(now);
                }
            }
            return cell.delivered().size() == 1 && seen.contains(blank());
        });
        Piece piece = seen.get(0).piece();
        assertEquals(Piece.BLACK, piece, "the first sleeve is black, and gets no cap");
        Set<Content> sleeve = Set.of(Content.SLEEVE, Content.PIECE);
        Set<Content> closed = Set.of(Content.SLEEVE, Content.PISTON, Content.SPRING, Content.HEAD, Content.PIECE);
        assertEquals(new PalletRecord(blank().time(), piece, sleeve), seen.get(0));
        assertTrue(seen.contains(new PalletRecord(blank().time(), piece, closed)), seen::toString);
    }

    /** The record that station 4 leaves on a pallet. */
    private static PalletRecord blank() {
        return PalletRecord.BLANK.at(LocalDateTime.of(2004, 3, 9, 16, 5, 59));
    }

    @Test
    void aMissedCarrierIsReadAfterTheHeadHasBeenBack() {
        cell.missCarrier();
        delivers(2);
        assertEquals(1, times("station 1.carrier missed"));
        assertEquals(1, times("station 1.reader is back"));
        assertEquals(1, cell.counters().carriersMissed());
        assertEquals(1, heads.failures());
    }

    @Test
    void whatTheReaderDidNotDoIsTriedAgain() {
        reader.fail(3, IdentificationHead.NO_ANSWER, 4);
        reader.fail(4, IdentificationHead.NO_CARRIER, 2);
        delivers(1);
        assertEquals(4, times("station 3.read again"));
        assertEquals(2, times("station 4.read again"));
        reader.fail(1, 4, 1);
        delivers(6);
        assertEquals(7, heads.failures());
    }

    @Test
    void aRecordThatWasNotWrittenIsWrittenAgain() {
        until("pressed", () -> times("station 3.head pressed") == 1);
        reader.fail(3, 4, 2);
        delivers(1);
        assertEquals(2, times("station 3.write again"));
    }

    @Test
    void aCarrierThatIsNeverReadStopsItsStationAlone() {
        reader.fail(3, IdentificationHead.NO_CARRIER, Integer.MAX_VALUE);
        until("a stop", () -> !nets.stops().isEmpty());
        assertEquals(StationHead.ATTEMPTS, times("station 3.read again"));
        assertEquals(1, nets.stops().size());
        String told = nets.stops().get(0).message();
        assertTrue(told.contains("net station 3") && told.contains("Head 3 has not read its carrier in 5 attempts; the reader "
            + "says that there is none (status 03): see whether the pallet stands at its stop"), told);
        until("a sleeve on a pallet", () -> times("station 1.written") == 1);
    }

    @Test
    void aReaderThatNeverAnswersStopsTheStations() {
        reader.hang();
        until("three stops", () -> nets.stops().size() == 3);
        String told = nets.stops().get(0).message();
        assertTrue(told.contains("Head 1 has had no answer for 10 s, and the line to the reader is down"), told);
    }

    @Test
    void aCarrierWithoutARecordStopsItsStation() {
        cell.transport().pallets().forEach(pallet -> pallet.carrier().write(PalletRecord.LENGTH - 1, new byte[] {7}));
        until("a stop", () -> !nets.stops().isEmpty());
        String told = nets.stops().get(0).message();
        assertTrue(told.contains("octet 20 of a pallet's record is 07"), told);
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
        int begun = cell.counters().begun();
        for (int i = 0; i < 400; i++) {
            tick();
        }
        assertEquals(1, nets.coordinator("station 1").marking().get("no sleeve"));
        assertEquals(begun, cell.counters().begun());
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

    /** Releases the emergency stop, which starts nothing, and presses Rearm. */
    private void letGo() {
        cell.emergency(false);
        Map<String, Integer> before = Map.copyOf(fired);
        for (int i = 0; i < 100; i++) {
            tick();
        }
        assertEquals(before, fired);
        assertEquals(List.of("S1 gripper", "S4 vacuum valve"), plc.signals().stream()
            .filter(one -> one.isWritten() && one.get() != 0).map(Signal::name).toList(), "the fail-safe values");
        cell.rearm(true);
        for (int i = 0; i < 20; i++) {
            tick();
        }
        cell.rearm(false);
    }

    @Test
    void theEmergencyStopHaltsEverythingAndWorkGoesOnAfterRearm() {
        delivers(1);
        cell.emergency(true);
        for (int i = 0; i < 1000; i++) {
            tick();
        }
        assertEquals(1, cell.delivered().size());
        letGo();
        delivers(12);
        assertEquals(0, times("station 1.loader jams"));
        assertEquals(0, cell.counters().palletJams());
    }

    /** Each stop lasts longer than every delay, and comes at another moment of the cycle each time. */
    @Test
    void whatStoodStillInAnEmergencyStopDoesNotCountAsStuck() {
        while (cell.delivered().size() < 12) {
            for (int i = 0; i < 70; i++) {
                tick();
            }
            cell.emergency(true);
            for (int i = 0; i < 400; i++) {
                tick();
            }
            letGo();
            assertTrue(nanos < 400_000_000_000L, this::state);
        }
        assertEquals(List.of(), nets.stops());
        assertEquals(0, times("station 1.loader jams"));
        assertEquals(0, fired.entrySet().stream().filter(one -> one.getKey().startsWith("transport.stuck"))
            .mapToInt(Map.Entry::getValue).sum(), fired.toString());
    }
}
