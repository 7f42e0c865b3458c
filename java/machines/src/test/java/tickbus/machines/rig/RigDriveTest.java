package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import org.junit.jupiter.params.provider.ValueSource;

/** Everything that starts, changes and ends a motion: lifts, reference runs, index commands, jogging and homing. */
class RigDriveTest {
    @ParameterizedTest
    @ValueSource(longs = {100_000, 1_000_000, 50_000_000})
    void powerUpIsHomedByAReferenceRunAndAJog(long tick) {
        WordPlayer player = new WordPlayer(new Rig(), tick).play(0, 3);
        assertFalse(player.on("la1.bottom"));
        assertTrue(player.on("la2.bottom"));
        assertTrue(player.on("home1"));
        assertFalse(player.on("home2"));
        assertFalse(player.rig.referenced(Lift.LA1));
        assertTrue(player.rig.referenced(Lift.LA2), "at the bottom a lift needs no reference run");
        player.home().assertWell();
        assertTrue(player.rig.referenced(Lift.LA1));
        assertEquals(0, player.value("la1.position"));
        assertEquals(0, player.rig.wheel2Angle());
        player.cycles(2).assertWell();
    }

    @ParameterizedTest
    @CsvSource({"190, 190", "100, 3.5", "0.6, 55"})
    void aReferenceRunGoesDownHoweverFarAndIsSlow(double lift1, double lift2) {
        WordPlayer player = new WordPlayer(new Rig(0, 0, lift1, lift2), WordPlayer.MILLI);
        int down = WordPlayer.LA1_BIG_DOWN | WordPlayer.LA2_DOWN;
        player.play(down, 1);
        double before = player.value("la1.position");
        while (player.rig.moving()) {
            player.rig.step(player.tick);
            double now = player.value("la1.position");
            assertTrue(before - now <= 0.1001, "faster than 100 mm/s");
            before = now;
        }
        player.assertWell();
        assertEquals(0, player.value("la1.position"));
        assertEquals(0, player.value("la2.position"));
        assertTrue(player.rig.referenced(Lift.LA1) && player.rig.referenced(Lift.LA2));
    }

    @Test
    void aReferenceRunCutShortGivesNoReference() {
        WordPlayer player = new WordPlayer(new Rig(0, 0, 150, 0), WordPlayer.MILLI);
        player.playFor(WordPlayer.LA1_BIG_DOWN, 300).playFor(0, 200);
        assertFalse(player.rig.referenced(Lift.LA1));
        assertEquals(122, player.value("la1.position"), 3);
        player.until(WordPlayer.LA1_BIG_DOWN, "la1.bottom").playFor(0, 50);
        assertTrue(player.rig.referenced(Lift.LA1));
        assertEquals(0, player.value("la1.position"), "the last half millimetre, too");
    }

    @Test
    void aRunThatFallsStopsTheLiftWhereItIs() {
        WordPlayer player = WordPlayer.homed().steps(1, 1).playFor(WordPlayer.STEPS[1], 300);
        double atDrop = player.value("la1.position");
        player.playFor(WordPlayer.SC1, 250);
        double stopped = player.value("la1.position");
        assertEquals(atDrop + 40, stopped, 1, "400 mm/s end within 40 mm at 2 m/s2");
        assertFalse(player.rig.moving());
        player.playFor(WordPlayer.SC1, 1_000);
        assertEquals(stopped, player.value("la1.position"));
        assertFalse(player.on("step2.complete"));
        // A big downward move goes to the bottom from any position.
        player.playFor(WordPlayer.LA1_BIG_DOWN | WordPlayer.SC1, 700).play(0, 1).assertWell();
        assertEquals(0, player.value("la1.position"));
        player.steps(1, 6).assertWell();
    }

    @Test
    void aNewCodeWhileRunStaysHighStartsTheNextMove() {
        WordPlayer player = WordPlayer.homed().cycles(1).steps(1, 2);
        assertEquals(180, player.value("la1.position"));
        player.step(3);
        assertEquals(160, player.value("la1.position"));
        player.steps(4, 5).step(6);
        assertEquals(0, player.value("la1.position"));
        assertEquals(0, player.value("la2.position"));
        player.assertWell();
    }

    @Test
    void aCodeThatChangesInMidMoveBrakesAndGoesTheNewWay() {
        WordPlayer player = WordPlayer.homed().steps(1, 1).playFor(WordPlayer.STEPS[1], 250);
        double highest = 0;
        player.play(WordPlayer.LA1_BIG_DOWN | WordPlayer.SC1, 1);
        double before = player.value("la1.position");
        double fastest = 0;
        while (player.rig.moving()) {
            player.rig.step(player.tick);
            double now = player.value("la1.position");
            highest = Math.max(highest, now);
            fastest = Math.max(fastest, Math.abs(now - before));
            before = now;
        }
        assertTrue(highest > 60 && highest < 110, "turned round at " + highest);
        assertTrue(fastest <= 0.4001, "never faster than 400 mm/s");
        assertEquals(0, player.value("la1.position"));
        player.play(0, 1).assertWell();
    }

