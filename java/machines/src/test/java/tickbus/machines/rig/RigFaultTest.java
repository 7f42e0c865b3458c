package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.List;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import org.junit.jupiter.params.provider.EnumSource;
import org.junit.jupiter.params.provider.ValueSource;

/** Everything that raises Not OK, and how to recover. */
class RigFaultTest {
    private static final int UP_WITH_BOTTLE = WordPlayer.LA1_BIG_UP | WordPlayer.SC1;

    @ParameterizedTest
    @CsvSource({
        // lift, step in which a bottle is carried through its beam, steps before it, whether in the second cycle
        "LA1, 2, 0",
        "LA1, 6, 1",
        "LA2, 5, 0",
        "LA2, 6, 0",
    })
    void aJamStopsTheRigUntilItIsClearedAndAcknowledged(Lift lift, int step, int cyclesBefore) {
        WordPlayer player = WordPlayer.homed().cycles(cyclesBefore).steps(1, step - 1);
        player.rig.jamNext(lift);
        String beam = "package" + (lift.ordinal() + 1);
        player.until(WordPlayer.STEPS[step - 1], beam);
        assertFalse(player.on("not.ok"));
        player.playFor(WordPlayer.STEPS[step - 1], 950);
        assertFalse(player.on("not.ok"), "a beam may be dark for a second");
        assertTrue(player.rig.jammed());
        assertTrue(player.rig.moving(), "the drive still pulls");
        player.playFor(WordPlayer.STEPS[step - 1], 100).assertFault("jam: package sensor " + (lift.ordinal() + 1));
        assertFalse(player.on("step" + step + ".complete"));

        // The control drops everything except the suction. Acknowledging has no effect while the bottle is stuck.
        int suction = WordPlayer.STEPS[step - 1] & (WordPlayer.SC1 | WordPlayer.SC2);
        player.play(suction, 10).play(suction | WordPlayer.ACKNOWLEDGE, 2).play(suction, 2);
        player.assertFault("jam");
        assertTrue(player.on(beam));

        int before = player.rig.bottles().size();
        player.rig.clearJam();
        assertFalse(player.rig.jammed());
        assertTrue(player.on("not.ok"), "clearing is not acknowledging");
        long pockets = player.rig.bottles().stream().filter(b -> b.place() == Bottle.Place.POCKET).count();
        assertEquals(pockets, player.rig.bottles().size(), "bottles in pockets stay, all others go");
        assertEquals(before - pockets, player.rig.counters().removed());
        player.play(suction | WordPlayer.ACKNOWLEDGE, 1);
        assertFalse(player.on("not.ok"));
        assertFalse(player.on(beam));
        assertFalse(player.rig.referenced(lift), "after a fault a raised lift does not trust its position");

        player.home().assertWell();
        assertTrue(player.rig.referenced(lift));
        assertEquals(0, player.rig.position(lift));
        player.cycles(3).assertWell();
        assertEquals(1, player.rig.counters().jams());
        assertEquals(1, player.rig.counters().faults());
        assertEquals(0, player.rig.counters().collisions());
    }

    @Test
    void aJamIsOnlyTimedWhileTheLiftIsCommandedToRun() {
        WordPlayer player = WordPlayer.homed().steps(1, 1);
        player.rig.jamNext(Lift.LA1);
        player.until(WordPlayer.STEPS[1], "package1").playFor(WordPlayer.SC1, 5_000).assertWell();
        assertTrue(player.on("package1"));
        player.playFor(WordPlayer.LA1_BIG_DOWN | WordPlayer.SC1, 1_100).assertFault("jam: package sensor 1");
    }

    @Test
    void aJamClearedBeforeNotOkLetsTheLiftGoOn() {
        WordPlayer player = WordPlayer.homed().steps(1, 1);
        player.rig.jamNext(Lift.LA1);
        player.until(WordPlayer.STEPS[1], "package1").playFor(WordPlayer.STEPS[1], 300);
        player.rig.clearJam();
        player.playFor(WordPlayer.STEPS[1], 700).assertWell();
        assertTrue(player.on("step2.complete"));
        assertEquals(180, player.value("la1.position"));
    }

    @Test
    void aBottleLetGoInMidAirFalls() {
        WordPlayer player = WordPlayer.homed().steps(1, 1).playFor(UP_WITH_BOTTLE, 300).play(0, 1);
        player.assertFault("bottle 1 fell: SC1 let go");
        assertEquals(1, player.rig.counters().fallen());
        double where = player.value("la1.position");
        player.playFor(0, 100);
        assertEquals(where, player.value("la1.position"), "a fault stops a lift at once");
        player.acknowledge().home().cycles(2).assertWell();
    }

