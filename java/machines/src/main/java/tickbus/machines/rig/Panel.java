package tickbus.machines.rig;

/** The push buttons of the operator panel; a press is long enough for any control to see it. */
final class Panel {
    /** How long a press lasts. */
    static final long HELD_NANOS = 200_000_000L;

    private final long[] left = new long[Button.values().length];
    private final boolean[] down = new boolean[left.length];

    void press(Button button) {
        left[button.ordinal()] = HELD_NANOS;
    }

    boolean down(Button button) {
        return down[button.ordinal()];
    }

    void advance(long nanos) {
        for (int i = 0; i < left.length; i++) {
            down[i] = left[i] > 0;
            left[i] = Math.max(0, left[i] - nanos);
        }
    }
}
