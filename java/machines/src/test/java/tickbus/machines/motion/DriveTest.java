package tickbus.machines.motion;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;

/** Durations and distances of planned motions. */
class DriveTest {
    private static final long MILLI = 1_000_000L;

    /** The command documented in 2018: speed 8000, acceleration and deceleration 15000. */
    private static Drive captured(double distance, double jerk) {
        Drive drive = new Drive(100);
        drive.jerk(jerk);
        drive.moveTo(100 + distance, 8000, 15000, 15000);
        return drive;
    }

    @ParameterizedTest
    @CsvSource({"6300, 1.32083", "13950, 2.27708", "1000, 0.51640", "4266.67, 1.06667", "-6300, 1.32083", "0, 0"})
    void aMoveTakesAsLongAsTheTrapezoidOrTriangle(double distance, double seconds) {
        Drive drive = captured(distance, 0);
        assertEquals(seconds, drive.plannedSeconds(), 1e-5);
        drive.advance((long) (seconds * 1e9) - 10 * MILLI);
        assertEquals(distance != 0, drive.moving());
        drive.advance(11 * MILLI);
        assertFalse(drive.moving());
        assertEquals(100 + distance, drive.position());
        assertEquals(0, drive.velocity());
    }

    @Test
    void aTriangleNeverReachesTheSpeed() {
        Drive drive = captured(1000, 0);
        double fastest = 0;
        while (drive.moving()) {
            drive.advance(MILLI / 10);
            fastest = Math.max(fastest, drive.velocity());
        }
        assertEquals(3872.98, fastest, 2);
    }

    @ParameterizedTest
    @CsvSource({"0", "150000", "20000"})
    void thePlaceDoesNotDependOnTheSteps(double jerk) {
        Drive fine = captured(13950, jerk);
        Drive coarse = captured(13950, jerk);
        for (int i = 0; i < 700; i++) {
            fine.advance(MILLI);
        }
        coarse.advance(700 * MILLI);
        assertEquals(coarse.position(), fine.position());
        assertEquals(coarse.velocity(), fine.velocity());
    }

    /**
     * A jerk adds acceleration / jerk to each of the two changes of speed, and lengthens their distances accordingly.
     */
    @Test
    void anSTakesLongerAndKeepsToAccelerationAndJerk() {
        Drive drive = captured(13950, 150000);
        assertEquals(2.27708 + 0.1, drive.plannedSeconds(), 1e-5);
        double steepest = 0;
        double lastVelocity = 0;
        double lastAcceleration = 0;
        double jerk = 0;
        while (drive.moving()) {
            drive.advance(MILLI);
            double acceleration = (drive.velocity() - lastVelocity) * 1000;
            steepest = Math.max(steepest, Math.abs(acceleration));
            jerk = Math.max(jerk, Math.abs(acceleration - lastAcceleration) * 1000);
            lastVelocity = drive.velocity();
            lastAcceleration = acceleration;
        }
        assertEquals(15000, steepest, 15);
        assertEquals(150000, jerk, 2000);
        assertEquals(14050, drive.position());
    }

    @ParameterizedTest
    @CsvSource({"6300, 150000", "1000, 150000", "13950, 5000", "3, 20000"})
    void aShortSArrivesWithoutAJump(double distance, double jerk) {
        Drive drive = captured(distance, jerk);
        double last = drive.position();
        double farthest = 0;
        while (drive.moving()) {
            drive.advance(MILLI);
            farthest = Math.max(farthest, drive.position() - last - Math.abs(drive.velocity()) / 1000);
            last = drive.position();
        }
        assertTrue(farthest < 0.1, "it jumped by " + farthest);
        assertEquals(100 + distance, drive.position());
    }

    @Test
    void aNewTargetAheadIsReachedWithoutAStop() {
        Drive drive = captured(6300, 0);
        drive.advance(600 * MILLI);
        drive.moveTo(14050, 8000, 15000, 15000);
        double slowest = drive.velocity();
        for (int i = 0; i < 800; i++) {
            drive.advance(MILLI);
            slowest = Math.min(slowest, drive.velocity());
        }
        assertEquals(8000, slowest, 1);
        drive.advance(2_000 * MILLI);
        assertEquals(14050, drive.position());
    }

    @ParameterizedTest
    @CsvSource({"100", "3000", "2600"})
    void aNewTargetBehindOrTooNearIsReachedFromTheOtherSide(double target) {
        Drive drive = captured(13950, 0);
        drive.advance(533_333_333);
        assertEquals(2233.33, drive.position(), 0.1);
        drive.moveTo(target, 8000, 15000, 15000);
        double farthest = 0;
        while (drive.moving()) {
            drive.advance(MILLI);
            farthest = Math.max(farthest, drive.position());
        }
        assertEquals(2233.33 + 8000.0 * 8000 / 30000, farthest, 1);
        assertEquals(target, drive.position());
    }

    @Test
    void aSlowerMoveSlowsDownFirst() {
        Drive drive = captured(13950, 0);
        drive.advance(533_333_333);
        drive.moveTo(14050, 1000, 15000, 15000);
        assertEquals((8000 - 1000) / 15000.0 + (14050 - 2233.333 - (64e6 - 1e6) / 30000 - 1e6 / 30000) / 1000
                + 1000 / 15000.0, drive.plannedSeconds(), 1e-3);
        drive.advance(470 * MILLI);
        assertEquals(1000, drive.velocity(), 1e-6);
    }

    @Test
    void whatRunsTheOtherWayBrakesAndTurns() {
        Drive drive = new Drive(0);
        drive.runAt(100, 50, 200);
        drive.advance(2_000 * MILLI);
        assertEquals(100, drive.position(), 1e-9);
        drive.runAt(-100, 50, 200);
        drive.advance(500 * MILLI);
        assertEquals(0, drive.velocity(), 1e-9);
        assertEquals(125, drive.position(), 1e-9);
        drive.advance(2_000 * MILLI);
        assertEquals(-100, drive.velocity(), 1e-9);
        drive.runAt(0, 50, 200);
        drive.advance(600 * MILLI);
        assertFalse(drive.moving());
        assertEquals(0, drive.velocity());
    }
}
