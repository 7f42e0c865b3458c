package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.lang.management.ManagementFactory;
import java.util.ArrayList;
import java.util.List;
import java.util.stream.IntStream;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import org.junit.jupiter.params.provider.ValueSource;

/** Production: the six steps, many cycles, and the same motion every time. */
class RigCycleTest {
    @ParameterizedTest
    @CsvSource({
        // step, ms at least, ms at most, wheel 1, wheel 2, lift 1, lift 2 at its end
        "1, 790, 815,  90,   0,   0,   0",
        "2, 640, 665,  90,   0, 180,   0",
        "3, 490, 515,  90,   0, 160,   0",
        "4, 890, 915,  90, 180, 160,   0",
        "5, 640, 665,  90, 180, 180, 180",
        "6, 640, 665,  90, 180,   0,   0",
    })
    void everyStepEndsExactlyWhereItsWordSays(
            int step, long atLeast, long atMost, double wheel1, double wheel2, double lift1, double lift2) {
        WordPlayer player = WordPlayer.homed().steps(1, step - 1);
        long took = player.step(step) / WordPlayer.MILLI;
        assertTrue(took >= atLeast && took <= atMost, "step " + step + " took " + took + " ms");
        assertEquals(wheel1, player.rig.wheel1Angle());
        assertEquals(wheel2, player.rig.wheel2Angle());
        assertEquals(lift1, player.value("la1.position"));
        assertEquals(lift2, player.value("la2.position"));
        player.assertWell();
        for (int n = 1; n <= 6; n++) {
            assertEquals(n == step, player.on("step" + n + ".complete"), "step" + n + ".complete");
        }
    }

    @Test
    void aBottleIsTreatedInTwoCyclesAndLeavesInTheThird() {
        WordPlayer player = WordPlayer.homed();
        assertEquals(Bottle.Place.POCKET, place(player, 1));
        player.steps(1, 1);
        assertEquals(Bottle.Place.POCKET, place(player, 1));
        player.steps(2, 2);
        assertEquals(Bottle.Place.CUP1, place(player, 1));
        assertEquals(Geometry.SLEEVE_FLOOR, bottle(player, 1).height());
        player.steps(3, 4);
        assertEquals(Bottle.Place.SLEEVE, place(player, 1));
        player.steps(5, 5);
        assertEquals(Bottle.Place.CUP2, place(player, 1));
        assertEquals(Geometry.LAMP_FLOOR, bottle(player, 1).height());
        assertTrue(bottle(player, 1).treated());
        player.steps(6, 6).steps(1, 4);
        assertEquals(Bottle.Place.SLEEVE, place(player, 1));
        player.steps(5, 6);
        assertEquals(Bottle.Place.CUP1, place(player, 1));
        assertEquals(0, player.rig.counters().treated());
        player.play(WordPlayer.STEPS[0], 1);
        assertEquals(1, player.rig.counters().treated());
        assertEquals(0, player.rig.counters().delivered());
        player.steps(1, 1);
        assertEquals(1, player.rig.counters().delivered());
        assertTrue(player.rig.bottles().stream().noneMatch(b -> b.id() == 1));
        player.assertWell();
    }

    @ParameterizedTest
    @ValueSource(longs = {100_000, 1_000_000, 7_300_000, 20_000_000, 50_000_000})
    void fiftyCyclesKeepTwoBottlesInMotionWithoutAFault(long tick) {
        WordPlayer player = WordPlayer.homed(tick);
        for (int cycle = 1; cycle <= 50; cycle++) {
            player.cycles(1);
            long inMotion = player.rig.bottles().stream().filter(b -> b.place() != Bottle.Place.POCKET).count();
            assertEquals(Math.min(cycle, 2), inMotion, "bottles on cups and in sleeves after cycle " + cycle);
        }
        Counters counters = player.assertWell().rig.counters();
        assertEquals(50, counters.cycles());
        assertEquals(51, counters.fed());
        assertEquals(48, counters.treated(), "the 49th still hangs on SC1");
        assertEquals(48, counters.delivered());
        assertEquals(0, counters.lampErrors() + counters.retriggers() + counters.faults() + counters.removed());
        player.play(WordPlayer.STEPS[0], 1);
        assertEquals(49, player.rig.counters().treated());
    }

