package tickbus.petri.analysis;

import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.BitSet;
import java.util.Deque;
import java.util.HashSet;
import java.util.List;
import java.util.Optional;
import java.util.Set;
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
        Effects effects = net.effects();
        int transitions = net.transitions().size();
        int[] tokens = net.initialMarking().toArray();
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

    /** Fires the transition unless a place would have more tokens than an int can count; returns whether it did. */
    private boolean hasFired(int[] tokens, int t) {
        try {
            net.effects().fire(tokens, t);
            return true;
        } catch (ArithmeticException overflow) {
            return false;
        }
    }

    /** The net. */
    public PetriNet net() {
        return net;
    }

    /** True if all reachable markings were found. */
    public boolean isComplete() {
        return complete;
    }

    /** The number of markings found; all of them if {@link #isComplete}. */
    public int size() {
        return Math.min(store.size(), limit);
    }

    /** The number of firings found between the markings. */
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
        return net.marking(tokens);
    }

    /** The number of a marking; -1 if it was not found. */
    public int find(Marking marking) {
        int found = store.find(marking.toArray());
        return found < size() ? found : -1;
    }

    /** YES if the marking is reachable. */
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
        return complete ? Verdict.YES : Verdict.UNKNOWN;
    }

    /** YES if the net is bounded; an exploration can only confirm this, {@link Coverability} can also deny it. */
    public Verdict isBounded() {
        return complete ? Verdict.YES : Verdict.UNKNOWN;
    }

    /**
     * A marking in which nothing is enabled.
     *
     * @param marking the deadlock
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

    /** The numbers of all deadlocks found. */
    public List<Integer> deadlocks() {
        List<Integer> dead = new ArrayList<>();
        // If the exploration gave up, the last marking was not explored completely.
        for (int number = 0; number < firstEdge.size() - 1; number++) {
            if (firstEdge.get(number) == firstEdge.get(number + 1)) {
                dead.add(number);
            }
        }
        return dead;
    }

    /** YES if every reachable marking enables a transition. */
    public Verdict isDeadlockFree() {
        return !deadlocks().isEmpty() ? Verdict.NO : complete ? Verdict.YES : Verdict.UNKNOWN;
    }

    /** YES if the transition fires in some reachable marking. */
    public Verdict canFire(int transition) {
        return fired.get(transition) ? Verdict.YES : complete ? Verdict.NO : Verdict.UNKNOWN;
    }

    private Components components() {
        if (components == null) {
            components = new Components(store.size(), firstEdge, targets);
        }
        return components;
    }

    /** YES if the transition can fire again from every reachable marking (it is live, level 4). */
    public Verdict isLive(int transition) {
        return complete ? Verdict.of(liveTransitions().get(transition)) : Verdict.UNKNOWN;
    }

    /** YES if every transition can fire again from every reachable marking. */
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

    /** The numbers of the home states: markings reachable from every reachable one. Empty if the net has no home state. */
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

    /** YES if the initial marking is a home state. */
    public Verdict isReversible() {
        return complete ? Verdict.of(homeStates().get(0)) : Verdict.UNKNOWN;
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
        return "net " + net.name() + ": " + (complete ? size() + " markings, " + edges() + " firings"
            : "gave up at " + size() + " markings");
    }
}
