package tickbus.machines.rig;

import java.util.List;

/** The variables that the control writes, with their edges from one step to the next. */
final class Inputs {
    static final int IM1_INDEX = 0;
    static final int IM1_JOG = 1;
    static final int LA1_RUN = 2;
    static final int LA1_CODE_LOW = 3;
    static final int LA1_CODE_HIGH = 4;
    static final int SC1 = 5;
    static final int IM2_INDEX = 6;
    static final int IM2_JOG = 7;
    static final int LA2_RUN = 8;
    static final int LA2_UP = 9;
    static final int SC2 = 10;
    static final int LAMP = 11;
    static final int ACKNOWLEDGE = 12;
    static final int READY = 13;
    static final int RUNNING = 14;
    static final int FAULT = 15;
    static final int PARKED = 16;
    static final int PHASE = 17;
    static final int STEP = 18;
    static final int CYCLES = 19;

    static final List<String> NAMES = List.of(
            "im1.index", "im1.jog", "la1.run", "la1.code.low", "la1.code.high", "sc1",
            "im2.index", "im2.jog", "la2.run", "la2.up", "sc2", "lamp", "acknowledge",
            "panel.ready", "panel.running", "panel.fault", "panel.parked",
            "panel.phase", "panel.step", "panel.cycles");

    /** Bit of the command word for each of the inputs that belong to motion or suction. */
    private static final int[] BITS = {0, 1, 2, 3, 4, 5, 7, 8, 10, 11, 12};

    private final double[] written = new double[NAMES.size()];
    private final boolean[] level = new boolean[NAMES.size()];
    private final boolean[] before = new boolean[NAMES.size()];

    void write(int index, double value) {
        written[index] = value;
    }

    /** Takes the written values as the levels of this step. */
    void sample() {
        for (int i = 0; i < level.length; i++) {
            before[i] = level[i];
            level[i] = written[i] >= 0.5;
        }
    }

    boolean high(int index) {
        return level[index];
    }

    boolean rising(int index) {
        return level[index] && !before[index];
    }

    boolean falling(int index) {
        return !level[index] && before[index];
    }

    boolean changed(int index) {
        return level[index] != before[index];
    }

    double value(int index) {
        return written[index];
    }

    /** The motion and suction bits of the command word; lamp, acknowledge and spare bits are left out. */
    int pattern() {
        int word = 0;
        for (int i = 0; i < BITS.length; i++) {
            if (level[i]) {
                word |= 1 << BITS[i];
            }
        }
        return word;
    }
}