    @Test
    void aCodeThatChangesWhileRunIsLowMovesNothing() {
        WordPlayer player = WordPlayer.homed().steps(1, 3);
        for (int code : new int[] {0, 8, 16, 24}) {
            player.playFor(code, 100);
            assertEquals(160, player.value("la1.position"));
        }
        player.playFor(1 << 11, 100);
        assertEquals(0, player.value("la2.position"));
        player.assertWell();
    }

    @ParameterizedTest
    @CsvSource({"45, 90", "0, 90", "255, 270", "300, 0", "265, 0", "272, 0"})
    void anIndexGoesToTheNextPositionAndCountsTheWindowAsThePosition(double from, double to) {
        WordPlayer player = new WordPlayer(new Rig(from, 0, 0, 0), WordPlayer.MILLI);
        player.play(WordPlayer.IM1_INDEX, 1).playFor(0, 2_000).assertWell();
        assertEquals(to, player.rig.wheel1Angle(), "a falling index bit does not stop the wheel");
    }

    @Test
    void anIndexWhileTheWheelTurnsIsIgnoredAndCounted() {
        WordPlayer player = WordPlayer.homed().playFor(WordPlayer.IM1_INDEX, 200).playFor(0, 100);
        player.playFor(WordPlayer.IM1_INDEX, 100).playFor(0, 1_000).assertWell();
        assertEquals(90, player.rig.wheel1Angle());
        assertEquals(1, player.rig.counters().retriggers());
        player.playFor(WordPlayer.IM2_JOG, 200).playFor(WordPlayer.IM2_JOG | WordPlayer.IM2_INDEX, 50);
        assertEquals(2, player.rig.counters().retriggers());
    }

    @Test
    void joggingIsSlowAndEndsWithItsRamp() {
        WordPlayer player = WordPlayer.homed().playFor(WordPlayer.IM1_JOG, 1_000);
        double atDrop = player.rig.wheel1Angle();
        assertEquals(45 - 45 * 45 / 240.0 / 2, atDrop, 1e-6);
        player.playFor(0, 1_000).assertWell();
        assertEquals(atDrop + 45 * 45 / 240.0 / 2, player.rig.wheel1Angle(), 1e-6, "it stays outside the window");
        assertFalse(player.on("home1"));
        assertFalse(player.rig.moving());
    }

    @ParameterizedTest
    @CsvSource({"0", "10", "50", "150", "250", "300"})
    void aJogDroppedInTheWindowEndsOnTheIndexPulse(long reaction) {
        WordPlayer player = new WordPlayer(new Rig(20, 200, 0, 0), WordPlayer.MILLI);
        player.until(WordPlayer.IM1_JOG, "home1").playFor(WordPlayer.IM1_JOG, reaction).playFor(0, 3_000);
        assertEquals(90, player.rig.wheel1Angle());
        player.until(WordPlayer.IM2_JOG, "home2").playFor(WordPlayer.IM2_JOG, reaction).playFor(0, 3_000);
        assertEquals(0, player.rig.wheel2Angle());
        player.assertWell();
    }

    @Test
    void anIndexThatComesWhileHomingEndsIsNotLost() {
        WordPlayer player = new WordPlayer(new Rig(20, 0, 0, 0), WordPlayer.MILLI);
        player.until(WordPlayer.IM1_JOG, "home1").play(0, 1);
        assertTrue(player.rig.moving());
        player.step(1);
        assertEquals(180, player.rig.wheel1Angle(), "first to 90, then one on");
        assertEquals(0, player.rig.counters().retriggers());
        player.steps(2, 6).assertWell();
    }

    @Test
    void joggingForManyTurnsStaysWithinOneTurn() {
        WordPlayer player = WordPlayer.homed(10 * WordPlayer.MILLI).playFor(WordPlayer.IM2_JOG, 3_600_000);
        assertTrue(player.rig.wheel2Angle() >= 0 && player.rig.wheel2Angle() < 360);
        player.home().playFor(WordPlayer.IM2_JOG, 100).play(0, 1).until(WordPlayer.IM2_JOG, "home2").playFor(0, 3_000);
        assertEquals(0, player.rig.wheel2Angle() % 180);
        player.assertWell();
    }

    @Test
    void theInfeedFillsOnlyAnEmptyPocketAtRest() {
        Rig rig = new Rig(30, 0, 0, 0);
        WordPlayer player = new WordPlayer(rig, WordPlayer.MILLI).playFor(0, 100);
        assertEquals(0, rig.counters().fed());
        player.playFor(WordPlayer.IM1_INDEX, 900).playFor(0, 100);
        assertEquals(1, rig.counters().fed());
        player.playFor(WordPlayer.IM1_JOG, 20_000);
        assertEquals(1, rig.counters().fed(), "a turning wheel is not filled");
        player.assertWell();
    }

    @Test
    void aFinalisedRigStartsAgainWithItsBottles() {
        for (int cycles = 1; cycles <= 4; cycles++) {
            WordPlayer player = WordPlayer.homed().cycles(cycles).home().playFor(0, 3_000);
            player.home().cycles(cycles).assertWell();
            assertEquals(2L * cycles, player.rig.counters().cycles());
        }
    }
}