    @Test
    void aNormalPassBlocksABeamForAFractionOfASecond() {
        WordPlayer player = WordPlayer.homed().cycles(2);
        for (int n = 1; n <= 6; n++) {
            int[] dark = new int[2];
            player.play(WordPlayer.STEPS[n - 1], 1);
            while (!player.on("step" + n + ".complete")) {
                player.rig.step(player.tick);
                dark[0] += player.on("package1") ? 1 : 0;
                dark[1] += player.on("package2") ? 1 : 0;
            }
            int passes1 = n == 2 || n == 6 ? 1 : 0;
            int passes2 = n == 5 || n == 6 ? 1 : 0;
            assertEquals(passes1 * 150, dark[0], 15, "package sensor 1 in step " + n);
            assertEquals(passes2 * 150, dark[1], 15, "package sensor 2 in step " + n);
        }
    }

    @Test
    void completeNeverComesInTheTickInWhichTheWordChanged() {
        WordPlayer player = WordPlayer.homed(50 * WordPlayer.MILLI);
        // Lift 2 is at its bottom and the cup is empty: this word only moves lift 1.
        player.cycles(1).steps(1, 4);
        for (int n = 1; n <= 6; n++) {
            player.play(WordPlayer.STEPS[n - 1], 1);
            for (int m = 1; m <= 6; m++) {
                assertFalse(player.on("step" + m + ".complete"), "step" + m + ".complete on a new word " + n);
            }
            player.play(0, 40).acknowledge().play(0, 1);
        }
    }

    @Test
    void aWordWithoutMotionIsCompleteInTheNextTick() {
        WordPlayer player = WordPlayer.homed().cycles(1);
        // Both lifts are at the bottom: step 6 has nothing to do.
        player.play(0, 5).play(WordPlayer.STEPS[5], 1);
        assertFalse(player.on("step6.complete"));
        player.play(WordPlayer.STEPS[5], 1);
        assertTrue(player.on("step6.complete"));
        player.assertWell();
    }

    @Test
    void completeIgnoresLampAndSpareBitsAndGoesOffOnAcknowledgeAndOnANewWord() {
        WordPlayer player = WordPlayer.homed().steps(1, 1);
        player.play(WordPlayer.STEPS[0] | WordPlayer.LAMP, 3);
        assertTrue(player.on("step1.complete"));
        player.play(WordPlayer.STEPS[0] | WordPlayer.ACKNOWLEDGE, 1);
        assertFalse(player.on("step1.complete"));
        player.play(WordPlayer.STEPS[0], 3);
        assertFalse(player.on("step1.complete"), "only a new word brings a step bit back");
        player.steps(2, 2);
        player.play(0, 1);
        assertFalse(player.on("step2.complete"));
    }

    @Test
    void theLampMustMirrorLift2WithinAStep() {
        WordPlayer player = WordPlayer.homed().cycles(1);
        assertEquals(0, player.rig.counters().lampErrors());
        player.steps(1, 4).playFor(WordPlayer.STEPS[4] & ~WordPlayer.LAMP, 700);
        assertEquals(1, player.rig.counters().lampErrors(), "dark in step 5");
        player.steps(5, 5).steps(6, 6);
        assertEquals(1, player.rig.counters().lampErrors());
        player.playFor(WordPlayer.STEPS[0] | WordPlayer.LAMP, 900);
        assertEquals(2, player.rig.counters().lampErrors(), "lit in step 1");
    }

    @Test
    void aBottleThatTheLampNeverShoneOnStaysUntreated() {
        WordPlayer player = WordPlayer.homed().steps(1, 4);
        player.until(WordPlayer.STEPS[4] & ~WordPlayer.LAMP, "step5.complete");
        assertFalse(bottle(player, 1).treated());
        player.until(WordPlayer.STEPS[5] & ~WordPlayer.LAMP, "step6.complete").cycles(2).steps(1, 1);
        assertEquals(0, player.rig.counters().delivered() - player.rig.counters().treated());
        assertTrue(player.rig.bottles().stream().anyMatch(b -> b.id() == 1), "an untreated bottle goes round again");
    }

