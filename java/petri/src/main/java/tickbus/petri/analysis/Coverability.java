package tickbus.petri.analysis;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.BitSet;
import java.util.HashMap;
import java.util.List;
import java.util.Map;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Effects;
import tickbus.petri.net.Marking;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;

/**
 * The coverability graph of Karp and Miller: which places can grow without bound, and which markings can be covered. The
 * graph is finite for every net but can be huge, so there is a limit. Delays, priorities and conditions are left out.
 *
 * <p>Internally, places with a capacity get a complement, and inhibitor arcs on them become tests of the complement. An
 * inhibitor arc on a place without a capacity throws an {@link UnsupportedOperationException}, because the questions are
 * undecidable for such nets; give the place a capacity, or use {@link Reachability}.
 */
public final class Coverability {
    /** No bound: for any number there is a reachable marking with more tokens than that. */
    public static final int OMEGA = Integer.MAX_VALUE;

    /** For each marking, in addition to its tokens: array, key, entry and slot of the map. */
    private static final long BYTES_BESIDE = 120;

    /** Comparisons of tokens with those of ancestors: some seconds. */
    private static final long MOST_COMPARISONS = 5_000_000_000L;

    private final PetriNet net;
    private final PetriNet plain;
    private final int limit;
    private final List<int[]> markings = new ArrayList<>();
    private final Ints parents = new Ints();
    private final int[] bounds;
    private final BitSet fired = new BitSet();
    private long comparisons;
    private boolean complete;

    private Coverability(PetriNet net, int limit) {
        this.net = net;
        this.limit = limit;
        plain = withComplements(net);
        bounds = new int[net.places().size()];
    }

    /** Explores at most {@code limit} markings with or without omega, 1 or more; fewer if that takes too much memory or time. */
    public static Coverability explore(PetriNet net, int limit) {
        if (limit < 1) {
            throw new IllegalArgumentException("a limit of " + limit + " markings; expected 1 or more");
        }
        Coverability graph = new Coverability(net, limit);
        try {
            graph.run();
        } catch (OutOfMemoryError full) {
            graph.complete = false;
        }
        return graph;
    }

