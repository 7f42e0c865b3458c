package tickbus.petri.control;

import java.time.Duration;
import java.util.ArrayList;
import java.util.LinkedHashMap;
import java.util.LinkedHashSet;
import java.util.List;
import java.util.Map;
import java.util.Set;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Action;
import tickbus.petri.run.Condition;
import tickbus.petri.run.FiringListener;

/**
 * A net, and the signals that its transitions wait for and its places set.
 *
 * <pre>{@code
 * BoundNet.of(net)
 *     .when("start").on("Piece at stop").rising().off("Guard open")
 *     .during("gripping").set("Gripper")
 *     .entry("done").set("Lamp").exit("done").clear("Lamp");
 * }</pre>
 *
 * <p>{@link #on} and the like belong to the transition named last by {@link #when}, and all of them must hold; a transition
 * without {@code when} is always true. {@link #set} and {@link #run} belong to the last {@link #during}, {@link #entry},
 * {@link #exit} or {@link #firing}. The methods check nothing: {@link NetController#of} reports all mistakes at once.
 */
public final class BoundNet {
    final PetriNet net;
    final Map<String, List<Term>> conditions = new LinkedHashMap<>();
    final List<Step> steps = new ArrayList<>();
    final Set<String> declared = new LinkedHashSet<>();
    final List<String> mistakes = new ArrayList<>();
    FiringListener listener = (scan, nanos, transition, choices) -> { };
    long seed;
    boolean keepsEdges;
    boolean exactDelays;
    private List<Term> terms;
    private Step.Moment moment;
    private String node;

    private BoundNet(PetriNet net) {
        this.net = net;
    }

    /** Begins to bind a net, whose name must be unique among the nets of a controller. */
    public static BoundNet of(PetriNet net) {
        return new BoundNet(net);
    }

    /** The net. */
    public PetriNet net() {
        return net;
    }

    /** The seed of every choice and every random delay; 0 unless given. */
    public BoundNet seed(long value) {
        seed = value;
        return this;
    }

    /**
     * Lets an edge count for the whole scan. Without this, as in Grafcet, one evolution uses the edge: it counts for the
     * transitions that were enabled when the scan began, and fires each of them once.
     */
    public BoundNet keepEdges() {
        keepsEdges = true;
        return this;
    }

    /** Lets delays follow each other without the gaps between scans: see {@link tickbus.petri.run.CoordinatorBuilder#exactDelays}. */
    public BoundNet exactDelays() {
        exactDelays = true;
        return this;
    }

    /** Reports the firings to a listener. */
    public BoundNet listener(FiringListener of) {
        listener = of;
        return this;
    }

    /** Begins the condition of a transition; once per transition. */
    public BoundNet when(String transition) {
        terms = new ArrayList<>();
        if (conditions.putIfAbsent(transition, terms) != null) {
            mistakes.add("transition " + transition + ": its condition is bound twice; put all of it behind one when(...)");
        }
        return this;
    }

    /** The signal is not 0. */
    public BoundNet on(String signal) {
        return term(Term.of(Term.Kind.ON, signal, 0));
    }

    /** The signal is 0. */
    public BoundNet off(String signal) {
        return term(Term.of(Term.Kind.OFF, signal, 0));
    }

    /** The signal of the last {@link #on} has gone on with this scan: see {@link #keepEdges}. */
    public BoundNet rising() {
        return edge("rising()", Term.Kind.ON, Term.Kind.RISING);
    }

    /** The signal of the last {@link #off} has gone off with this scan. */
    public BoundNet falling() {
        return edge("falling()", Term.Kind.OFF, Term.Kind.FALLING);
    }

    /** The signal has at least this value, in its unit. */
    public BoundNet atLeast(String signal, double value) {
        return term(Term.of(Term.Kind.AT_LEAST, signal, value));
    }

    /** The signal is below this value, in its unit. */
    public BoundNet below(String signal, double value) {
        return term(Term.of(Term.Kind.BELOW, signal, value));
    }

    /** The signal has exactly this value. */
    public BoundNet is(String signal, double value) {
        return term(Term.of(Term.Kind.EQUAL, signal, value));
    }

