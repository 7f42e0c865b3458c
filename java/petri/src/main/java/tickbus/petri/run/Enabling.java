package tickbus.petri.run;

import tickbus.petri.net.Effects;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;

/**
 * The marking of a running net, and the transitions that it enables. A firing looks only at the arcs of the places that it
 * changes, so its cost does not grow with the net.
 */
final class Enabling {
    private final PetriNet net;
    private final Effects effects;
    final int[] tokens;
    /** The tokens that input and test arcs may use; in an untimed place, all its tokens. */
    private final int[] available;
    private final TokenAges[] ages;
    private final int[] unmet;
    private final IndexSet touched;
    final IndexSet enabled;
    private final Watcher watcher;
    /** Timed transitions by index, then timed places. */
    final DueHeap due;
    /** The number of needs that have changed so far. */
    long visits;

    /** Called for the transitions that a change as a whole enables or disables. */
    interface Watcher {
        void enabled(int transition);

        void disabled(int transition);
    }

    Enabling(PetriNet net, Watcher watcher) {
        this.net = net;
        this.watcher = watcher;
        effects = net.effects();
        int places = net.places().size();
        int transitions = net.transitions().size();
        tokens = new int[places];
        available = new int[places];
        ages = new TokenAges[places];
        for (Place place : net.places()) {
            ages[place.index()] = place.delay() > 0 ? new TokenAges() : null;
        }
        unmet = new int[transitions];
        touched = new IndexSet(transitions);
        enabled = new IndexSet(transitions);
        due = new DueHeap(transitions + places);
    }

    /** Sets a marking whose tokens arrive now. */
    void start(int[] marking, long now) {
        for (int t = 0; t < unmet.length; t++) {
            unmet[t] = 0;
            for (int i = effects.firstNeed(t); i < effects.firstNeed(t + 1); i++) {
                unmet[t] += isMet(i, 0, 0) ? 0 : 1;
            }
            touched.add(t);
        }
        for (Place place : net.places()) {
            arrive(place.index(), marking[place.index()], now);
        }
        settle();
    }

    private boolean isMet(int need, int usable, int all) {
        return effects.isAtLeast(need) ? usable >= effects.needLevel(need) : all <= effects.needLevel(need);
    }

    void fire(int t, long now) {
        for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
            int p = effects.changePlace(i);
            if ((long) tokens[p] - effects.takes(i) + effects.puts(i) > Integer.MAX_VALUE) {
                throw new ArithmeticException("place " + net.place(p).name() + " would hold more than " + Integer.MAX_VALUE
                    + " tokens");
            }
        }
        for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
            int p = effects.changePlace(i);
            int takes = effects.takes(i);
            int puts = effects.puts(i);
            if (ages[p] == null) {
                change(p, available[p] + puts - takes, tokens[p] + puts - takes);
            } else {
                change(p, available[p] - takes, tokens[p] - takes);
                arrive(p, puts, now);
            }
        }
        settle();
    }

    /** The time after a delay; {@link Long#MAX_VALUE}, which is never, if it exceeds a long. */
    static long after(long now, long delay) {
        return delay > Long.MAX_VALUE - Math.max(0, now) ? Long.MAX_VALUE : now + delay;
    }

    private void arrive(int p, int count, long now) {
        if (count == 0) {
            return;
        }
        if (ages[p] == null) {
            change(p, available[p] + count, tokens[p] + count);
        } else {
            ages[p].add(after(now, net.place(p).delay()), count);
            due.put(unmet.length + p, ages[p].next());
            change(p, available[p], tokens[p] + count);
        }
    }

    void copyTokens(NetState state) {
        System.arraycopy(tokens, 0, state.tokens, 0, tokens.length);
        System.arraycopy(available, 0, state.available, 0, tokens.length);
    }

    /** The tokens of a place that input and test arcs may use. */
    int available(int place) {
        return available[place];
    }

    /** When the next tokens of a place become available; {@link Long#MAX_VALUE} if all are. */
    long nextOf(int place) {
        return ages[place] == null ? Long.MAX_VALUE : ages[place].next();
    }

    /** Makes available the tokens of a place that are old enough. */
    void release(int place, long now) {
        while (ages[place].isDue(now)) {
            change(place, available[place] + ages[place].release(), tokens[place]);
        }
        if (ages[place].next() != Long.MAX_VALUE) {
            due.put(unmet.length + place, ages[place].next());
        }
        settle();
    }

    private void change(int p, int usable, int all) {
        int usableBefore = available[p];
        int allBefore = tokens[p];
        available[p] = usable;
        tokens[p] = all;
        count(effects.dependentAbove(p, true, usableBefore), effects.dependentAbove(p, true, usable));
        count(effects.dependentAbove(p, false, all - 1), effects.dependentAbove(p, false, allBefore - 1));
    }

    /** Counts the needs of these dependents as met now, or as unmet if the two are the other way round. */
    private void count(int from, int to) {
        for (int d = Math.min(from, to); d < Math.max(from, to); d++) {
            int t = effects.needTransition(effects.dependent(d));
            visits++;
            unmet[t] += from < to ? -1 : 1;
            touched.add(t);
        }
    }

    /** Evaluates the change as a whole: its parts neither enable nor disable. */
    private void settle() {
        for (int i = 0; i < touched.size(); i++) {
            int t = touched.get(i);
            if (unmet[t] == 0 && !enabled.contains(t)) {
                enabled.add(t);
                watcher.enabled(t);
            } else if (unmet[t] != 0 && enabled.contains(t)) {
                enabled.remove(t);
                watcher.disabled(t);
            }
        }
        touched.clear();
    }
}
