package tickbus.machines.rig;

/**
 * Reports completed steps to the control: complete(n) rises when all motion of command word n has ended.
 *
 * <p>The bit stays on until the command pattern changes or Acknowledge rises. A fault cancels the step: its bit never comes.
 */
final class StepMonitor {
    static final int STEPS = 6;

    /** The command words of the six steps without the lamp, which is not a motion. */
    private static final int[] WORDS = {0x0001, 0x0024, 0x000C, 0x0080, 0x1C34, 0x143C};

    private enum State {
        WAITING,
        COMPLETE,
        OVER
    }

    private State state = State.OVER;
    private int pattern;
    private int step;

    /** The last completed step; 0 outside a cycle: after a fault, or after a word of no step. */
    private int previous;

    private long cycles;
    private boolean lampWrong;
    private long lampErrors;

    /**
     * Checks the command pattern and the drives at the end of a step.
     *
     * @param newPattern motion and suction bits of the command word
     * @param acknowledge Acknowledge rose
     * @param fault Not OK is on
     * @param busy a drive is moving, or ignores a run bit
     */
    void look(int newPattern, boolean acknowledge, boolean fault, boolean busy) {
        if (newPattern != pattern) {
            pattern = newPattern;
            step = stepOf(newPattern);
            state = State.WAITING;
            if (step == 0) {
                previous = 0;
            }
        } else if (state == State.WAITING && step > 0 && !busy) {
            state = State.COMPLETE;
            if (inTurn() && step == STEPS) {
                cycles++;
            }
            previous = inTurn() ? step : 0;
        } else if (state == State.COMPLETE && acknowledge) {
            state = State.OVER;
        }
        if (fault) {
            state = State.OVER;
            previous = 0;
        }
    }

    /**
     * True if the current step belongs to a cycle. The word of a homing with both cups on equals that of step 6, so a step
     * only counts after its predecessor.
     */
    private boolean inTurn() {
        return step > 0 && (step == previous || step == previous % STEPS + 1);
    }

    /** Compares the lamp with the commanded motion of lift 2, which it must follow within a cycle. */
    void lamp(boolean lamp, boolean lift2Runs) {
        boolean wrong = inTurn() && lamp != lift2Runs;
        if (wrong && !lampWrong) {
            lampErrors++;
        }
        lampWrong = wrong;
    }

    /** The step of the current word, 1 to 6, or 0. */
    int step() {
        return step;
    }

    boolean complete(int n) {
        return state == State.COMPLETE && step == n;
    }

    long cycles() {
        return cycles;
    }

    long lampErrors() {
        return lampErrors;
    }

    private static int stepOf(int pattern) {
        for (int i = 0; i < STEPS; i++) {
            if (WORDS[i] == pattern) {
                return i + 1;
            }
        }
        return 0;
    }
}
