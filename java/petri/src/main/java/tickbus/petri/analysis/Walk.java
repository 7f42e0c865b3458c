package tickbus.petri.analysis;

import tickbus.petri.net.Effects;
import tickbus.petri.net.PetriNet;

/**
 * The marking that is explored, and the transitions that it enables. Going to another marking looks only at the places where
 * the two differ, which are few in the order of an exploration.
 */
final class Walk {
    private final Effects effects;
    private final MarkingStore store;
    private final Implied implied;
    final int[] tokens;
    final int[] bounds;
    /** The number of unmet needs of each transition. */
    final int[] unmet;
    /** A bit for each transition. */
    final long[] enabled;
    /** The words of the marking after the last firing, and their hash. */
    long[] next;
    long nextHash;
    private long[] words;
    private long[] read;
    private long hash;
    private final int[] pending;
    private final boolean[] isPending;
    private final int[] pendingGain;
    private int pendings;
    private final int[] gainFirst;
    private final int[] gainPlace;
    private final int[] gain;
    /** The greatest count of a place that fits. */
    private final int[] most;
    private final int[] addFirst;
    private int[] addWord;
    private long[] add;
    private final long[] addHash;

    Walk(PetriNet net, MarkingStore store) {
        this.store = store;
        effects = net.effects();
        implied = store.implied();
        tokens = net.initialMarking().toArray();
        bounds = tokens.clone();
        int transitions = net.transitions().size();
        unmet = new int[transitions];
        enabled = new long[(transitions + 63) / 64];
        pending = new int[tokens.length];
        isPending = new boolean[tokens.length];
        pendingGain = new int[tokens.length];
        most = new int[tokens.length];
        gainFirst = new int[transitions + 1];
        addFirst = new int[transitions + 1];
        addHash = new long[transitions];
        int changes = effects.firstChange(transitions);
        gainPlace = new int[changes];
        gain = new int[changes];
        for (int t = 0; t < transitions; t++) {
            gainFirst[t + 1] = gainFirst[t];
            for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
                if (effects.puts(i) != effects.takes(i)) {
                    gainPlace[gainFirst[t + 1]] = effects.changePlace(i);
                    gain[gainFirst[t + 1]++] = effects.puts(i) - effects.takes(i);
                }
            }
            for (int i = effects.firstNeed(t); i < effects.firstNeed(t + 1); i++) {
                unmet[t] += isMet(i, tokens[effects.needPlace(i)]) ? 0 : 1;
            }
            if (unmet[t] == 0) {
                enabled[t / 64] |= 1L << t;
            }
        }
        layOut();
        store.pack(tokens, words);
        hash = store.hash(words);
    }

    private boolean isMet(int need, int count) {
        return effects.isAtLeast(need) ? count >= effects.needLevel(need) : count <= effects.needLevel(need);
    }

    boolean isMet(int need) {
        return isMet(need, tokens[effects.needPlace(need)]);
    }

    /** Sums up what each firing adds to the words of a marking. A sum of numbers side by side has no carry if each result fits. */
    private void layOut() {
        words = new long[store.words];
        read = new long[store.words];
        next = new long[store.words];
        addWord = new int[gainPlace.length];
        add = new long[gainPlace.length];
        for (int p = 0; p < most.length; p++) {
            most[p] = implied.isImplied(p) ? Integer.MAX_VALUE : store.mask(p);
        }
        for (int t = 0; t < unmet.length; t++) {
            int end = addFirst[t];
            addHash[t] = 0;
            for (int i = gainFirst[t]; i < gainFirst[t + 1]; i++) {
                int p = gainPlace[i];
                if (!implied.isImplied(p)) {
                    int at = addFirst[t];
                    while (at < end && addWord[at] != store.word[p]) {
                        at++;
                    }
                    end = Math.max(end, at + 1);
                    addWord[at] = store.word[p];
                    add[at] += (long) gain[i] << store.shift[p];
                    addHash[t] += ((long) gain[i] << store.shift[p]) * MarkingStore.factor(store.word[p]);
                }
            }
            addFirst[t + 1] = end;
        }
    }

    /** Follows a store that has been packed in another way. */
    void repack() {
        layOut();
        store.pack(tokens, words);
        hash = store.hash(words);
    }

    long bytesToRepack() {
        return 12L * gainPlace.length + 24L * store.words;
    }

    /** Goes to the marking of this number. */
    void moveTo(int number) {
        store.read(number, read);
        for (int w = 0; w < words.length; w++) {
            long different = words[w] ^ read[w];
            while (different != 0) {
                int p = store.placeAt[64 * w + Long.numberOfTrailingZeros(different)];
                int shift = store.shift[p];
                int mask = most[p];
                different &= ~((long) mask << shift);
                int count = (int) (read[w] >>> shift) & mask;
                int[] to = implied.to[p];
                for (int i = 0; i < to.length; i++) {
                    if (!isPending[to[i]]) {
                        isPending[to[i]] = true;
                        pending[pendings++] = to[i];
                    }
                    pendingGain[to[i]] += implied.weight[p][i] * (count - tokens[p]);
                }
                change(p, count);
            }
            words[w] = read[w];
        }
        while (pendings > 0) {
            int p = pending[--pendings];
            isPending[p] = false;
            if (pendingGain[p] != 0) {
                change(p, tokens[p] + pendingGain[p]);
                pendingGain[p] = 0;
            }
        }
        hash = store.hash(words);
    }

    private void change(int p, int count) {
        int before = tokens[p];
        tokens[p] = count;
        if (count > bounds[p]) {
            bounds[p] = count;
        }
        count(effects.dependentAbove(p, true, before), effects.dependentAbove(p, true, count));
        count(effects.dependentAbove(p, false, count - 1), effects.dependentAbove(p, false, before - 1));
    }

    /** Counts the needs of these dependents as met now, or as unmet if the two are the other way round. */
    private void count(int from, int to) {
        for (int d = Math.min(from, to); d < Math.max(from, to); d++) {
            int t = effects.needTransition(effects.dependent(d));
            if (from > to ? unmet[t]++ == 0 : --unmet[t] == 0) {
                enabled[t / 64] ^= 1L << t;
            }
        }
    }

    /** Fires an enabled transition into {@link #next}; returns a place whose count does not fit, or -1. */
    int fire(int t) {
        for (int i = gainFirst[t]; i < gainFirst[t + 1]; i++) {
            if (gain[i] > most[gainPlace[i]] - tokens[gainPlace[i]]) {
                return gainPlace[i];
            }
        }
        for (int w = 0; w < next.length; w++) {
            next[w] = words[w];
        }
        for (int i = addFirst[t]; i < addFirst[t + 1]; i++) {
            next[addWord[i]] += add[i];
        }
        nextHash = hash + addHash[t];
        return -1;
    }

    /** The tokens of a place after a firing, which may exceed an int. */
    long after(int t, int place) {
        for (int i = gainFirst[t]; i < gainFirst[t + 1]; i++) {
            if (gainPlace[i] == place) {
                return (long) tokens[place] + gain[i];
            }
        }
        return tokens[place];
    }
}
