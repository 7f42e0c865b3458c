package tickbus.machines.rig;

import java.util.List;

/** The variables that the rig shows to the control. */
final class Outputs {
    static final int STEP1_COMPLETE = 0;
    static final int PACKAGE1 = 6;
    static final int PACKAGE2 = 7;
    static final int HOME1 = 8;
    static final int HOME2 = 9;
    static final int NOT_OK = 10;
    static final int START = 11;
    static final int STOP = 12;
    static final int RESET = 13;
    static final int LA1_BOTTOM = 14;
    static final int LA2_BOTTOM = 15;
    static final int LA1_POSITION = 16;
    static final int LA2_POSITION = 17;

    static final List<String> NAMES = List.of(
            "step1.complete", "step2.complete", "step3.complete", "step4.complete", "step5.complete", "step6.complete",
            "package1", "package2", "home1", "home2", "not.ok", "start", "stop", "reset",
            "la1.bottom", "la2.bottom", "la1.position", "la2.position");

    private final double[] values = new double[NAMES.size()];

    double get(int index) {
        return values[index];
    }

    void set(int index, double value) {
        values[index] = value;
    }

    void set(int index, boolean value) {
        values[index] = value ? 1 : 0;
    }
}
