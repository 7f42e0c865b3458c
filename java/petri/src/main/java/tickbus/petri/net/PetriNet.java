package tickbus.petri.net;

import java.util.Arrays;
import java.util.Comparator;
import java.util.HashMap;
import java.util.List;
import java.util.Map;
import java.util.Optional;

/**
 * A net of places and transitions with weighted, test and inhibitor arcs. Immutable and thread-safe.
 *
 * <p>A transition is enabled if each input and test arc finds at least its weight of tokens, each inhibitor arc fewer,
 * and if no place would hold more than its capacity after the firing. A place that is both input and output of a
 * transition counts with the difference. Only the {@link tickbus.petri.run.Coordinator} uses priorities and delays.
 */
public final class PetriNet {
    private final String name;
    private final List<Place> places;
    private final List<Transition> transitions;
    private final List<Arc> arcs;
    private final Map<String, Integer> placesByName = new HashMap<>();
    private final Map<String, Integer> transitionsByName = new HashMap<>();
    private final Effects effects;
    /** Null if the net comes from no file, or the file has no positions. */
    private final Positions positions;

    PetriNet(String name, List<Place> places, List<Transition> transitions, List<Arc> arcs, Positions positions) {
        this.name = name;
        this.places = places;
        this.transitions = transitions;
        this.positions = positions;
        this.arcs = arcs.stream()
            .sorted(Comparator.comparingInt(Arc::transition).thenComparing(Arc::kind).thenComparingInt(Arc::place))
            .toList();
        places.forEach(place -> placesByName.put(place.name(), place.index()));
        transitions.forEach(transition -> transitionsByName.put(transition.name(), transition.index()));
        effects = new Effects(places, transitions.size(), this.arcs);
    }

    /** Starts a net with this name. */
    public static NetBuilder named(String name) {
        return new NetBuilder(name);
    }

    /**
     * A net from its matrices of input and output weights; row = place ({@code P0}, {@code P1}, …), column = transition
     * ({@code T0}, …).
     */
    public static PetriNet fromMatrices(String name, int[][] pre, int[][] post, int[] marking) {
        return Matrices.net(name, pre, post, marking);
    }

    /**
     * A net from its incidence matrix, output minus input weights; row = place, column = transition. Only a pure net is
     * complete in this matrix: a place that is both input and output of one transition loses arcs.
     */
    public static PetriNet fromIncidence(String name, int[][] incidence, int[] marking) {
        return Matrices.net(name, Matrices.positive(incidence, -1), Matrices.positive(incidence, 1), marking);
    }

    /** The net's name. */
    public String name() {
        return name;
    }

    /** The net's places, by index. */
    public List<Place> places() {
        return places;
    }

    /** The net's transitions, by index. */
    public List<Transition> transitions() {
        return transitions;
    }

    /** All arcs, ordered by transition, kind and place. */
    public List<Arc> arcs() {
        return arcs;
    }

    /** The needs and changes of each transition, in the order of its places. */
    public Effects effects() {
        return effects;
    }

    /** The positions in the net's file; empty if the net comes from no file, or not all of its nodes have a position there. */
    public Optional<Positions> positions() {
        return Optional.ofNullable(positions);
    }

    /** The place with this index. */
    public Place place(int index) {
        return places.get(index);
    }

    /** The transition with this index. */
    public Transition transition(int index) {
        return transitions.get(index);
    }

    /** The place with this name; if there is no such place, an {@link IllegalArgumentException} lists all places. */
    public Place place(String named) {
        return places.get(find("place", named, placesByName));
    }

    /**
     * The transition with this name; if there is no such transition, an {@link IllegalArgumentException} lists all
     * transitions.
     */
    public Transition transition(String named) {
        return transitions.get(find("transition", named, transitionsByName));
    }

    private int find(String kind, String named, Map<String, Integer> index) {
        Integer found = index.get(named);
        if (found == null) {
            throw new IllegalArgumentException("net " + name + ": there is no " + kind + " '" + named + "'; there are "
                + index.keySet().stream().sorted().limit(20).toList());
        }
        return found;
    }

    /** The initial marking, as a copy. */
    public Marking initialMarking() {
        return new Marking(this, places.stream().mapToInt(Place::initial).toArray());
    }

    /** A marking with these tokens, one figure per place; a figure out of range throws an {@link IllegalArgumentException}. */
    public Marking marking(int... tokens) {
        if (tokens.length != places.size()) {
            throw new IllegalArgumentException("net " + name + ": a marking of " + tokens.length
                + " places; expected " + places.size());
        }
        for (int p = 0; p < tokens.length; p++) {
            checkTokens(p, tokens[p]);
        }
        return new Marking(this, tokens.clone());
    }

    void checkTokens(int place, int count) {
        Place one = places.get(place);
        if (count < 0 || count > one.capacity()) {
            throw new IllegalArgumentException("net " + name + ": place " + one.name() + ": " + count
                + " tokens; expected 0 to " + one.capacity());
        }
    }

    /** True if the transition is enabled, apart from time, priority and conditions. */
    public boolean isEnabled(Marking marking, int transition) {
        return effects.isEnabled(marking.tokens, transition);
    }

    /** Fires a transition; throws an {@link IllegalStateException} if it is not enabled. */
    public void fire(Marking marking, int transition) {
        if (!isEnabled(marking, transition)) {
            throw new IllegalStateException("net " + name + ": transition " + transition(transition).name()
                + " is not enabled in " + marking);
        }
        try {
            effects.fire(marking.tokens, transition);
        } catch (ArithmeticException overflow) {
            throw new IllegalStateException("net " + name + ": transition " + transition(transition).name()
                + " would put more than " + Integer.MAX_VALUE + " tokens into a place", overflow);
        }
    }

    /** The weights of the input arcs; row = place, column = transition. */
    public int[][] pre() {
        return matrix(ArcKind.INPUT);
    }

    /** The weights of the output arcs; row = place, column = transition. */
    public int[][] post() {
        return matrix(ArcKind.OUTPUT);
    }

    /** The incidence matrix, output minus input weights; row = place, column = transition. */
    public int[][] incidence() {
        int[][] incidence = post();
        int[][] pre = pre();
        for (int p = 0; p < pre.length; p++) {
            for (int t = 0; t < pre[p].length; t++) {
                incidence[p][t] -= pre[p][t];
            }
        }
        return incidence;
    }

    private int[][] matrix(ArcKind kind) {
        int[][] matrix = new int[places.size()][transitions.size()];
        for (Arc arc : arcs) {
            if (arc.kind() == kind) {
                matrix[arc.place()][arc.transition()] = arc.weight();
            }
        }
        return matrix;
    }

    /** True if the other net has the same places, transitions and arcs; the names of the nets can differ. */
    public boolean isSameAs(PetriNet other) {
        return places.equals(other.places) && transitions.equals(other.transitions) && arcs.equals(other.arcs);
    }

    /** The net's name and size. */
    @Override
    public String toString() {
        return "net " + name + ": " + places.size() + " places, " + transitions.size() + " transitions, "
            + arcs.size() + " arcs, " + Arrays.toString(initialMarking().tokens);
    }
}