    @ParameterizedTest
    @ValueSource(ints = {WordPlayer.IM1_INDEX, WordPlayer.IM1_JOG})
    void wheel1TurningThroughLift1IsACollision(int turn) {
        WordPlayer player = WordPlayer.homed().steps(1, 3).play(0, 5).play(turn, 1);
        player.assertFault("collision: index wheel 1 turned while lift 1 stood 160.0 mm up");
        assertEquals(90, player.rig.wheel1Angle(), "it is stopped before it moves");
        assertEquals(1, player.rig.counters().collisions());
        player.acknowledge().home().assertWell();
    }

    @ParameterizedTest
    @ValueSource(ints = {WordPlayer.IM2_INDEX, WordPlayer.IM2_JOG})
    void theChamberWheelTurningThroughLift1IsACollision(int turn) {
        WordPlayer.homed().steps(1, 2).play(0, 5).play(turn, 1)
                .assertFault("collision: the chamber wheel turned while lift 1 stood 180.0 mm up");
    }

    @Test
    void theChamberWheelTurningThroughLift2IsACollision() {
        WordPlayer.homed().steps(1, 5).playFor(WordPlayer.LA1_BIG_DOWN | WordPlayer.SC1 | WordPlayer.SC2, 800)
                .play(WordPlayer.IM2_INDEX | WordPlayer.SC2, 1)
                .assertFault("collision: the chamber wheel turned while lift 2 stood 180.0 mm up");
    }

    @Test
    void aLiftThatRisesUnderATurningWheelIsACollision() {
        WordPlayer.homed().playFor(WordPlayer.IM1_INDEX, 300).playFor(WordPlayer.LA1_BIG_UP, 50)
                .assertFault("collision: lift 1 ran into index wheel 1");
        WordPlayer.homed().playFor(WordPlayer.IM2_INDEX, 300).playFor(WordPlayer.LA2_UP, 50)
                .assertFault("collision: lift 2 ran into the chamber wheel");
    }

    @Test
    void aLiftUnderAWheelBetweenTwoPositionsIsACollision() {
        new WordPlayer(new Rig(45, 0, 0, 0), WordPlayer.MILLI).playFor(WordPlayer.LA1_BIG_UP, 300)
                .assertFault("lift 1 ran into index wheel 1, which stood between two index positions");
        new WordPlayer(new Rig(0, 90, 0, 0), WordPlayer.MILLI).playFor(WordPlayer.LA1_BIG_UP, 700)
                .assertFault("lift 1 ran into the chamber wheel, which stood between two index positions");
        new WordPlayer(new Rig(0, 90, 0, 0), WordPlayer.MILLI).playFor(WordPlayer.LA2_UP, 300)
                .assertFault("lift 2 ran into the chamber wheel, which stood between two index positions");
    }

    @Test
    void aBottleHeldByACupAndTurnedByAWheelIsADoubleGrip() {
        WordPlayer.homed().steps(1, 1).play(WordPlayer.SC1, 5).play(WordPlayer.SC1 | WordPlayer.IM1_INDEX, 1)
                .assertFault("double grip: bottle 1 was held by SC1 and turned by index wheel 1");
        WordPlayer.homed().steps(1, 4).play(WordPlayer.SC2, 5).play(WordPlayer.SC2 | WordPlayer.IM2_INDEX, 1)
                .assertFault("double grip: bottle 1 was held by SC2 and turned by the chamber wheel");
    }

    @Test
    void aSecondBottleDoesNotFitIntoASleeve() {
        // Down again, but the chamber wheel has not turned: its sleeve still holds the first bottle.
        WordPlayer player = WordPlayer.homed().steps(1, 3);
        player.playFor(WordPlayer.LA1_BIG_DOWN, 700).steps(1, 1).playFor(UP_WITH_BOTTLE, 700);
        player.assertFault("lift 1 brought bottle 2 to the chamber wheel, where bottle 1 already was");
        assertEquals(120, player.value("la1.position"), 5, "bottle meets bottle");
        player.play(WordPlayer.SC1, 2);
        player.rig.clearJam();
        player.acknowledge().home().cycles(2).assertWell();
    }

    @Test
    void aCupWithoutVacuumPushesTheBottleThatItComesTo() {
        WordPlayer.homed().steps(1, 1).playFor(WordPlayer.LA1_BIG_UP, 50)
                .assertFault("lift 1 pushed bottle 1 up without vacuum on SC1");
        WordPlayer.homed().steps(1, 4).playFor(WordPlayer.LA2_UP, 50)
                .assertFault("lift 2 pushed bottle 1 up without vacuum on SC2");
        assertEquals(1, WordPlayer.homed().steps(1, 1).playFor(WordPlayer.LA1_BIG_UP, 50).rig.counters().collisions());
    }

