package tickbus.petri;

import java.util.ArrayList;
import java.util.BitSet;
import java.util.Comparator;
import java.util.List;

/**
 * Minimal siphons and traps. Once a siphon is empty it stays empty: every transition that puts into it also takes from
 * it. Once a trap is marked it stays marked: every transition that takes from it also puts into it (with weights of 1).
 * Test and inhibitor arcs do not matter. There may be exponentially many, so there is a limit.
 */
public final class Siphons {
    private final int places;
    private final int[][] puttersOf;
    private final BitSet[] takesFrom;
    private final long limit;
    private final String what;
    private final List<BitSet> found = new ArrayList<>();
    private long steps;

    private Siphons(PetriNet net, boolean traps, long limit) {
        places = net.places().size();
        this.limit = limit;
        what = "net " + net.name() + ": " + (traps ? "traps" : "siphons");
        int[][] pre = traps ? net.post() : net.pre();
        int[][] post = traps ? net.pre() : net.post();
        int transitions = net.transitions().size();
        puttersOf = new int[places][];
        takesFrom = new BitSet[transitions];
        for (int t = 0; t < transitions; t++) {
            takesFrom[t] = new BitSet();
            for (int p = 0; p < places; p++) {
                takesFrom[t].set(p, pre[p][t] > 0);
            }
        }
        for (int p = 0; p < places; p++) {
            int[] row = post[p];
            puttersOf[p] = java.util.stream.IntStream.range(0, transitions).filter(t -> row[t] > 0).toArray();
        }
    }

    /** The minimal siphons as sets of places; a {@link GaveUpException} after {@code limit} steps of the search. */
    public static List<BitSet> siphons(PetriNet net, long limit) {
        return new Siphons(net, false, limit).search();
    }

    /** The minimal traps as sets of places; a {@link GaveUpException} after {@code limit} steps of the search. */
    public static List<BitSet> traps(PetriNet net, long limit) {
        return new Siphons(net, true, limit).search();
    }

    private List<BitSet> search() {
        BitSet barred = new BitSet();
        for (int p = 0; p < places; p++) {
            BitSet start = new BitSet();
            start.set(p);
            extend(start, barred);
            barred.set(p);
        }
        found.sort(Comparator.comparing(BitSet::toString));
        return found;
    }

    /** Adds places until every putter also takes; all ways, without the barred places. */
    private void extend(BitSet set, BitSet barred) {
        if (++steps > limit) {
            throw new GaveUpException(what + ": gave up at " + limit + " steps, with " + found.size() + " found");
        }
        if (found.stream().anyMatch(smaller -> contains(set, smaller))) {
            return;
        }
        for (int p = set.nextSetBit(0); p >= 0; p = set.nextSetBit(p + 1)) {
            for (int t : puttersOf[p]) {
                if (!takesFrom[t].intersects(set)) {
                    BitSet without = (BitSet) barred.clone();
                    for (int q = takesFrom[t].nextSetBit(0); q >= 0; q = takesFrom[t].nextSetBit(q + 1)) {
                        if (!without.get(q)) {
                            BitSet larger = (BitSet) set.clone();
                            larger.set(q);
                            extend(larger, without);
                            without.set(q);
                        }
                    }
                    return;
                }
            }
        }
        found.removeIf(larger -> contains(larger, set));
        found.add(set);
    }

    private static boolean contains(BitSet larger, BitSet smaller) {
        BitSet rest = (BitSet) smaller.clone();
        rest.andNot(larger);
        return rest.isEmpty();
    }
}
