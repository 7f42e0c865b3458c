package tickbus.petri.run;

import java.time.Duration;
import java.util.ArrayList;
import java.util.List;
import tickbus.petri.net.PetriNet;

/** Binds conditions and actions to a net. An unknown name throws an {@link IllegalArgumentException} at once. */
public final class CoordinatorBuilder {
    final PetriNet net;
    final Condition[] conditions;
    /** True if the condition is an edge. */
    final boolean[] edge;
    final List<Age> ages = new ArrayList<>();
    boolean exactDelays;
    final Action[] firing;
    final Action[] entry;
    final Action[] exit;
    final Action[] continuous;
    final List<String> inputs = new ArrayList<>();
    final List<String> outputs = new ArrayList<>();
    final List<Double> failSafe = new ArrayList<>();
    InputReader reader = values -> { };
    OutputWriter writer = values -> { };
    FiringListener listener = (scan, nanos, transition, choices) -> { };
    long seed;
    int limit = 10_000;

    /** A transition waits until a place has been marked for a time. */
    record Age(int transition, int place, long nanos) {
    }

    /** A copy, which later calls do not change. */
    private CoordinatorBuilder(CoordinatorBuilder of) {
        net = of.net;
        conditions = of.conditions.clone();
        edge = of.edge.clone();
        ages.addAll(of.ages);
        exactDelays = of.exactDelays;
        firing = of.firing.clone();
        entry = of.entry.clone();
        exit = of.exit.clone();
        continuous = of.continuous.clone();
        inputs.addAll(of.inputs);
        outputs.addAll(of.outputs);
        failSafe.addAll(of.failSafe);
        reader = of.reader;
        writer = of.writer;
        listener = of.listener;
        seed = of.seed;
        limit = of.limit;
    }

    CoordinatorBuilder(PetriNet net) {
        this.net = net;
        conditions = new Condition[net.transitions().size()];
        edge = new boolean[net.transitions().size()];
        firing = new Action[net.transitions().size()];
        entry = new Action[net.places().size()];
        exit = new Action[net.places().size()];
        continuous = new Action[net.places().size()];
    }

    /** The seed of every choice and every random delay; 0 unless given. */
    public CoordinatorBuilder seed(long value) {
        seed = value;
        return this;
    }

    /** The number of firings in one scan that counts as a livelock, 1 or more; 10,000 unless given. */
    public CoordinatorBuilder limit(int firings) {
        if (firings < 1) {
            throw new IllegalArgumentException("a limit of " + firings + " firings; expected 1 or more");
        }
        limit = firings;
        return this;
    }

    /** Names inputs, in the order in which the reader fills them in. */
    public CoordinatorBuilder inputs(String... names) {
        inputs.addAll(List.of(names));
        return this;
    }

    /** Reads the inputs. */
    public CoordinatorBuilder reader(InputReader of) {
        reader = of;
        return this;
    }

    /** Names an output. The output has its fail-safe value at first, and again when the controller stops. */
    public CoordinatorBuilder output(String name, double failSafeValue) {
        outputs.add(name);
        failSafe.add(failSafeValue);
        return this;
    }

    /** Writes the outputs. */
    public CoordinatorBuilder writer(OutputWriter of) {
        writer = of;
        return this;
    }

    /** The condition of a transition; without one it is always true. */
    public CoordinatorBuilder when(String transition, Condition condition) {
        int index = net.transition(transition).index();
        conditions[index] = condition;
        edge[index] = false;
        return this;
    }

    /**
     * The condition of a transition that waits for an edge. As in Grafcet, an edge counts for the transitions that were
     * enabled when the scan began, and each of them fires once by it.
     */
    public CoordinatorBuilder whenEdge(String transition, Condition condition) {
        when(transition, condition);
        edge[net.transition(transition).index()] = true;
        return this;
    }

    /**
     * The transition also waits until a place of its net has been marked for this long, as with Grafcet's X3.T; more than 0. The
     * time begins when tokens come into the empty place, also if the transition that took the last token puts one back.
     */
    public CoordinatorBuilder whenMarked(String transition, String place, Duration atLeast) {
        if (atLeast.isNegative() || atLeast.isZero() || atLeast.compareTo(Duration.ofNanos(Long.MAX_VALUE)) > 0) {
            throw new IllegalArgumentException("place " + place + " marked for " + atLeast + "; expected more than 0, and at most 292 years");
        }
        ages.add(new Age(net.transition(transition).index(), net.place(place).index(), atLeast.toNanos()));
        return this;
    }

    /**
     * Lets delays follow each other without the gaps between scans, as in a simulation: what falls due between two scans happens
     * in the order of the due times, each moment with all that it causes before the next, and a delay that begins there begins
     * at that moment. What needs an input happens at the scan. A place may then be marked and left within one scan: its
     * outputs are never seen. The limit counts for each moment.
     */
    public CoordinatorBuilder exactDelays() {
        exactDelays = true;
        return this;
    }

    /** Runs when a transition fires, after the exit and before the entry actions. */
    public CoordinatorBuilder onFiring(String transition, Action action) {
        firing[net.transition(transition).index()] = action;
        return this;
    }

    /** Runs when a firing puts tokens into a place, and in the first scan if the place is marked initially. */
    public CoordinatorBuilder onEntry(String place, Action action) {
        entry[net.place(place).index()] = action;
        return this;
    }

    /** Runs when a firing takes tokens from a place. */
    public CoordinatorBuilder onExit(String place, Action action) {
        exit[net.place(place).index()] = action;
        return this;
    }

    /** Runs at the end of each scan in which the place is marked, in the order of the places. */
    public CoordinatorBuilder during(String place, Action action) {
        continuous[net.place(place).index()] = action;
        return this;
    }

    /** Reports the firings to a listener. */
    public CoordinatorBuilder listener(FiringListener of) {
        listener = of;
        return this;
    }

    /** A coordinator that has not scanned yet. Later bindings do not affect it. */
    public Coordinator build() {
        return new Coordinator(new CoordinatorBuilder(this));
    }
}
