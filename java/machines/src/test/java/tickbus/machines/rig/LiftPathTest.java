package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertNull;
import static org.junit.jupiter.api.Assertions.assertSame;
import static org.junit.jupiter.api.Assertions.assertTrue;

import org.junit.jupiter.api.Test;

/** Bottles on one lift's path, including places that no command word can bring them to. */
class LiftPathTest {
    private static final long MILLI = 1_000_000L;

    private final Faults faults = new Faults();
    private final Wheel wheel1 = new Wheel(90, 180, 600, 0);
    private final Wheel wheel2 = new Wheel(180, 300, 1000, 0);
    private final Slots pockets = new Slots("wheel 1", wheel1, Bottle.Place.POCKET, 4, Geometry.POCKET_FLOOR);
    private final Slots sleeves = new Slots("wheel 2", wheel2, Bottle.Place.SLEEVE, 2, Geometry.SLEEVE_FLOOR);
    private final Seat pocket = new Seat(pockets, Geometry.LIFT_STATION);
    private final Seat sleeve = new Seat(sleeves, Geometry.OVER_LIFT1);
    private final LiftPath path = new LiftPath(
            Lift.LA1,
            new LiftDrive("lift 1", 0),
            new SuctionCup("SC1", Bottle.Place.CUP1),
            new Beam(Geometry.BEAM1),
            pocket,
            sleeve,
            faults);

    @Test
    void aPocketThatIsFullTakesNoSecondBottle() {
        Bottle first = bottle(1, pocket);
        path.suction(true);
        assertSame(first, path.cup().held());
        path.drive().by(Geometry.BIG, LiftDrive.Pace.BIG, faults);
        run(700);
        bottle(2, pocket);
        path.drive().toBottom();
        run(700);
        assertTrue(faults.texts().get(0).contains("brought bottle 1 to wheel 1, where bottle 2 already was"));
    }

    @Test
    void aBottleDoesNotGoDownIntoAWheelBetweenTwoPositions() {
        bottle(1, pocket);
        path.suction(true);
        path.drive().by(Geometry.BIG, LiftDrive.Pace.BIG, faults);
        run(700);
        wheel1.command(true, false, false);
        wheel1.advance(300 * MILLI, true);
        path.drive().toBottom();
        run(700);
        assertTrue(faults.texts().get(0).contains("lift 1 ran into wheel 1, which stood between two index positions"));
    }

    @Test
    void aCupThatArrivesWithVacuumGripsTheBottleInTheSleeve() {
        Bottle bottle = bottle(1, sleeve);
        path.suction(true);
        path.drive().by(Geometry.BIG, LiftDrive.Pace.BIG, faults);
        run(700);
        assertSame(bottle, path.cup().held());
        assertNull(sleeve.bottle());
        path.drive().toBottom();
        run(700);
        assertEquals(0, bottle.height());
        path.suction(false);
        assertSame(bottle, pocket.bottle());
        assertTrue(faults.texts().isEmpty());
    }

    @Test
    void aBottleStaysInItsSleeveWhenTheCupLetsGoOfIt() {
        Bottle bottle = bottle(1, pocket);
        path.suction(true);
        path.drive().by(Geometry.BIG, LiftDrive.Pace.BIG, faults);
        run(700);
        path.suction(false);
        path.drive().by(-Geometry.SMALL, LiftDrive.Pace.SMALL, faults);
        run(600);
        assertSame(bottle, sleeve.bottle());
        assertEquals(Geometry.SLEEVE_FLOOR, bottle.height());
        assertTrue(path.clearOfUpper());
    }

    @Test
    void aBottleThatAWheelBringsToACupWithVacuumIsGrippedAtRest() {
        Bottle bottle = new Bottle();
        bottle.number(1);
        pockets.hold(pockets.at(Geometry.INFEED), bottle);
        path.suction(true);
        wheel1.command(true, false, false);
        for (int i = 0; i < 810; i++) {
            wheel1.advance(MILLI, true);
            path.advance(MILLI);
        }
        assertSame(bottle, path.cup().held());
    }

    private static Bottle bottle(int number, Seat seat) {
        Bottle bottle = new Bottle();
        bottle.number(number);
        seat.hold(bottle);
        return bottle;
    }

    private void run(int milliseconds) {
        for (int i = 0; i < milliseconds; i++) {
            path.advance(MILLI);
        }
    }
}
