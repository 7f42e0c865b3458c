package tickbus.machines.rig;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.List;

/** Sends command words to a rig, as a control does, and checks its outputs. */
final class WordPlayer {
    static final long MILLI = 1_000_000L;

    static final int IM1_INDEX = 1;
    static final int IM1_JOG = 1 << 1;
    static final int LA1_RUN = 1 << 2;
    static final int LA1_BIG_UP = LA1_RUN;
    static final int LA1_SMALL_DOWN = LA1_RUN | 1 << 3;
    static final int LA1_SMALL_UP = LA1_RUN | 1 << 4;
    static final int LA1_BIG_DOWN = LA1_RUN | 1 << 3 | 1 << 4;
    static final int SC1 = 1 << 5;
    static final int IM2_INDEX = 1 << 7;
    static final int IM2_JOG = 1 << 8;
    static final int LA2_DOWN = 1 << 10;
    static final int LA2_UP = 1 << 10 | 1 << 11;
    static final int SC2 = 1 << 12;
    static final int LAMP = 1 << 13;
    static final int ACKNOWLEDGE = 1 << 15;

    /** The command words of steps 1 to 6. */
    static final int[] STEPS = {0x0001, 0x0024, 0x000C, 0x0080, 0x3C34, 0x343C};

    private static final int[] BITS = {0, 1, 2, 3, 4, 5, 7, 8, 10, 11, 12, 13, 15};
    private static final List<String> NAMES = List.of(
            "im1.index", "im1.jog", "la1.run", "la1.code.low", "la1.code.high", "sc1", "im2.index", "im2.jog",
            "la2.run", "la2.up", "sc2", "lamp", "acknowledge");

    final Rig rig;
    final long tick;
    private int word;

    WordPlayer(Rig rig, long tick) {
        this.rig = rig;
        this.tick = tick;
    }

    /** A rig in start position, stepped by 1 ms. */
    static WordPlayer homed() {
        return homed(MILLI);
    }

    static WordPlayer homed(long tick) {
        return new WordPlayer(new Rig(0, 0, 0, 0), tick).play(0, 1);
    }

    /** Sets a word and steps a number of times. */
    WordPlayer play(int newWord, int ticks) {
        word = newWord;
        for (int i = 0; i < BITS.length; i++) {
            rig.input(rig.inputs().indexOf(NAMES.get(i)), word >> BITS[i] & 1);
        }
        for (int i = 0; i < ticks; i++) {
            rig.step(tick);
        }
        return this;
    }

    WordPlayer playFor(int newWord, long milliseconds) {
        return play(newWord, Math.toIntExact(milliseconds * MILLI / tick));
    }

    /** Sets a word and steps until an output is on; fails after ten seconds of simulation time. */
    WordPlayer until(int newWord, String output) {
        play(newWord, 1);
        long left = 10_000 * MILLI / tick;
        while (!on(output)) {
            assertTrue(left-- > 0, () -> output + " never came on, faults: " + rig.faults());
            rig.step(tick);
        }
        return this;
    }

    /** Plays a step's word until the rig reports it complete; returns how long that took, in nanoseconds. */
    long step(int n) {
        long begin = rig.time();
        until(STEPS[n - 1], "step" + n + ".complete");
        return rig.time() - begin;
    }

    /** Plays steps from first to last. */
    WordPlayer steps(int first, int last) {
        for (int n = first; n <= last; n++) {
            step(n);
        }
        return this;
    }

    WordPlayer cycles(int count) {
        for (int i = 0; i < count; i++) {
            steps(1, 6);
        }
        return this;
    }

    /** An acknowledge pulse on an otherwise empty word. */
    WordPlayer acknowledge() {
        return play(0, 2).play(ACKNOWLEDGE, 2).play(0, 1);
    }

    /** Homes the rig as a control does: lifts down, then suction off, then wheels. */
    WordPlayer home() {
        int suction = word & (SC1 | SC2);
        if (!on("la1.bottom")) {
            until(suction | LA1_BIG_DOWN, "la1.bottom");
        }
        if (!on("la2.bottom")) {
            until(suction | LA2_DOWN, "la2.bottom");
        }
        play(0, 2);
        if (!on("home1")) {
            until(IM1_JOG, "home1");
        }
        if (!on("home2")) {
            until(IM2_JOG, "home2");
        }
        return playFor(0, 2_000);
    }

    double value(String output) {
        return rig.output(rig.outputs().indexOf(output));
    }

    boolean on(String output) {
        return value(output) != 0;
    }

    /** Checks that every bottle is somewhere, and none is counted twice. */
    WordPlayer assertAccounted() {
        Counters c = rig.counters();
        assertEquals(c.fed(), c.delivered() + c.removed() + c.fallen() + rig.bottles().size(), c::toString);
        return this;
    }

    WordPlayer assertWell() {
        assertEquals(List.of(), rig.faults());
        assertTrue(!on("not.ok"), "Not OK without a cause");
        return assertAccounted();
    }

    /** Not OK is on for one cause, whose text contains the given words. */
    WordPlayer assertFault(String words) {
        assertTrue(on("not.ok"), "Not OK is off, expected: " + words);
        assertTrue(rig.faults().get(0).contains(words), () -> rig.faults() + " does not say: " + words);
        assertTrue(!rig.moving() || rig.jammed(), "a drive moves in spite of a fault");
        return assertAccounted();
    }
}
