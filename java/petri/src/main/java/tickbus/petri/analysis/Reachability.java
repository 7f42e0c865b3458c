package tickbus.petri.analysis;

import java.util.ArrayList;
import java.util.BitSet;
import java.util.HashSet;
import java.util.List;
import java.util.Optional;
import java.util.Set;
import java.util.stream.IntStream;
import tickbus.petri.net.Effects;
import tickbus.petri.net.Marking;
import tickbus.petri.net.PetriNet;

/**
 * The reachable markings of a net, breadth first, up to a limit. Delays, priorities and conditions are left out: they only
 * prevent firings. So a net that is bounded here is bounded in a controller; deadlocks and dead transitions can differ
 * there.
 *
 * <p>If the exploration gave up, answers that need all markings are {@link Verdict#UNKNOWN}. Markings are numbered from 0,
 * the initial one, in the order of their distance from it.
 */
public final class Reachability {
    private final PetriNet net;
    private final MarkingStore store;
    /** The first edge of each marking; empty without firings. */
    private final Ints firstEdge;
    private final Ints targets;
    private final Ints labels;
    private final Ints deadlocks;
    private final int[] bounds;
    private final BitSet fired;
    private final long edges;
    private final boolean firings;
    private final boolean reduced;
    private final String gaveUp;
    /** True if all reachable markings are here. */
    private final boolean whole;
    private Components components;

    Reachability(PetriNet net, MarkingStore store, Ints firstEdge, Ints targets, Ints labels, Ints deadlocks, int[] bounds,
            BitSet fired, long edges, boolean firings, boolean reduced, String gaveUp) {
        this.net = net;
        this.store = store;
        this.firstEdge = firstEdge;
        this.targets = targets;
        this.labels = labels;
        this.deadlocks = deadlocks;
        this.bounds = bounds;
        this.fired = fired;
        this.edges = edges;
        this.firings = firings;
        this.reduced = reduced;
        this.gaveUp = gaveUp;
        whole = gaveUp == null && !reduced;
    }

    /**
     * Explores at most {@code limit} markings, 1 or more, and fewer if the heap has no room for them. {@link Exploration} has
     * further limits, and explorations that keep less.
     */
    public static Reachability explore(PetriNet net, int limit) {
        return Exploration.of(net).markings(limit).run();
    }

    /** The net. */
    public PetriNet net() {
        return net;
    }

    /** True if the exploration came to its end: all reachable markings were found, or those that the deadlocks need. */
    public boolean isComplete() {
        return gaveUp == null;
    }

    /** The limit at which the exploration gave up; empty if it came to its end. */
    public Optional<String> gaveUpBecause() {
        return Optional.ofNullable(gaveUp);
    }

    /** The number of markings found. */
    public int size() {
        return store.size();
    }

    /** The number of firings found between the markings, also if they were not kept. */
    public long edges() {
        return edges;
    }

    /** The bytes in which markings and firings are kept. */
    public long bytes() {
        return store.bytes() + firstEdge.bytes() + targets.bytes() + labels.bytes() + deadlocks.bytes();
    }

    /** The marking with this number. */
    public Marking marking(int number) {
        int[] tokens = new int[net.places().size()];
        store.get(number, tokens);
        return net.marking(tokens);
    }

    /** The number of a marking; -1 if it was not found. */
    public int find(Marking marking) {
        return store.find(marking.toArray());
    }

    /** YES if the marking is reachable. */
    public Verdict isReachable(Marking marking) {
        return find(marking) >= 0 ? Verdict.YES : whole ? Verdict.NO : Verdict.UNKNOWN;
    }

    /**
     * A sequence of transitions, by index, that leads from the initial marking to the one of this number; a shortest one, unless
     * the exploration was only for deadlocks.
     */
    public int[] path(int number) {
        Ints reversed = new Ints();
        int[] tokens = new int[net.places().size()];
        int at = number;
        while (at > 0) {
            store.get(at, tokens);
            // The first marking that leads here is one that the exploration came from.
            int first = at;
            int by = -1;
            for (int t = 0; t < net.transitions().size(); t++) {
                int before = before(tokens, t);
                if (before >= 0 && before < first) {
                    first = before;
                    by = t;
                }
            }
            reversed.add(by);
            at = first;
        }
        int[] path = new int[reversed.size()];
        for (int i = 0; i < path.length; i++) {
            path[i] = reversed.get(path.length - 1 - i);
        }
        return path;
    }

