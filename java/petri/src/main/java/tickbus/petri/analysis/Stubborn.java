package tickbus.petri.analysis;

import java.util.Arrays;
import java.util.function.BooleanSupplier;
import tickbus.petri.net.Effects;
import tickbus.petri.net.PetriNet;

/**
 * Stubborn sets (Valmari): enabled transitions that are enough to find every deadlock. Whatever the transitions outside of the
 * set do, they neither enable a disabled one within, nor disable one that was taken as the key; and no firing within disables
 * one outside. So every sequence of firings that ends in a deadlock contains a transition of the set, and this one can as well
 * fire first.
 */
final class Stubborn {
    private final Effects effects;
    private final Walk walk;
    /** Per place, the transitions that raise its tokens, and those that lower them. */
    private final int[][] raisers;
    private final int[][] lowerers;
    private final int[] stamps;
    /** The set whose members have all that depends on a fall, or on a rise, of the place. */
    private final int[] fallStamps;
    private final int[] riseStamps;
    private final BooleanSupplier isLate;
    private int stamp;
    private final int[] open;
    private int opened;
    private final int[] members;
    private int[] best;
    private final long[] result;

    /** Stops looking for a smaller set when {@code isLate}, which it asks before each key. */
    Stubborn(PetriNet net, Walk walk, BooleanSupplier isLate) {
        this.isLate = isLate;
        this.walk = walk;
        effects = net.effects();
        int transitions = net.transitions().size();
        raisers = changers(net, 1);
        lowerers = changers(net, -1);
        stamps = new int[transitions];
        fallStamps = new int[net.places().size()];
        riseStamps = new int[net.places().size()];
        open = new int[transitions];
        members = new int[transitions];
        best = new int[transitions];
        result = new long[walk.enabled.length];
    }

    private int[][] changers(PetriNet net, int sign) {
        Ints[] found = new Ints[net.places().size()];
        for (int t = 0; t < net.transitions().size(); t++) {
            for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
                if (Integer.signum(effects.puts(i) - effects.takes(i)) == sign) {
                    int p = effects.changePlace(i);
                    found[p] = found[p] == null ? new Ints() : found[p];
                    found[p].add(t);
                }
            }
        }
        return Arrays.stream(found).map(one -> one == null ? new int[0] : one.toArray()).toArray(int[][]::new);
    }

    /** The enabled transitions of a stubborn set of the walk's marking, a bit each: of the sets by each key the smallest. */
    long[] set() {
        int least = Integer.MAX_VALUE;
        for (int w = 0; w < walk.enabled.length && least > 1; w++) {
            for (long bits = walk.enabled[w]; bits != 0 && least > 1 && !isLate.getAsBoolean(); bits &= bits - 1) {
                int size = close(64 * w + Long.numberOfTrailingZeros(bits), least);
                if (size < least) {
                    least = size;
                    System.arraycopy(members, 0, best, 0, size);
                }
            }
        }
        Arrays.fill(result, 0);
        for (int i = 0; i < least && least < Integer.MAX_VALUE; i++) {
            result[best[i] / 64] |= 1L << best[i];
        }
        return result;
    }

    /** Puts the enabled transitions of the set with this key among the members; returns their number, or {@code least}. */
    private int close(int key, int least) {
        if (++stamp == 0) {
            Arrays.fill(stamps, 0);
            Arrays.fill(fallStamps, 0);
            Arrays.fill(riseStamps, 0);
            stamp = 1;
        }
        int size = 0;
        opened = 0;
        open(key);
        while (opened > 0) {
            int t = open[--opened];
            if (walk.unmet[t] > 0) {
                openAll(helpers(hardest(t)));
                continue;
            }
            if (size + 1 >= least) {
                return least;
            }
            members[size++] = t;
            openDisabled(t);
            if (t == key) {
                for (int need = effects.firstNeed(t); need < effects.firstNeed(t + 1); need++) {
                    int p = effects.needPlace(need);
                    openAll(effects.isAtLeast(need) ? lowerers[p] : raisers[p]);
                }
            }
        }
        return size;
    }

    private void open(int t) {
        if (stamps[t] != stamp) {
            stamps[t] = stamp;
            open[opened++] = t;
        }
    }

    private void openAll(int[] all) {
        for (int t : all) {
            open(t);
        }
    }

    /** Opens the transitions that a firing of this one can disable. */
    private void openDisabled(int t) {
        for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
            int gain = effects.puts(i) - effects.takes(i);
            int p = effects.changePlace(i);
            int[] done = gain < 0 ? fallStamps : riseStamps;
            if (gain != 0 && done[p] != stamp) {
                done[p] = stamp;
                for (int d = effects.firstDependent(p); d < effects.firstDependent(p + 1); d++) {
                    int need = effects.dependent(d);
                    if (effects.isAtLeast(need) == gain < 0) {
                        open(effects.needTransition(need));
                    }
                }
            }
        }
    }

    /** The transitions whose firing brings a need nearer to being met. */
    private int[] helpers(int need) {
        int p = effects.needPlace(need);
        return effects.isAtLeast(need) ? raisers[p] : lowerers[p];
    }

    /** The unmet need with the fewest transitions that are not in the set yet. */
    private int hardest(int t) {
        int hardest = -1;
        int fewest = Integer.MAX_VALUE;
        for (int need = effects.firstNeed(t); need < effects.firstNeed(t + 1); need++) {
            if (!walk.isMet(need)) {
                int count = 0;
                for (int helper : helpers(need)) {
                    count += stamps[helper] == stamp ? 0 : 1;
                }
                if (count < fewest) {
                    fewest = count;
                    hardest = need;
                }
            }
        }
        return hardest;
    }
}