    @Test
    void buttonsAreHeldForATimeThatAnyControlCanSee() {
        WordPlayer player = WordPlayer.homed();
        for (Button button : Button.values()) {
            String output = button.name().toLowerCase(java.util.Locale.ROOT);
            player.play(0, 5);
            player.rig.press(button);
            player.play(0, 200);
            assertTrue(player.on(output));
            player.play(0, 1);
            assertFalse(player.on(output));
        }
    }

    @Test
    void theSameInputsGiveTheSameMotionBitForBit() {
        assertArrayEquals(trace(), trace());
    }

    @ParameterizedTest
    @ValueSource(longs = {100_000, 333_333, 10_000_000, 50_000_000})
    void everyStepSizeLandsOnTheSamePlaces(long tick) {
        assertEquals(landings(WordPlayer.MILLI), landings(tick));
    }

    @Test
    void aStepOfNormalMotionAllocatesNothing() {
        WordPlayer player = WordPlayer.homed().cycles(40);
        var threads = (com.sun.management.ThreadMXBean) ManagementFactory.getThreadMXBean();
        long id = Thread.currentThread().getId();
        Rig rig = player.rig;
        int[] bits = IntStream.range(0, 13).toArray();
        long grown = 0;
        for (int n = 1; n <= 6; n++) {
            player.play(WordPlayer.STEPS[n - 1], 0);
            long before = threads.getThreadAllocatedBytes(id);
            for (int i = 0; i < 1_000; i++) {
                rig.input(bits[12], 0);
                rig.step(WordPlayer.MILLI);
                if (rig.output(Outputs.NOT_OK) != 0) {
                    throw new AssertionError(rig.faults());
                }
            }
            grown += threads.getThreadAllocatedBytes(id) - before;
        }
        // The measurement itself can allocate a little, once; a step that allocates would show 6,000 times.
        assertTrue(grown < 6_000, grown + " bytes in 6,000 steps");
        player.assertWell();
    }

    private static long[] trace() {
        WordPlayer player = new WordPlayer(new Rig(), 3_700_000);
        player.rig.jamNext(Lift.LA2);
        List<Long> trace = new ArrayList<>();
        int[] words = {WordPlayer.LA1_BIG_DOWN, WordPlayer.IM2_JOG, 0, 1, 0x24, 0xC, 0x80, 0x3C34, 0x343C, 0x8000};
        for (int word : words) {
            for (int i = 0; i < 350; i++) {
                player.play(word, 1);
                for (int k = 0; k < player.rig.outputs().size(); k++) {
                    trace.add(Double.doubleToRawLongBits(player.rig.output(k)));
                }
                trace.add(Double.doubleToRawLongBits(player.rig.wheel1Angle()));
                trace.add(Double.doubleToRawLongBits(player.rig.wheel2Angle()));
            }
        }
        return trace.stream().mapToLong(Long::longValue).toArray();
    }

    private static List<Double> landings(long tick) {
        WordPlayer player = new WordPlayer(new Rig(), tick).home();
        List<Double> landings = new ArrayList<>();
        for (int cycle = 0; cycle < 5; cycle++) {
            for (int n = 1; n <= 6; n++) {
                player.step(n);
                landings.addAll(List.of(
                        player.rig.wheel1Angle(), player.rig.wheel2Angle(),
                        player.value("la1.position"), player.value("la2.position")));
                player.rig.bottles().forEach(b -> landings.add(b.id() + b.height()));
            }
        }
        player.assertWell();
        return landings;
    }

    private static Bottle bottle(WordPlayer player, int id) {
        return player.rig.bottles().stream().filter(b -> b.id() == id).findFirst().orElseThrow();
    }

    private static Bottle.Place place(WordPlayer player, int id) {
        return bottle(player, id).place();
    }
}
