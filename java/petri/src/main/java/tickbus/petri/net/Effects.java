package tickbus.petri.net;

import java.util.Arrays;
import java.util.Comparator;
import java.util.List;
import java.util.stream.IntStream;

/**
 * The arcs of a net by number, for programs that go through them often: analyses, and interpreters of nets. Immutable.
 *
 * <p>A transition has needs, which must hold before it fires, and changes, one for each place that it takes from or puts
 * into. The needs of transition t are {@code firstNeed(t)} to {@code firstNeed(t + 1) - 1}, and likewise its changes; the
 * dependents of a place lead to the needs that compare with its tokens: those at least a level, then those at most one, by
 * level. Numbers out of range throw an
 * {@link IndexOutOfBoundsException}.
 */
public final class Effects {
    private static final int AT_LEAST = 1;
    private static final int AT_MOST = 0;

    private final int[] needFirst;
    private final int[] needPlace;
    private final int[] needLevel;
    private final boolean[] atLeast;
    private final int[] changeFirst;
    private final int[] changePlace;
    private final int[] changeTakes;
    private final int[] changePuts;
    private final int[] dependentFirst;
    /** The end of a place's dependents that are at least a level; behind it are those that are at most one. */
    private final int[] limitFirst;
    /** The number of a need. */
    private final int[] dependentNeed;
    /** The transition of each need. */
    private final int[] needTransition;

    Effects(List<Place> places, int transitions, List<Arc> arcs) {
        Rows needs = new Rows(3);
        Rows changes = new Rows(3);
        needFirst = new int[transitions + 1];
        changeFirst = new int[transitions + 1];
        int[] takes = new int[places.size()];
        int[] puts = new int[places.size()];
        int next = 0;
        for (int t = 0; t < transitions; t++) {
            int from = next;
            while (next < arcs.size() && arcs.get(next).transition() == t) {
                Arc arc = arcs.get(next++);
                switch (arc.kind()) {
                    case INPUT -> takes[arc.place()] = arc.weight();
                    case OUTPUT -> puts[arc.place()] = arc.weight();
                    case TEST, INHIBITOR -> { }
                }
                switch (arc.kind()) {
                    case INPUT, TEST -> needs.add(arc.place(), arc.weight(), AT_LEAST);
                    case INHIBITOR -> needs.add(arc.place(), arc.weight() - 1, AT_MOST);
                    case OUTPUT -> { }
                }
            }
            for (Arc arc : arcs.subList(from, next)) {
                int p = arc.place();
                if (takes[p] != 0 || puts[p] != 0) {
                    int gain = puts[p] - takes[p];
                    if (gain > 0 && places.get(p).isLimited()) {
                        needs.add(p, places.get(p).capacity() - gain, AT_MOST);
                    }
                    changes.add(p, takes[p], puts[p]);
                    takes[p] = 0;
                    puts[p] = 0;
                }
            }
            needFirst[t + 1] = needs.size();
            changeFirst[t + 1] = changes.size();
        }
        needPlace = needs.column(0);
        needLevel = needs.column(1);
        int[] kinds = needs.column(2);
        atLeast = new boolean[kinds.length];
        for (int i = 0; i < kinds.length; i++) {
            atLeast[i] = kinds[i] == AT_LEAST;
        }
        changePlace = changes.column(0);
        changeTakes = changes.column(1);
        changePuts = changes.column(2);
        needTransition = new int[needPlace.length];
        for (int t = 0; t < transitions; t++) {
            Arrays.fill(needTransition, needFirst[t], needFirst[t + 1], t);
        }
        dependentFirst = new int[places.size() + 1];
        for (int place : needPlace) {
            dependentFirst[place + 1]++;
        }
        for (int p = 0; p < places.size(); p++) {
            dependentFirst[p + 1] += dependentFirst[p];
        }
        dependentNeed = IntStream.range(0, needPlace.length).boxed()
            .sorted(Comparator.<Integer>comparingInt(i -> needPlace[i]).thenComparing(i -> !atLeast[i]).thenComparingInt(i -> needLevel[i]))
            .mapToInt(Integer::intValue).toArray();
        limitFirst = Arrays.copyOf(dependentFirst, places.size());
        for (int i = 0; i < needPlace.length; i++) {
            limitFirst[needPlace[i]] += atLeast[i] ? 1 : 0;
        }
    }

    /** The first need of a transition. The number of transitions is a valid transition here, for the end of the last one. */
    public int firstNeed(int transition) {
        return needFirst[transition];
    }

    /** The number of needs of all transitions. */
    public int needs() {
        return needPlace.length;
    }

    /** The place of a need. */
    public int needPlace(int need) {
        return needPlace[need];
    }

    /** The number of tokens that a need compares with. */
    public int needLevel(int need) {
        return needLevel[need];
    }

    /**
     * True if a need is at least its level of tokens, of those that are old enough to be used; otherwise it is at most its
     * level, of all tokens.
     */
    public boolean isAtLeast(int need) {
        return atLeast[need];
    }

    /** The transition of a need. */
    public int needTransition(int need) {
        return needTransition[need];
    }

    /** The first change of a transition. The number of transitions is a valid transition here, for the end of the last one. */
    public int firstChange(int transition) {
        return changeFirst[transition];
    }

    /** The place of a change. */
    public int changePlace(int change) {
        return changePlace[change];
    }

    /** The tokens that a change takes. */
    public int takes(int change) {
        return changeTakes[change];
    }

    /** The tokens that a change puts. */
    public int puts(int change) {
        return changePuts[change];
    }

    /** The first dependent of a place. The number of places is a valid place here, for the end of the last one. */
    public int firstDependent(int place) {
        return dependentFirst[place];
    }

    /**
     * The first dependent of a place, of those that are at least a level or of those that are at most one, whose level is above
     * this number of tokens. A change of tokens meets or breaks only the needs between two such dependents.
     */
    public int dependentAbove(int place, boolean isAtLeast, int tokens) {
        int low = isAtLeast ? dependentFirst[place] : limitFirst[place];
        int high = isAtLeast ? limitFirst[place] : dependentFirst[place + 1];
        while (low < high) {
            int middle = (low + high) >>> 1;
            if (needLevel[dependentNeed[middle]] > tokens) {
                high = middle;
            } else {
                low = middle + 1;
            }
        }
        return low;
    }

    /** The need to which a dependent leads. */
    public int dependent(int dependent) {
        return dependentNeed[dependent];
    }

    /** True if these tokens, one figure per place, enable the transition. */
    public boolean isEnabled(int[] tokens, int t) {
        for (int i = needFirst[t]; i < needFirst[t + 1]; i++) {
            int have = tokens[needPlace[i]];
            if (atLeast[i] ? have < needLevel[i] : have > needLevel[i]) {
                return false;
            }
        }
        return true;
    }

    /**
     * Changes the tokens, one figure per place, of an enabled transition; on overflow throws an {@link ArithmeticException}
     * and changes nothing.
     */
    public void fire(int[] tokens, int t) {
        for (int i = changeFirst[t]; i < changeFirst[t + 1]; i++) {
            Math.addExact(tokens[changePlace[i]] - changeTakes[i], changePuts[i]);
        }
        for (int i = changeFirst[t]; i < changeFirst[t + 1]; i++) {
            tokens[changePlace[i]] += changePuts[i] - changeTakes[i];
        }
    }
}
