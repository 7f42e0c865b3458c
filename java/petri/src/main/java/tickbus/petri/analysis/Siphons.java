package tickbus.petri.analysis;

import java.util.ArrayList;
import java.util.BitSet;
import java.util.Comparator;
import java.util.List;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.PetriNet;

/**
 * Minimal siphons and traps. An empty siphon stays empty: every transition that puts into it also takes from it. A marked
 * trap stays marked: every transition that takes from it also puts into it (with weights of 1). Test and inhibitor arcs do
 * not matter. There can be exponentially many, so there is a limit.
 */
public final class Siphons {
    private static final int NONE = -1;
    private static final int SEVERAL = -2;
    private static final int COMPARISONS = 100;

    private final int places;
    private final int[][] puttersOf;
    private final int[][] takesFrom;
    private final long limit;
    private final String what;
    private final List<BitSet> found = new ArrayList<>();
    private long steps;

    private Siphons(PetriNet net, boolean traps, long limit) {
        places = net.places().size();
        this.limit = limit;
        what = "net " + net.name() + ": " + (traps ? "traps" : "siphons");
        int transitions = net.transitions().size();
        List<List<Integer>> putters = new ArrayList<>();
        List<List<Integer>> takes = new ArrayList<>();
        for (int p = 0; p < places; p++) {
            putters.add(new ArrayList<>());
        }
        for (int t = 0; t < transitions; t++) {
            takes.add(new ArrayList<>());
        }
        for (Arc arc : net.arcs()) {
            if (arc.kind() == (traps ? ArcKind.INPUT : ArcKind.OUTPUT)) {
                putters.get(arc.place()).add(arc.transition());
            } else if (arc.kind() == (traps ? ArcKind.OUTPUT : ArcKind.INPUT)) {
                takes.get(arc.transition()).add(arc.place());
            }
        }
        puttersOf = putters.stream().map(Siphons::sorted).toArray(int[][]::new);
        takesFrom = takes.stream().map(Siphons::sorted).toArray(int[][]::new);
    }

    private static int[] sorted(List<Integer> of) {
        return of.stream().mapToInt(Integer::intValue).sorted().toArray();
    }

    /** The minimal siphons as sets of places; throws a {@link GaveUpException} after {@code limit} steps of the search. */
    public static List<BitSet> siphons(PetriNet net, long limit) {
        return new Siphons(net, false, limit).search();
    }

    /** The minimal traps as sets of places; throws a {@link GaveUpException} after {@code limit} steps of the search. */
    public static List<BitSet> traps(PetriNet net, long limit) {
        return new Siphons(net, true, limit).search();
    }

    private List<BitSet> search() {
        BitSet barred = new BitSet();
        try {
            for (int p = 0; p < places; p++) {
                BitSet start = new BitSet();
                start.set(p);
                Ints open = new Ints();
                open.add(p);
                extend(start, barred, open);
                barred.set(p);
            }
        } catch (StackOverflowError | OutOfMemoryError deep) {
            throw new GaveUpException(what + ": gave up at a search of " + steps + " steps that does not fit into the memory, with "
                + found.size() + " found");
        }
        found.sort(Comparator.comparing(BitSet::toString));
        return found;
    }

    /**
     * Adds places until every putter also takes, in all ways that avoid the barred places. Only the putters of the open
     * places need a check: a transition that takes from a set also takes from a larger one.
     */
    private void extend(BitSet set, BitSet barred, Ints open) {
        step();
        if (found.stream().anyMatch(smaller -> contains(set, smaller))) {
            return;
        }
        while (open.size() > 0) {
            int t = putter(set, open.get(open.size() - 1));
            if (t < 0) {
                open.pop();
                continue;
            }
            int only = only(t, barred);
            if (only == NONE) {
                return;
            }
            if (only != SEVERAL) {
                step();
                set.set(only);
                open.add(only);
                continue;
            }
            BitSet without = (BitSet) barred.clone();
            for (int q : takesFrom[t]) {
                if (!without.get(q)) {
                    BitSet larger = (BitSet) set.clone();
                    larger.set(q);
                    Ints also = open.copy();
                    also.add(q);
                    extend(larger, without, also);
                    without.set(q);
                }
            }
            return;
        }
        if (found.stream().noneMatch(smaller -> contains(set, smaller))) {
            found.removeIf(larger -> contains(larger, set));
            found.add(set);
        }
    }

    /** A step, and its comparisons with what was found: many of those count as further steps. */
    private void step() {
        steps += 1 + found.size() / COMPARISONS;
        if (steps > limit) {
            throw new GaveUpException(what + ": gave up at " + limit + " steps, with " + found.size() + " found");
        }
    }

    /** A transition that puts into the place and takes nothing from the set; -1 if no transition does. */
    private int putter(BitSet set, int place) {
        for (int t : puttersOf[place]) {
            boolean takes = false;
            for (int q : takesFrom[t]) {
                takes |= set.get(q);
            }
            if (!takes) {
                return t;
            }
        }
        return -1;
    }

    /** The only unbarred place that the transition takes from. */
    private int only(int t, BitSet barred) {
        int only = NONE;
        for (int q : takesFrom[t]) {
            if (!barred.get(q)) {
                if (only != NONE) {
                    return SEVERAL;
                }
                only = q;
            }
        }
        return only;
    }

    private static boolean contains(BitSet larger, BitSet smaller) {
        int p = smaller.nextSetBit(0);
        while (p >= 0 && larger.get(p)) {
            p = smaller.nextSetBit(p + 1);
        }
        return p < 0;
    }
}
