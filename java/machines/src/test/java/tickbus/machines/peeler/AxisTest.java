package tickbus.machines.peeler;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.List;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import tickbus.simulator.ModelFault;

/** The reactions of an axis to commands. */
class AxisTest {
    private static final long TICK = 2_000_000L;

    private final AxisPlayer feeder = new AxisPlayer(new Axis(AxisName.LINEAR_FEEDER));
    private final AxisPlayer clamp = new AxisPlayer(new Axis(AxisName.TRANSFER_CLAMP_LEFT));
    private final AxisPlayer rotation = new AxisPlayer(new Axis(AxisName.SPINDLE_ROTATION));
    private final AxisPlayer roll = new AxisPlayer(new Axis(AxisName.TOP_ROLL));

    @Test
    void aPositionCommandEndsInPositionAfterTheTimeOfItsTrapezoid() {
        feeder.position(23, 400, 1500);
        assertFalse(feeder.axis().inPosition());
        long ticks = feeder.until(() -> feeder.axis().inPosition());
        double seconds = 400 / 1500.0 + (627 - 400 * 400 / 1500.0) / 400 + 400 / 1500.0;
        assertEquals(seconds, (ticks + 1) * TICK / 1e9, 0.004);
        assertEquals(23, feeder.axis().position());
        assertEquals(0, feeder.axis().velocity());
    }

    @ParameterizedTest
    @CsvSource({"6300, 1.32083", "13950, 2.27708", "1000, 0.51640"})
    void theCapturedCommandTakesItsTimeOnAnAxisInHundredths(double distance, double seconds) {
        feeder.position(650 - distance / 100, 80, 150);
        long ticks = feeder.until(() -> feeder.axis().inPosition());
        assertEquals(seconds, (ticks + 1) * TICK / 1e9, 0.004);
    }

    @Test
    void aWornAxisHasHalfItsSpeedAndAcceleration() {
        feeder.axis().wear(0.5);
        feeder.position(250, 400, 1500);
        long ticks = feeder.until(() -> feeder.axis().inPosition());
        // The deceleration is that of the command.
        double v = 200;
        double seconds = v / 750 + (400 - v * v / 1500 - v * v / 3000) / v + v / 1500;
        assertEquals(seconds, (ticks + 1) * TICK / 1e9, 0.004);
        assertEquals(250, feeder.axis().position());
    }

    @Test
    void aClampWithALeakIsSlowerAndPressesLess() {
        clamp.axis().leak(0.25);
        clamp.axis().meets(Block.HALF);
        clamp.set("Torque", 60);
        clamp.set("Tracking", 1);
        clamp.execute();
        clamp.ticks(20);
        assertEquals(-300, clamp.axis().velocity());
        clamp.until(() -> clamp.axis().velocity() == 0);
        assertEquals(45, clamp.axis().pressure());
        clamp.axis().leak(1);
        clamp.tick();
        assertFalse(clamp.axis().presses());
    }

    @Test
    void everyAxisHasItsFaultsByName() {
        Peeler peeler = new Peeler();
        peeler.fault("failure of step feeder", 1);
        peeler.step(TICK);
        int healthy = peeler.outputs().indexOf("step feeder.Healthy");
        assertEquals(0, peeler.output(healthy));
        peeler.fault("failure of step feeder", 0);
        assertEquals(1, peeler.output(healthy));
        List<String> names = peeler.modelFaults().stream().map(ModelFault::name).toList();
        assertTrue(names.containsAll(List.of("leak of transfer clamp left", "wear of transfer arm",
                "failure of spindle rotation")), names::toString);
        names.forEach(name -> peeler.fault(name, 0));
    }

    @Test
    void aNewCommandClearsInPositionEvenWhereTheAxisStandsAlready() {
        feeder.position(600, 400, 1500);
        feeder.until(() -> feeder.axis().inPosition());
        feeder.release();
        assertTrue(feeder.axis().inPosition());
        feeder.position(600, 400, 1500);
        assertFalse(feeder.axis().inPosition());
        feeder.tick();
        assertTrue(feeder.axis().inPosition());
    }

