package tickbus.petri;

import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.BitSet;
import java.util.Deque;
import java.util.HashSet;
import java.util.List;
import java.util.Optional;
import java.util.Set;

/**
 * The reachable markings of a net, breadth first, up to a limit. Delays, priorities and conditions are left out: they
 * only take firings away. So what is bounded here is bounded in a controller; a deadlock or dead transition here may be
 * another one there.
 *
 * <p>If it gave up, answers that need all markings are {@link Verdict#UNKNOWN}. Markings are numbered from 0, the
 * initial one, in the order of their distance from it.
 */
public final class Reachability {
    private final PetriNet net;
    private final MarkingStore store;
    private final Ints firstEdge = new Ints();
    private final Ints targets = new Ints();
    private final Ints labels = new Ints();
    /** The edge by which each marking was found. */
    private final Ints parentEdge = new Ints();
    private final int[] bounds;
    private final BitSet fired = new BitSet();
    private final int limit;
    private boolean complete;
    private Components components;

    private Reachability(PetriNet net, int limit) {
        this.net = net;
        this.limit = limit;
        store = new MarkingStore(net.places().size());
        bounds = new int[net.places().size()];
    }

    /** Explores at most {@code limit} markings, 1 or more, and fewer if the heap has no room for them. */
    public static Reachability explore(PetriNet net, int limit) {
        if (limit < 1) {
            throw new IllegalArgumentException("a limit of " + limit + " markings; expected 1 or more");
        }
        Reachability graph = new Reachability(net, limit);
        graph.run();
        return graph;
    }

    private void run() {
        Effects effects = net.effects;
        int transitions = net.transitions().size();
        int[] tokens = net.initialMarking().tokens;
        int[] next = new int[tokens.length];
        store.add(tokens);
        parentEdge.add(-1);
        for (int number = 0; number < store.size(); number++) {
            store.get(number, tokens);
            for (int p = 0; p < tokens.length; p++) {
                bounds[p] = Math.max(bounds[p], tokens[p]);
            }
            firstEdge.add(targets.size());
            for (int t = 0; t < transitions; t++) {
                if (!effects.isEnabled(tokens, t)) {
                    continue;
                }
                System.arraycopy(tokens, 0, next, 0, tokens.length);
                if (!hasFired(next, t)) {
                    return;
                }
                fired.set(t);
                int before = store.size();
                long more = store.bytesToGrow() + targets.bytesToGrow() + labels.bytesToGrow() + parentEdge.bytesToGrow()
                    + firstEdge.bytesToGrow();
                if (more > 0 && !Memory.has(bytes() + more)) {
                    return;
                }
                int target = store.add(next);
                if (target == before) {
                    if (before == limit) {
                        return;
                    }
                    parentEdge.add(targets.size());
                }
                targets.add(target);
                labels.add(t);
            }
        }
        firstEdge.add(targets.size());
        complete = true;
    }

    /** Fires, unless a place would have more tokens than an int can count. */
    private boolean hasFired(int[] tokens, int t) {
        try {
            net.effects.fire(tokens, t);
            return true;
        } catch (ArithmeticException overflow) {
            return false;
        }
    }

    /** The net. */
    public PetriNet net() {
        return net;
    }

    /** Whether all reachable markings were found. */
    public boolean isComplete() {
        return complete;
    }

    /** How many markings were found; with {@link #isComplete} that is all. */
    public int size() {
        return Math.min(store.size(), limit);
    }

    /** How many firings between them were found. */
    public int edges() {
        return targets.size();
    }

    /** The bytes in which markings and firings are kept. */
    public long bytes() {
        return store.bytes() + firstEdge.bytes() + targets.bytes() + labels.bytes() + parentEdge.bytes();
    }

    /** The marking with this number. */
    public Marking marking(int number) {
        int[] tokens = new int[net.places().size()];
        store.get(number, tokens);
        return new Marking(net, tokens);
    }

    /** The number of a marking; -1 if it was not found. */
    public int find(Marking marking) {
        int found = store.find(marking.tokens);
        return found < size() ? found : -1;
    }

    /** Whether the marking is reachable. */
    public Verdict isReachable(Marking marking) {
        return find(marking) >= 0 ? Verdict.YES : complete ? Verdict.NO : Verdict.UNKNOWN;
    }

    /** A shortest sequence of transitions, by index, that leads from the initial marking to the one of this number. */
    public int[] path(int number) {
        Deque<Integer> reversed = new ArrayDeque<>();
        int at = number;
        while (parentEdge.get(at) >= 0) {
            int edge = parentEdge.get(at);
            reversed.push(labels.get(edge));
            at = source(edge);
        }
        return reversed.stream().mapToInt(Integer::intValue).toArray();
    }

