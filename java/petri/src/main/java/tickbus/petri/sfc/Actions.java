package tickbus.petri.sfc;

/** The actions of a running chart: an action control of IEC 61131-3 for each. */
final class Actions {
    private final Sfc chart;
    private final State state;
    /** The steps that were active when the scan began. */
    private final boolean[] before;
    private final boolean[] stored;
    /** Active by a step, in the last scan. */
    private final boolean[] was;
    private final boolean[] is;
    private final boolean[] sets;
    private final boolean[] resets;
    /** Nanoseconds until the action is set or reset; 0 if it does not wait. */
    private final long[] setIn;
    private final long[] resetIn;

    Actions(Sfc chart, State state, boolean[] before) {
        this.chart = chart;
        this.state = state;
        this.before = before;
        int count = chart.actions.size();
        stored = new boolean[count];
        was = new boolean[count];
        is = new boolean[count];
        sets = new boolean[count];
        resets = new boolean[count];
        setIn = new long[count];
        resetIn = new long[count];
    }

    void run(long elapsed) {
        for (int a = 0; a < is.length; a++) {
            was[a] = is[a];
            is[a] = false;
            sets[a] = isOver(setIn, a, elapsed);
            resets[a] = isOver(resetIn, a, elapsed);
        }
        for (Association one : chart.associations) {
            associate(one);
        }
        for (int a = 0; a < is.length; a++) {
            if (sets[a]) {
                setIn[a] = 0;
                stored[a] = true;
            }
            if (resets[a]) {
                setIn[a] = 0;
                resetIn[a] = 0;
                stored[a] = false;
            }
            int variable = chart.actions.get(a).variable();
            if (variable >= 0 && (is[a] || was[a] || sets[a] || resets[a])) {
                state.values[variable] = is[a] && !resets[a] || stored[a] ? 1 : 0;
            }
        }
        for (int a = 0; a < is.length; a++) {
            if (chart.actions.get(a).body() != null && (is[a] || stored[a])) {
                chart.actions.get(a).body().run(state);
            }
        }
    }

    private static boolean isOver(long[] in, int a, long elapsed) {
        if (in[a] == 0) {
            return false;
        }
        in[a] = Math.max(0, in[a] - elapsed);
        return in[a] == 0;
    }

    private void associate(Association one) {
        int a = one.action();
        boolean active = state.active[one.step()];
        boolean activated = active && !before[one.step()];
        boolean left = !active && before[one.step()];
        long time = state.nanos[one.step()];
        switch (one.qualifier()) {
            case N -> is[a] |= active;
            case P, P1 -> is[a] |= activated;
            case P0 -> is[a] |= left;
            case L -> is[a] |= active && time < one.nanos();
            case D -> is[a] |= active && time >= one.nanos();
            case S -> sets[a] |= active;
            case R -> resets[a] |= active;
            case SD, DS -> {
                if (activated) {
                    setIn[a] = one.nanos();
                    sets[a] |= one.nanos() == 0;
                } else if (left && one.qualifier() == Association.Qualifier.DS) {
                    setIn[a] = 0;
                }
            }
            case SL -> {
                if (activated) {
                    sets[a] = true;
                    resetIn[a] = one.nanos();
                }
            }
        }
    }
}
