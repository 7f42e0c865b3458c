package tickbus.petri;

import java.util.Arrays;
import java.util.List;

/**
 * The arcs of a net as arrays. {@code needFirst[t]} to {@code needFirst[t + 1]} are the needs of transition t, and
 * likewise for its changes; {@code dependentFirst[p]} leads to the needs that depend on place p.
 */
final class Effects {
    /** At least {@code needLevel} available tokens. */
    static final byte AT_LEAST = 0;
    /** At most {@code needLevel} tokens, available or not. */
    static final byte AT_MOST = 1;

    final int[] needFirst;
    final int[] needPlace;
    final int[] needLevel;
    final byte[] needKind;
    final int[] changeFirst;
    final int[] changePlace;
    final int[] changeTakes;
    final int[] changePuts;
    final int[] dependentFirst;
    /** Index of a need. */
    final int[] dependentNeed;
    /** The transition of each need. */
    final int[] needTransition;

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
        needKind = new byte[kinds.length];
        for (int i = 0; i < kinds.length; i++) {
            needKind[i] = (byte) kinds[i];
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
        dependentNeed = new int[needPlace.length];
        int[] filled = dependentFirst.clone();
        for (int i = 0; i < needPlace.length; i++) {
            dependentNeed[filled[needPlace[i]]++] = i;
        }
    }

    boolean isEnabled(int[] tokens, int t) {
        for (int i = needFirst[t]; i < needFirst[t + 1]; i++) {
            int have = tokens[needPlace[i]];
            if (needKind[i] == AT_LEAST ? have < needLevel[i] : have > needLevel[i]) {
                return false;
            }
        }
        return true;
    }

    /** Changes the tokens; on overflow throws an {@link ArithmeticException} and changes nothing. */
    void fire(int[] tokens, int t) {
        for (int i = changeFirst[t]; i < changeFirst[t + 1]; i++) {
            Math.addExact(tokens[changePlace[i]] - changeTakes[i], changePuts[i]);
        }
        for (int i = changeFirst[t]; i < changeFirst[t + 1]; i++) {
            tokens[changePlace[i]] += changePuts[i] - changeTakes[i];
        }
    }
}
