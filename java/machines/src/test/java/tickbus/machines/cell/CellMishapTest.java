package tickbus.machines.cell;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import org.junit.jupiter.api.Test;

/** Mishaps that are provoked at any moment, as the operator of the demo does. */
class CellMishapTest {
    private static final long STEP = 5_000_000;

    @Test
    void aCylinderPastItsMiddleFinishesItsStrokeAndJamsWithTheNext() {
        for (int begun = 0; begun <= 20; begun++) {
            PneumaticCylinder cylinder = new PneumaticCylinder(20 * STEP);
            for (int i = 0; i < begun; i++) {
                cylinder.step(true, STEP);
            }
            cylinder.jam();
            for (int i = begun; i < 20; i++) {
                cylinder.step(true, STEP);
            }
            assertEquals(begun > 10, cylinder.isForward(), "after " + begun + " steps");
            assertEquals(begun <= 10, cylinder.isJammed(), "after " + begun + " steps");
            for (int strokes = 0; strokes < 2 && !cylinder.isJammed(); strokes++) {
                move(cylinder, false);
                move(cylinder, true);
            }
            assertTrue(cylinder.isJammed(), "after " + begun + " steps");
            move(cylinder, false);
            move(cylinder, true);
            assertTrue(cylinder.isForward());
        }
    }

    private static void move(PneumaticCylinder cylinder, boolean forward) {
        for (int i = 0; i < 20; i++) {
            cylinder.step(forward, STEP);
        }
    }

    @Test
    void aFaultByNameIsAMishapAndEndsWithTheFault() {
        ManufacturingCell cell = new ManufacturingCell();
        int loader = cell.inputs().indexOf("S1 loader");
        int forward = cell.outputs().indexOf("S1 loader forward");
        cell.fault("jam of the loader", 1);
        cell.input(loader, 1);
        for (int i = 0; i < 50; i++) {
            cell.step(STEP);
        }
        assertTrue(cell.isJammed());
        assertEquals(0, cell.output(forward));
        cell.fault("jam of the loader", 0);
        for (int i = 0; i < 50; i++) {
            cell.step(STEP);
        }
        assertFalse(cell.isJammed());
        assertEquals(1, cell.output(forward));
        cell.modelFaults().forEach(fault -> cell.fault(fault.name(), 0));
    }

    @Test
    void aWornCylinderHasSoMuchLessOfItsSpeed() {
        PneumaticCylinder cylinder = new PneumaticCylinder(20 * STEP);
        cylinder.wear(0.75);
        for (int strokes = 0; strokes < 4; strokes++) {
            assertFalse(cylinder.isForward(), "after the time of " + strokes + " strokes");
            move(cylinder, true);
        }
        assertTrue(cylinder.isForward());
    }

    @Test
    void aVacuumThatIsToBeLostOverTheExitIsLostWithTheNextPiece() {
        Counters counters = new Counters();
        StationFour station = new StationFour(counters);
        Pallet pallet = new Pallet(1, 0);
        pallet.piece = new Workpiece(1, Colour.RED, 0);
        take(station, pallet);
        station.armOut = true;
        run(station, pallet);
        station.loseVacuum();
        station.armLower = true;
        run(station, pallet);
        station.vacuumValve = false;
        run(station, pallet);
        assertEquals(1, station.delivered().size());
        assertEquals(0, counters.fallen());
        station.armLower = false;
        run(station, pallet);
        station.armOut = false;
        station.armIn = true;
        run(station, pallet);
        pallet.piece = new Workpiece(2, Colour.RED, 0);
        take(station, pallet);
        assertFalse(station.hasVacuum());
        assertEquals(1, counters.vacuumLosses());
        assertEquals(2, pallet.piece.number());
    }

    /** Lowers the arm, sucks, and lifts. */
    private static void take(StationFour station, Pallet pallet) {
        station.armLower = true;
        station.vacuumValve = true;
        run(station, pallet);
        station.armLower = false;
        run(station, pallet);
    }

    private static void run(StationFour station, Pallet pallet) {
        for (int i = 0; i < 40; i++) {
            station.step(pallet, STEP);
        }
    }

    @Test
    void palletsThatGoBackStayOneBehindTheOther() {
        Transport transport = new Transport();
        transport.forward = true;
        for (int stop = 0; stop < Transport.STOPS; stop++) {
            // Until all three are one behind the other before stop 2.
            transport.open[stop] = stop != 1;
        }
        for (int i = 0; i < 2000; i++) {
            transport.step(STEP);
        }
        transport.forward = false;
        transport.backward = true;
        for (int i = 0; i < 2000; i++) {
            transport.step(STEP);
            long[] at = transport.pallets().stream().mapToLong(pallet -> pallet.micrometres).sorted().toArray();
            assertTrue(at[1] - at[0] >= 150_000 && at[2] - at[1] >= 150_000, at[0] + " " + at[1] + " " + at[2]);
        }
    }

    @Test
    void whileAPalletIsStuckNoOtherGetsStuck() {
        Transport transport = new Transport();
        transport.forward = true;
        for (int stop = 0; stop < Transport.STOPS; stop++) {
            transport.open[stop] = true;
        }
        transport.jam();
        while (!transport.isJammed()) {
            transport.step(STEP);
        }
        transport.jam();
        for (int i = 0; i < 1000; i++) {
            transport.step(STEP);
        }
        transport.forward = false;
        transport.backward = true;
        for (int i = 0; i < 21; i++) {
            transport.step(STEP);
        }
        assertFalse(transport.isJammed(), "the first is free");
        transport.backward = false;
        transport.forward = true;
        for (int i = 0; i < 1000 && !transport.isJammed(); i++) {
            transport.step(STEP);
        }
        assertTrue(transport.isJammed(), "and then the second gets stuck");
    }
}