    /** The number of the marking from which the transition leads to these tokens; -1 if it was not found. */
    private int before(int[] tokens, int t) {
        Effects effects = net.effects();
        int[] before = tokens.clone();
        for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
            int p = effects.changePlace(i);
            before[p] -= effects.puts(i) - effects.takes(i);
            if (before[p] < 0) {
                return -1;
            }
        }
        return effects.isEnabled(before, t) ? store.find(before) : -1;
    }

    /** The most tokens of a place in the markings found. */
    public int bound(int place) {
        return bounds[place];
    }

    /** YES if no place ever has more than one token. */
    public Verdict isSafe() {
        for (int bound : bounds) {
            if (bound > 1) {
                return Verdict.NO;
            }
        }
        return whole ? Verdict.YES : Verdict.UNKNOWN;
    }

    /** YES if the net is bounded; an exploration can only confirm this, {@link Coverability} can also deny it. */
    public Verdict isBounded() {
        return whole ? Verdict.YES : Verdict.UNKNOWN;
    }

    /**
     * A marking in which nothing is enabled.
     *
     * @param marking the deadlock
     * @param firings the sequence of transitions that leads there, by name: {@link #path}
     */
    public record Deadlock(Marking marking, List<String> firings) {
    }

    /**
     * The deadlock that was found first; a nearest one, unless the exploration was only for deadlocks. Empty if none was found.
     */
    public Optional<Deadlock> deadlock() {
        for (int number : deadlocks()) {
            List<String> names = new ArrayList<>();
            for (int t : path(number)) {
                names.add(net.transition(t).name());
            }
            return Optional.of(new Deadlock(marking(number), names));
        }
        return Optional.empty();
    }

    /** The numbers of all deadlocks found. */
    public List<Integer> deadlocks() {
        return IntStream.of(deadlocks.toArray()).boxed().toList();
    }

    /** YES if every reachable marking enables a transition. */
    public Verdict isDeadlockFree() {
        return !deadlocks().isEmpty() ? Verdict.NO : isComplete() ? Verdict.YES : Verdict.UNKNOWN;
    }

    /** YES if the transition fires in some reachable marking. */
    public Verdict canFire(int transition) {
        return fired.get(transition) ? Verdict.YES : whole ? Verdict.NO : Verdict.UNKNOWN;
    }

    private Components components() {
        if (components == null) {
            components = new Components(store.size(), firstEdge, targets);
        }
        return components;
    }

    /** YES if the transition can fire again from every reachable marking (it is live, level 4). */
    public Verdict isLive(int transition) {
        return whole && firings ? Verdict.of(liveTransitions().get(transition)) : Verdict.UNKNOWN;
    }

    /** YES if every transition can fire again from every reachable marking. */
    public Verdict isLive() {
        return whole && firings ? Verdict.of(liveTransitions().cardinality() == net.transitions().size()) : Verdict.UNKNOWN;
    }

    /** A transition is live if each terminal component has it. */
    private BitSet liveTransitions() {
        Components parts = components();
        BitSet[] within = new BitSet[parts.count];
        for (int number = 0; number < store.size(); number++) {
            int part = parts.of[number];
            if (parts.terminal[part]) {
                within[part] = within[part] == null ? new BitSet() : within[part];
                for (int e = firstEdge.get(number); e < firstEdge.get(number + 1); e++) {
                    within[part].set(labels.get(e));
                }
            }
        }
        BitSet live = new BitSet();
        live.set(0, net.transitions().size());
        for (BitSet one : within) {
            if (one != null) {
                live.and(one);
            }
        }
        return live;
    }

    /** The numbers of the home states: markings reachable from every reachable one. Empty if the net has no home state. */
    public BitSet homeStates() {
        if (!whole || !firings) {
            throw new GaveUpException(this + "; home states need all of them, with their firings");
        }
        Components parts = components();
        BitSet home = new BitSet();
        int terminal = -1;
        for (int part = 0; part < parts.count; part++) {
            if (parts.terminal[part]) {
                if (terminal >= 0) {
                    return home;
                }
                terminal = part;
            }
        }
        for (int number = 0; number < store.size(); number++) {
            if (parts.of[number] == terminal) {
                home.set(number);
            }
        }
        return home;
    }

    /** YES if the initial marking is a home state. */
    public Verdict isReversible() {
        return whole && firings ? Verdict.of(homeStates().get(0)) : Verdict.UNKNOWN;
    }

    /** Fires the transition unless a place would have more tokens than an int can count; returns whether it did. */
    private boolean hasFired(int[] tokens, int t) {
        try {
            net.effects().fire(tokens, t);
            return true;
        } catch (ArithmeticException overflow) {
            return false;
        }
    }

    /** The effective conflicts found, each ordered pair once. */
    public List<Conflicts.Effective> effectiveConflicts() {
        List<Conflicts.Effective> found = new ArrayList<>();
        Set<Long> seen = new HashSet<>();
        List<Conflicts.Pair> pairs = Conflicts.structural(net);
        int[] tokens = new int[net.places().size()];
        int[] next = new int[tokens.length];
        for (int number = 0; number < size() && seen.size() < 2 * pairs.size(); number++) {
            store.get(number, tokens);
            for (Conflicts.Pair pair : pairs) {
                if (net.effects().isEnabled(tokens, pair.first()) && net.effects().isEnabled(tokens, pair.second())) {
                    for (int side = 0; side < 2; side++) {
                        int fires = side == 0 ? pair.first() : pair.second();
                        int other = side == 0 ? pair.second() : pair.first();
                        System.arraycopy(tokens, 0, next, 0, tokens.length);
                        if (!hasFired(next, fires)) {
                            continue;
                        }
                        if (!net.effects().isEnabled(next, other) && seen.add((long) fires << 32 | other)) {
                            found.add(new Conflicts.Effective(fires, other, marking(number)));
                        }
                    }
                }
            }
        }
        return found;
    }

    /** The extent of the exploration. */
    @Override
    public String toString() {
        return "net " + net.name() + ": " + (gaveUp == null ? size() + " markings, " + edges + " firings"
            + (reduced ? ", as far as deadlocks need" : "") : "gave up at " + size() + " markings");
    }
}