    @Test
    void whileExecuteStaysOnOtherValuesAreNoCommand() {
        feeder.position(600, 400, 1500);
        feeder.set("TargetPosition", 100);
        feeder.ticks(1000);
        assertEquals(600, feeder.axis().position());
        assertEquals(1, feeder.axis().commands());
        feeder.position(100, 400, 1500);
        assertEquals(2, feeder.axis().commands());
        feeder.ticks(2000);
        assertEquals(100, feeder.axis().position());
    }

    @Test
    void withoutEnableNothingMovesAndTheCommandIsForgotten() {
        feeder.set("Enable", 0);
        feeder.position(100, 400, 1500);
        feeder.set("Enable", 1);
        feeder.ticks(100);
        assertEquals(650, feeder.axis().position());
        assertEquals(AxisError.NOT_ENABLED.ordinal(), feeder.axis().error());
        feeder.position(100, 400, 1500);
        assertEquals(0, feeder.axis().error());
        feeder.ticks(200);
        feeder.set("Enable", 0);
        feeder.tick();
        double place = feeder.axis().position();
        assertTrue(place < 600 && place > 100);
        feeder.set("Enable", 1);
        feeder.ticks(500);
        assertEquals(place, feeder.axis().position());
        assertFalse(feeder.axis().inPosition());
    }

    @Test
    void aFailedAxisIsNotHealthyAndStandsStill() {
        feeder.position(100, 400, 1500);
        feeder.ticks(100);
        feeder.axis().fail(true);
        feeder.tick();
        double place = feeder.axis().position();
        feeder.ticks(100);
        assertEquals(place, feeder.axis().position());
        assertFalse(feeder.axis().healthy());
        assertEquals(4, feeder.axis().error());
        assertEquals(0, feeder.axis().status() & 1);
    }

    @Test
    void aTargetBeyondAnEndLeadsToTheEndAndIsTold() {
        feeder.position(-50, 400, 1500);
        feeder.until(() -> feeder.axis().inPosition());
        assertEquals(0, feeder.axis().position());
        assertEquals(1, feeder.axis().error());
        assertTrue((feeder.axis().status() & 1 << AxisStatus.LOW_END.ordinal()) != 0);
        feeder.position(10, 400, 1500);
        assertEquals(0, feeder.axis().error());
    }

    @ParameterizedTest
    @CsvSource({"0, 1500, 1500, 2", "400, -1, 1500, 2", "400, 1500, NaN, 2"})
    void aCommandThatCannotMoveIsRefused(double speed, double acceleration, double deceleration, int error) {
        feeder.set("Speed", speed);
        feeder.set("Acceleration", acceleration);
        feeder.set("Deceleration", deceleration);
        feeder.set("TargetPosition", 100);
        feeder.execute();
        feeder.ticks(100);
        assertEquals(650, feeder.axis().position());
        assertEquals(error, feeder.axis().error());
        assertFalse(feeder.axis().inPosition());
    }

    @Test
    void anAxisThatCannotTrackRefusesTo() {
        feeder.set("Tracking", 1);
        feeder.position(100, 400, 1500);
        feeder.ticks(10);
        assertEquals(3, feeder.axis().error());
        assertEquals(650, feeder.axis().position());
    }

    @Test
    void aJoystickMovesTheAxisUntilItIsLetGo() {
        feeder.set("SpeedControl", 1);
        feeder.position(-10_000, 100, 500);
        feeder.ticks(500);
        assertEquals(-100, feeder.axis().velocity());
        assertFalse(feeder.axis().inPosition());
        double place = feeder.axis().position();
        feeder.set("SpeedControl", 0);
        feeder.until(() -> feeder.axis().velocity() == 0);
        assertEquals(place - 100 * 100 / 1000.0, feeder.axis().position(), 0.2);
        assertTrue(feeder.axis().inPosition());
    }

