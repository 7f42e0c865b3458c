package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;

/** The faults that the rig has by name, and what each does to its mechanics. */
class RigModelFaultTest {
    private static final double BACKLASH = 8;

    private final WordPlayer player = WordPlayer.homed();

    private void fault(String name, double value) {
        player.rig.fault(name, value);
    }

    @ParameterizedTest
    @CsvSource({"1, 2", "2, 5"})
    void aJamIsNotOkAfterASecondAndTheBottleGoesWithTheFault(int lift, int step) {
        player.steps(1, step - 1);
        fault("jam at lift " + lift, 1);
        player.until(WordPlayer.STEPS[step - 1], "package" + lift);
        player.playFor(WordPlayer.STEPS[step - 1], 1_050).assertFault("jam: package sensor " + lift);
        assertTrue(player.rig.jammed());
        fault("jam at lift " + lift, 0);
        assertFalse(player.rig.jammed());
        player.acknowledge().home().assertWell().cycles(2).assertWell().assertAccounted();
        assertEquals(1, player.rig.counters().jams());
    }

    @Test
    void aJamThatEndsBeforeABottleCameNeverHappens() {
        fault("jam at lift 1", 1);
        player.steps(1, 1);
        fault("jam at lift 1", 0);
        player.cycles(1).assertWell();
        assertEquals(0, player.rig.counters().jams());
    }

    @Test
    void aLeakLetsTheBottleFall() {
        player.steps(1, 1).until(WordPlayer.STEPS[1], "package1");
        fault("leak at lift 1", 1);
        player.play(WordPlayer.STEPS[1], 1).assertFault("fell: SC1 let go");
        assertFalse(player.rig.vacuum(Lift.LA1));
        fault("leak at lift 1", 0);
        player.play(WordPlayer.STEPS[1], 1);
        assertTrue(player.rig.vacuum(Lift.LA1), "the control still commands it");
    }

    @Test
    void withBacklashALiftFollowsItsMotorByHalfOfItOnEitherSide() {
        fault("backlash of lift 2", BACKLASH);
        player.playFor(WordPlayer.LA2_UP, 1_000);
        assertEquals(Geometry.BIG, player.value("la2.position"), "the motor's own measure");
        assertEquals(Geometry.BIG - BACKLASH / 2, player.rig.position(Lift.LA2));
        // After the reversal the lift stays until the motor has gone the whole backlash.
        player.play(WordPlayer.LA2_DOWN, 50);
        assertTrue(player.value("la2.position") < Geometry.BIG);
        assertTrue(player.value("la2.position") > Geometry.BIG - BACKLASH, "it is in the play");
        assertEquals(Geometry.BIG - BACKLASH / 2, player.rig.position(Lift.LA2));
        player.playFor(WordPlayer.LA2_DOWN, 1_000);
        assertEquals(0, player.value("la2.position"));
        assertEquals(BACKLASH / 2, player.rig.position(Lift.LA2));
        assertFalse(player.on("la2.bottom"), "the switch sees the lift, not the motor");
        fault("backlash of lift 2", 0);
        player.play(0, 2).playFor(WordPlayer.LA2_UP, 1_000).play(0, 2).playFor(WordPlayer.LA2_DOWN, 1_000);
        assertTrue(player.on("la2.bottom"));
    }

    @Test
    void withBacklashABottleDoesNotReachItsSleeve() {
        fault("backlash of lift 1", BACKLASH);
        player.steps(1, 1).playFor(WordPlayer.STEPS[1], 1_000);
        player.play(WordPlayer.LA1_BIG_UP, 2).assertFault("fell: SC1 let go");
    }

    @Test
    void aWornDriveHasSoMuchLessOfItsSpeedAndAcceleration() {
        fault("wear of lift 2", 0.5);
        // s / v + v / a with 400 mm/s and 2000 mm/s2, both halved, and 180 mm: 1.1 s.
        player.playFor(WordPlayer.LA2_UP, 1_099);
        assertTrue(player.rig.position(Lift.LA2) < Geometry.BIG);
        player.playFor(WordPlayer.LA2_UP, 1);
        assertEquals(Geometry.BIG, player.rig.position(Lift.LA2), 1e-6);

        Rig worn = new Rig(0, 0, 0, 0);
        worn.fault("wear of index wheel 1", 0.5);
        WordPlayer wheel = new WordPlayer(worn, WordPlayer.MILLI).play(0, 1);
        // Likewise with 180 degrees per second, 600 per second squared, and 90 degrees: 1.3 s instead of 0.8 s.
        long longer = wheel.step(1) - WordPlayer.homed().step(1);
        assertEquals(500, longer / WordPlayer.MILLI, 1);
    }

    @Test
    void withoutBottlesAndWithoutTheLampNothingIsTreated() {
        fault("infeed empty", 1);
        player.playFor(WordPlayer.IM1_INDEX, 1_000).play(0, 1).playFor(WordPlayer.IM1_INDEX, 1_000);
        long fed = player.rig.counters().fed();
        player.play(0, 1).playFor(WordPlayer.IM1_INDEX, 1_000);
        assertEquals(fed, player.rig.counters().fed());

        WordPlayer dark = WordPlayer.homed();
        dark.rig.fault("lamp burnt out", 1);
        dark.cycles(3).assertWell();
        assertEquals(0, dark.rig.counters().treated());
        WordPlayer lit = WordPlayer.homed().cycles(3);
        assertTrue(lit.rig.counters().treated() > 0);
    }

    @Test
    void anUnknownNameIsAnsweredWithTheNearestOne() {
        IllegalArgumentException wrong = assertThrows(IllegalArgumentException.class, () -> fault("jam at lift", 1));
        assertEquals("the machine has no fault \"jam at lift\"; did you mean \"jam at lift 1\"?", wrong.getMessage());
        player.rig.modelFaults().forEach(known -> fault(known.name(), 0));
        player.cycles(1).assertWell();
    }
}