    /** The same net without capacities and inhibitor arcs, the complements after the places. */
    private static PetriNet withComplements(PetriNet net) {
        NetBuilder builder = PetriNet.named(net.name());
        net.places().forEach(place -> builder.place("p" + place.index(), place.initial()));
        for (Place place : net.places()) {
            if (place.isLimited()) {
                builder.place("c" + place.index(), place.capacity() - place.initial());
            }
        }
        net.transitions().forEach(transition -> builder.transition("t" + transition.index()));
        for (Arc arc : net.arcs()) {
            Place place = net.place(arc.place());
            if (arc.kind() == ArcKind.INHIBITOR) {
                if (!place.isLimited()) {
                    throw new UnsupportedOperationException("net " + net.name() + ": inhibitor arc " + place.name() + " -> "
                        + net.transition(arc.transition()).name() + ": coverability is undecidable with inhibitor arcs on "
                        + "places without a capacity; give " + place.name() + " one, or explore with Reachability");
                }
                // Fewer than w tokens in the place are at least K - w + 1 in the complement.
                int needed = place.capacity() - arc.weight() + 1;
                if (needed > 0) {
                    builder.arc(ArcKind.TEST, "c" + arc.place(), "t" + arc.transition(), needed);
                }
            } else {
                builder.arc(arc.kind(), "p" + arc.place(), "t" + arc.transition(), arc.weight());
            }
        }
        Effects effects = net.effects();
        for (int t = 0; t < net.transitions().size(); t++) {
            for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
                int p = effects.changePlace(i);
                int gain = effects.puts(i) - effects.takes(i);
                if (gain != 0 && net.place(p).isLimited()) {
                    builder.arc(gain > 0 ? ArcKind.INPUT : ArcKind.OUTPUT, "c" + p, "t" + t, Math.abs(gain));
                }
            }
        }
        return builder.build();
    }

    private void run() {
        Map<Key, Integer> numbers = new HashMap<>();
        if (Arrays.stream(plain.initialMarking().toArray()).anyMatch(count -> count == OMEGA)) {
            throw new GaveUpException("net " + net.name() + ": gave up at the initial marking: a place has " + OMEGA
                + " tokens, as many as can be counted");
        }
        add(plain.initialMarking().toArray(), -1, numbers);
        for (int number = 0; number < markings.size(); number++) {
            int[] tokens = markings.get(number);
            for (int t = 0; t < plain.transitions().size(); t++) {
                if (!plain.effects().isEnabled(tokens, t)) {
                    continue;
                }
                fired.set(t);
                int[] next = fire(tokens, t);
                accelerate(next, number);
                if (!numbers.containsKey(new Key(next))) {
                    if (markings.size() == limit || comparisons > MOST_COMPARISONS
                            || !Memory.has(markings.size() * (4L * next.length + BYTES_BESIDE))) {
                        return;
                    }
                    add(next, number, numbers);
                }
            }
        }
        complete = true;
    }

    private record Key(int[] tokens) {
        @Override
        public boolean equals(Object other) {
            return other instanceof Key that && Arrays.equals(tokens, that.tokens);
        }

        @Override
        public int hashCode() {
            return Arrays.hashCode(tokens);
        }
    }

    private void add(int[] tokens, int parent, Map<Key, Integer> numbers) {
        numbers.put(new Key(tokens), markings.size());
        markings.add(tokens);
        parents.add(parent);
        for (int p = 0; p < bounds.length; p++) {
            bounds[p] = Math.max(bounds[p], tokens[p]);
        }
    }

    private int[] fire(int[] tokens, int t) {
        int[] next = tokens.clone();
        Effects effects = plain.effects();
        for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
            int p = effects.changePlace(i);
            if (tokens[p] != OMEGA) {
                long count = (long) tokens[p] - effects.takes(i) + effects.puts(i);
                if (count >= OMEGA) {
                    throw new GaveUpException("net " + net.name() + ": gave up at " + markings.size()
                        + " markings: a place would have more than " + OMEGA + " tokens");
                }
                next[p] = (int) count;
            }
        }
        return next;
    }

    /** If an ancestor has fewer tokens everywhere, the places that have grown since can grow without bound. */
    private void accelerate(int[] tokens, int parent) {
        boolean grown = true;
        while (grown) {
            grown = false;
            for (int a = parent; a >= 0; a = parents.get(a)) {
                int[] ancestor = markings.get(a);
                int higher = firstAbove(ancestor, tokens);
                comparisons += higher;
                if (higher == tokens.length) {
                    for (int p = 0; p < tokens.length; p++) {
                        if (ancestor[p] < tokens[p] && tokens[p] != OMEGA) {
                            tokens[p] = OMEGA;
                            grown = true;
                        }
                    }
                }
            }
        }
    }

    /** The first place with more tokens than in the other marking; the number of places if no place has. */
    private static int firstAbove(int[] tokens, int[] other) {
        int p = 0;
        while (p < tokens.length && tokens[p] <= other[p]) {
            p++;
        }
        return p;
    }

    /** True if the exploration was finished. */
    public boolean isComplete() {
        return complete;
    }

    /** The number of markings, with or without omega. */
    public int size() {
        return markings.size();
    }

    /** The tokens of a marking, with {@link #OMEGA} for a place without a bound. */
    public int[] tokens(int number) {
        return Arrays.copyOf(markings.get(number), net.places().size());
    }

    /**
     * The most tokens that a place can have; {@link #OMEGA} if there is no bound. If the exploration gave up, of the
     * explored part.
     */
    public int bound(int place) {
        return bounds[place];
    }

    /** YES if the tokens of every place are bounded. */
    public Verdict isBounded() {
        return Arrays.stream(bounds).anyMatch(bound -> bound == OMEGA) ? Verdict.NO
            : complete ? Verdict.YES : Verdict.UNKNOWN;
    }

    /** YES if no place ever has more than one token. */
    public Verdict isSafe() {
        return Arrays.stream(bounds).anyMatch(bound -> bound > 1) ? Verdict.NO : complete ? Verdict.YES : Verdict.UNKNOWN;
    }

    /** YES if a reachable marking has at least these tokens everywhere. */
    public Verdict isCoverable(Marking marking) {
        for (int number = 0; number < markings.size(); number++) {
            if (firstAbove(marking.toArray(), tokens(number)) == net.places().size()) {
                return Verdict.YES;
            }
        }
        return complete ? Verdict.NO : Verdict.UNKNOWN;
    }

    /** YES if the transition fires in some reachable marking. */
    public Verdict canFire(int transition) {
        return fired.get(transition) ? Verdict.YES : complete ? Verdict.NO : Verdict.UNKNOWN;
    }

    /** The extent of the exploration. */
    @Override
    public String toString() {
        return "net " + net.name() + ": " + (complete ? "" : "gave up at ") + size() + " markings";
    }
}