    private int source(int edge) {
        int low = 0;
        int high = firstEdge.size() - 1;
        while (low < high) {
            int middle = (low + high + 1) >>> 1;
            if (firstEdge.get(middle) <= edge) {
                low = middle;
            } else {
                high = middle - 1;
            }
        }
        return low;
    }

    /** The most tokens that a place has had in the markings that were found. */
    public int bound(int place) {
        return bounds[place];
    }

    /** Whether no place ever has more than one token. */
    public Verdict isSafe() {
        for (int bound : bounds) {
            if (bound > 1) {
                return Verdict.NO;
            }
        }
        return complete ? Verdict.YES : Verdict.UNKNOWN;
    }

    /** Whether the net is bounded; an exploration can only confirm it, {@link Coverability} also denies it. */
    public Verdict isBounded() {
        return complete ? Verdict.YES : Verdict.UNKNOWN;
    }

    /**
     * A marking in which nothing is enabled.
     *
     * @param marking it
     * @param firings a shortest sequence of transitions that leads there, by name
     */
    public record Deadlock(Marking marking, List<String> firings) {
    }

    /** The nearest deadlock; empty if none was found. */
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

    /** The numbers of all deadlocks that were found. */
    public List<Integer> deadlocks() {
        List<Integer> dead = new ArrayList<>();
        // Where it gave up, the last marking was not looked at to the end.
        for (int number = 0; number < firstEdge.size() - 1; number++) {
            if (firstEdge.get(number) == firstEdge.get(number + 1)) {
                dead.add(number);
            }
        }
        return dead;
    }

    /** Whether something is enabled in every reachable marking. */
    public Verdict isDeadlockFree() {
        return !deadlocks().isEmpty() ? Verdict.NO : complete ? Verdict.YES : Verdict.UNKNOWN;
    }

    /** Whether the transition fires in some reachable marking. */
    public Verdict canFire(int transition) {
        return fired.get(transition) ? Verdict.YES : complete ? Verdict.NO : Verdict.UNKNOWN;
    }

    private Components components() {
        if (components == null) {
            components = new Components(store.size(), firstEdge, targets);
        }
        return components;
    }

    /** Whether the transition can fire again from every reachable marking (it is live, level 4). */
    public Verdict isLive(int transition) {
        return complete ? Verdict.of(liveTransitions().get(transition)) : Verdict.UNKNOWN;
    }

    /** Whether every transition can fire again from every reachable marking. */
    public Verdict isLive() {
        return complete ? Verdict.of(liveTransitions().cardinality() == net.transitions().size()) : Verdict.UNKNOWN;
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

    /** The numbers of the home states: markings that can be reached from every reachable one. Empty if there is none. */
    public BitSet homeStates() {
        if (!complete) {
            throw new GaveUpException(this + "; home states need all of them");
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

    /** Whether the initial marking is a home state. */
    public Verdict isReversible() {
        return complete ? Verdict.of(homeStates().get(0)) : Verdict.UNKNOWN;
    }

    /** The conflicts that were seen to happen, each ordered pair once. */
    public List<Conflicts.Effective> effectiveConflicts() {
        List<Conflicts.Effective> found = new ArrayList<>();
        Set<Long> seen = new HashSet<>();
        List<Conflicts.Pair> pairs = Conflicts.structural(net);
        int[] tokens = new int[net.places().size()];
        int[] next = new int[tokens.length];
        for (int number = 0; number < size() && seen.size() < 2 * pairs.size(); number++) {
            store.get(number, tokens);
            for (Conflicts.Pair pair : pairs) {
                if (net.effects.isEnabled(tokens, pair.first()) && net.effects.isEnabled(tokens, pair.second())) {
                    for (int side = 0; side < 2; side++) {
                        int fires = side == 0 ? pair.first() : pair.second();
                        int other = side == 0 ? pair.second() : pair.first();
                        System.arraycopy(tokens, 0, next, 0, tokens.length);
                        if (!hasFired(next, fires)) {
                            continue;
                        }
                        if (!net.effects.isEnabled(next, other) && seen.add((long) fires << 32 | other)) {
                            found.add(new Conflicts.Effective(fires, other, marking(number)));
                        }
                    }
                }
            }
        }
        return found;
    }

    /** How far it came. */
    @Override
    public String toString() {
        return "net " + net.name() + ": " + (complete ? size() + " markings, " + edges() + " firings"
            : "gave up at " + size() + " markings");
    }
}
