package tickbus.petri.analysis;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.HashSet;
import java.util.List;
import java.util.Set;
import tickbus.petri.net.Effects;
import tickbus.petri.net.Marking;
import tickbus.petri.net.PetriNet;

/**
 * Conflicts: pairs of transitions where the firing of one can disable the other.
 *
 * <p>A structural conflict is in the arcs: both take from one place, or one takes what the other tests, or one fills a place
 * that inhibits the other or whose capacity the other needs. In an effective conflict, a reachable marking enables both, and
 * the firing of one disables the other.
 */
public final class Conflicts {
    /**
     * Two transitions in conflict.
     *
     * @param first the one with the smaller index
     * @param second the other one
     * @param place the place that they contend for; in an effective conflict the first such place
     */
    public record Pair(int first, int second, int place) {
    }

    /**
     * A conflict that can happen.
     *
     * @param first the one that fires
     * @param second the one that is disabled
     * @param marking a reachable marking that enables both
     */
    public record Effective(int first, int second, Marking marking) {
    }

    private Conflicts() {
    }

    /** The structural conflicts, each pair of transitions once, in the order of places and transitions. */
    public static List<Pair> structural(PetriNet net) {
        List<Pair> pairs = new ArrayList<>();
        Set<Long> seen = new HashSet<>();
        forEach(net, (first, second, place) -> {
            int a = Math.min(first, second);
            int b = Math.max(first, second);
            if (seen.add((long) a << 32 | b)) {
                pairs.add(new Pair(a, b, place));
            }
        });
        return pairs;
    }

    private interface Found {
        void pair(int first, int second, int place);
    }

    private static void forEach(PetriNet net, Found found) {
        Effects effects = net.effects();
        List<List<int[]>> changes = new ArrayList<>();
        net.places().forEach(place -> changes.add(new ArrayList<>()));
        for (int t = 0; t < net.transitions().size(); t++) {
            for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
                changes.get(effects.changePlace(i))
                    .add(new int[] {t, effects.takes(i), effects.puts(i) - effects.takes(i)});
            }
        }
        for (int p = 0; p < changes.size(); p++) {
            for (int[] change : changes.get(p)) {
                for (int d = effects.firstDependent(p); d < effects.firstDependent(p + 1); d++) {
                    int need = effects.dependent(d);
                    boolean contends = effects.isAtLeast(need) ? change[1] > 0 : change[2] > 0;
                    if (contends && effects.needTransition(need) != change[0]) {
                        found.pair(change[0], effects.needTransition(need), p);
                    }
                }
            }
        }
    }

    /**
     * The clusters of transitions that are in structural conflict, directly or through others: for each transition the number
     * of its cluster; -1 if it is in no structural conflict.
     */
    public static int[] clusters(PetriNet net) {
        int[] root = new int[net.transitions().size()];
        Arrays.setAll(root, t -> t);
        boolean[] any = new boolean[root.length];
        joinAll(net, root, any);
        int[] cluster = new int[root.length];
        for (int t = 0; t < root.length; t++) {
            cluster[t] = any[t] ? find(root, t) : -1;
        }
        return cluster;
    }

    /** Joins by one transition of each place: a place that a thousand transitions share has half a million pairs. */
    private static void joinAll(PetriNet net, int[] root, boolean[] any) {
        Effects effects = net.effects();
        int places = net.places().size();
        int[] taker = new int[places];
        int[] filler = new int[places];
        boolean[] limits = new boolean[places];
        Arrays.fill(taker, -1);
        Arrays.fill(filler, -1);
        for (int t = root.length - 1; t >= 0; t--) {
            for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
                int p = effects.changePlace(i);
                taker[p] = effects.takes(i) > 0 ? t : taker[p];
                filler[p] = effects.puts(i) > effects.takes(i) ? t : filler[p];
            }
        }
        for (int need = 0; need < effects.needs(); need++) {
            int p = effects.needPlace(need);
            boolean atMost = !effects.isAtLeast(need);
            limits[p] |= atMost;
            join(root, any, effects.needTransition(need), atMost ? filler[p] : taker[p]);
        }
        for (int t = 0; t < root.length; t++) {
            for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
                int p = effects.changePlace(i);
                if (limits[p] && effects.puts(i) > effects.takes(i)) {
                    join(root, any, t, filler[p]);
                }
            }
        }
    }

    private static void join(int[] root, boolean[] any, int t, int other) {
        if (other >= 0 && other != t) {
            any[t] = true;
            any[other] = true;
            root[find(root, t)] = find(root, other);
        }
    }

    private static int find(int[] root, int of) {
        int t = of;
        while (root[t] != t) {
            root[t] = root[root[t]];
            t = root[t];
        }
        return t;
    }
}