    /** A place of this net is marked, for as long as the following {@link #atLeast(Duration)} says: Grafcet's X3.T. */
    public BoundNet marked(String place) {
        return marked(net.name(), place);
    }

    /** The place of the last {@code marked} has been marked for this long; more than 0. */
    public BoundNet atLeast(Duration time) {
        int last = terms == null ? -1 : terms.size() - 1;
        if (last < 0 || terms.get(last).kind() != Term.Kind.MARKED) {
            mistakes.add("atLeast(" + time + ") belongs to no place; write it behind marked(...)");
        } else if (time.isNegative() || time.isZero() || time.compareTo(Duration.ofNanos(Long.MAX_VALUE)) > 0) {
            mistakes.add("place " + terms.get(last).place() + " marked for at least " + time + "; expected more than 0, and at most 292 years");
        } else {
            terms.set(last, terms.get(last).since(time));
        }
        return this;
    }

    /** A place of another net of the same controller is marked. */
    public BoundNet marked(String net, String place) {
        return term(new Term(Term.Kind.MARKED, net, place, 0, null));
    }

    /** A place of another net of the same controller is not marked. */
    public BoundNet unmarked(String net, String place) {
        return term(new Term(Term.Kind.UNMARKED, net, place, 0, null));
    }

    /** A condition of your own, on all signals that this end reads. It must use the inputs alone. */
    public BoundNet that(Condition condition) {
        return term(new Term(Term.Kind.CODE, "", null, 0, condition));
    }

    /**
     * The following actions run while the place is marked; otherwise its outputs are 0. If several marked places set one
     * output, the one bound last gives its value.
     */
    public BoundNet during(String place) {
        return at(Step.Moment.DURING, place);
    }

    /** The following actions run when tokens come into the place. */
    public BoundNet entry(String place) {
        return at(Step.Moment.ENTRY, place);
    }

    /** The following actions run when tokens leave the place. */
    public BoundNet exit(String place) {
        return at(Step.Moment.EXIT, place);
    }

    /** The following actions run when the transition fires. */
    public BoundNet firing(String transition) {
        return at(Step.Moment.FIRING, transition);
    }

    /** Sets the output to 1. */
    public BoundNet set(String output) {
        return set(output, 1);
    }

    /** Sets the output to 0. */
    public BoundNet clear(String output) {
        return set(output, 0);
    }

    /** Sets the output to a value, in its unit. */
    public BoundNet set(String output, double value) {
        return step("set(\"" + output + "\")", output, value, null);
    }

    /** An action of your own, which can set the outputs that {@link #writes} names. */
    public BoundNet run(Action action) {
        return step("run(...)", null, 0, action);
    }

    /** Names outputs that your own actions set. */
    public BoundNet writes(String... outputs) {
        declared.addAll(List.of(outputs));
        return this;
    }

    /** The outputs that this net sets, including those of its own code. */
    Set<String> outputs() {
        Set<String> outputs = new LinkedHashSet<>(declared);
        steps.stream().filter(step -> step.output() != null).forEach(step -> outputs.add(step.output()));
        return outputs;
    }

    private BoundNet term(Term term) {
        if (terms == null) {
            mistakes.add("a condition on '" + term.name() + "' belongs to no transition; call when(...) before it");
        } else {
            terms.add(term);
        }
        return this;
    }

    private BoundNet edge(String call, Term.Kind level, Term.Kind edge) {
        int last = terms == null ? -1 : terms.size() - 1;
        if (last < 0 || terms.get(last).kind() != level) {
            mistakes.add(call + " belongs to no signal; write it behind " + (level == Term.Kind.ON ? "on(...)" : "off(...)"));
        } else {
            terms.set(last, terms.get(last).as(edge));
        }
        return this;
    }

    private BoundNet at(Step.Moment when, String name) {
        moment = when;
        node = name;
        return this;
    }

    private BoundNet step(String call, String output, double value, Action code) {
        if (moment == null) {
            mistakes.add(call + " belongs to no place; call during(...), entry(...), exit(...) or firing(...) before it");
        } else {
            steps.add(new Step(moment, node, output, value, code));
        }
        return this;
    }
}