    @Test
    void aJoystickStopsAtTheEndPosition() {
        feeder.set("SpeedControl", 1);
        feeder.position(10_000, 100, 500);
        feeder.ticks(50);
        assertEquals(650, feeder.axis().position());
        feeder.position(-10_000, 400, 500);
        feeder.ticks(2000);
        assertEquals(0, feeder.axis().position());
        assertEquals(0, feeder.axis().velocity());
    }

    @Test
    void aNewSpeedIsReachedWithoutAStop() {
        rotation.set("SpeedControl", 1);
        rotation.position(1e6, 2, 4);
        rotation.ticks(500);
        assertEquals(2, rotation.axis().velocity());
        rotation.release();
        rotation.position(1e6, 5, 4);
        double slowest = 5;
        for (int i = 0; i < 500; i++) {
            rotation.tick();
            slowest = Math.min(slowest, rotation.axis().velocity());
        }
        assertTrue(slowest >= 2);
        assertEquals(5, rotation.axis().velocity());
    }

    @Test
    void aClampClosesUntilItMeetsTheBlockAndOpensToItsEnd() {
        clamp.axis().meets(Block.HALF);
        clamp.set("Torque", 60);
        clamp.set("Tracking", 1);
        clamp.execute();
        clamp.ticks(20);
        assertEquals(-400, clamp.axis().velocity());
        clamp.until(() -> clamp.axis().velocity() == 0);
        assertEquals(650, clamp.axis().position());
        assertTrue(clamp.axis().presses());
        assertEquals(60, clamp.axis().pressure());
        clamp.release();
        clamp.set("Torque", 40);
        assertEquals(60, clamp.axis().pressure(), "pressure changes with the next command");
        clamp.execute();
        assertEquals(40, clamp.axis().pressure());
        assertEquals(650, clamp.axis().position());
        clamp.release();
        clamp.set("Tracking", 0);
        clamp.set("TorqueControl", 1);
        clamp.execute();
        clamp.ticks(500);
        assertEquals(800, clamp.axis().position());
        assertFalse(clamp.axis().presses());
    }

    @Test
    void withBothBitsOffAClampStandsAndPressesNot() {
        clamp.axis().meets(Block.HALF);
        clamp.set("Torque", 60);
        clamp.set("Tracking", 1);
        clamp.execute();
        clamp.ticks(20);
        clamp.set("Tracking", 0);
        clamp.tick();
        double place = clamp.axis().position();
        clamp.ticks(100);
        assertEquals(place, clamp.axis().position());
        clamp.set("Tracking", 1);
        clamp.ticks(100);
        assertEquals(place, clamp.axis().position(), "it takes a command to begin again");
        clamp.release();
        clamp.execute();
        clamp.ticks(500);
        assertTrue(clamp.axis().presses());
        clamp.set("Tracking", 0);
        clamp.tick();
        assertFalse(clamp.axis().presses());
    }

    @Test
    void aTrackingAxisFollowsNoFasterThanItsSpeedAndStopsWhenTheBitFalls() {
        roll.set("Tracking", 1);
        roll.set("Speed", 100);
        roll.set("TargetPosition", 5);
        roll.execute();
        assertTrue(roll.axis().tracks());
        assertEquals(5, roll.axis().offset());
        roll.axis().trackTo(200, 1_000_000_000L);
        assertEquals(200, roll.axis().position());
        roll.axis().trackTo(50, 1_000_000_000L);
        assertEquals(100, roll.axis().position());
        assertEquals(-100, roll.axis().velocity());
        assertFalse(roll.axis().inPosition());
        roll.set("Tracking", 0);
        roll.tick();
        assertFalse(roll.axis().tracks());
        assertEquals(0, roll.axis().velocity());
    }
}