    @Test
    void codesReadLeastSignificantDigitFirstEndAtTheEndStop() {
        // A control that swaps the digits of the code commands + small where the rig expects - small.
        WordPlayer.homed().steps(1, 2).play(WordPlayer.LA1_SMALL_UP, 1)
                .assertFault("lift 1 was told to move +20 mm from 180.0 mm, past its end stop at 190 mm");
    }

    @Test
    void aReferencedLiftRefusesToPassAnEndStop() {
        WordPlayer.homed().play(WordPlayer.LA1_SMALL_DOWN, 1)
                .assertFault("lift 1 was told to move -20 mm from 0.0 mm, past its end stop at 0 mm");
        WordPlayer.homed().playFor(WordPlayer.LA2_UP, 700).play(0, 1).play(WordPlayer.LA2_UP, 1)
                .assertFault("lift 2 was told to move +180 mm from 180.0 mm, past its end stop at 190 mm");
    }

    @ParameterizedTest
    @ValueSource(ints = {WordPlayer.LA1_BIG_UP, WordPlayer.LA1_SMALL_UP, WordPlayer.LA1_SMALL_DOWN, WordPlayer.LA2_UP})
    void anUnreferencedLiftOnlyMovesDown(int word) {
        WordPlayer player = new WordPlayer(new Rig(0, 0, 100, 100), WordPlayer.MILLI).play(word, 1);
        player.assertFault("without a reference: move it down to its stop first");
        assertEquals(100, player.value("la1.position"));
        player.acknowledge().home().cycles(1).assertWell();
    }

    @Test
    void aFaultStopsEveryDriveAndVoidsTheStep() {
        WordPlayer player = WordPlayer.homed().cycles(1).steps(1, 4).playFor(WordPlayer.STEPS[4], 200);
        double lift1 = player.value("la1.position");
        // SC2 releases in mid-air: lift 1 must stop as well.
        player.play(WordPlayer.STEPS[4] & ~WordPlayer.SC2, 1).assertFault("SC2 let go");
        player.playFor(WordPlayer.STEPS[4] & ~WordPlayer.SC2, 1_000);
        assertEquals(lift1, player.value("la1.position"), 0.1);
        player.playFor(WordPlayer.STEPS[4] | WordPlayer.ACKNOWLEDGE, 1_000);
        assertFalse(player.on("not.ok"));
        assertEquals(lift1, player.value("la1.position"), 0.1, "a run bit that stayed high starts nothing");
        assertFalse(player.on("step5.complete"));
    }

    @Test
    void everyCauseIsListedAndAcknowledgeNeedsARisingEdge() {
        WordPlayer player = WordPlayer.homed().steps(1, 1).play(WordPlayer.ACKNOWLEDGE, 1);
        player.playFor(UP_WITH_BOTTLE | WordPlayer.ACKNOWLEDGE, 300).play(WordPlayer.ACKNOWLEDGE, 20);
        player.assertFault("fell");
        assertEquals(1, player.rig.faults().size());
        player.play(0, 1).play(WordPlayer.ACKNOWLEDGE, 1);
        assertEquals(List.of(), player.rig.faults());
        assertFalse(player.on("not.ok"));
    }

    @ParameterizedTest
    @EnumSource(Lift.class)
    void aJamThatMeetsNoBottleWaitsForOne(Lift lift) {
        WordPlayer player = WordPlayer.homed();
        player.rig.jamNext(lift);
        int up = lift == Lift.LA1 ? WordPlayer.LA1_BIG_UP : WordPlayer.LA2_UP;
        int down = lift == Lift.LA1 ? WordPlayer.LA1_BIG_DOWN : WordPlayer.LA2_DOWN;
        player.playFor(up, 700).playFor(down, 700).assertWell();
        assertFalse(player.rig.jammed());
        assertEquals(0, player.rig.counters().jams());
    }

    @Test
    void impossibleArgumentsAreRefused() {
        assertThrows(IllegalArgumentException.class, () -> new Rig(361, 0, 0, 0));
        assertThrows(IllegalArgumentException.class, () -> new Rig(0, -1, 0, 0));
        assertThrows(IllegalArgumentException.class, () -> new Rig(0, 0, 191, 0));
        assertThrows(IllegalArgumentException.class, () -> new Rig(0, 0, 0, Double.NaN));
        Rig rig = new Rig();
        assertThrows(IllegalArgumentException.class, () -> rig.step(-1));
        assertThrows(IndexOutOfBoundsException.class, () -> rig.input(rig.inputs().size(), 1));
        assertThrows(IndexOutOfBoundsException.class, () -> rig.output(-1));
    }
}
