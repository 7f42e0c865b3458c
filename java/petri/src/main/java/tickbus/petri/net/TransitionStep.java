package tickbus.petri.net;

/** A transition of a net that is being built, with its arcs. */
public final class TransitionStep extends NetBuilder {
    private final String transition;

    TransitionStep(NetBuilder of, String transition) {
        super(of);
        this.transition = transition;
    }

    /** The priority; the greatest fires first. */
    public TransitionStep priority(int priority) {
        transitions.computeIfPresent(transition, (key, old) -> new Transition(old.index(), key, priority, old.delay()));
        return this;
    }

    /** How long the transition must be enabled before it fires, in nanoseconds, 0 or more. */
    public TransitionStep delay(long nanos) {
        if (nanos < 0) {
            mistakes.add("transition " + transition + ": delay " + nanos + " ns; expected 0 or more");
            return this;
        }
        return delay(Delay.fixed(nanos));
    }

    /** How long the transition must be enabled before it fires. */
    public TransitionStep delay(Delay delay) {
        transitions.computeIfPresent(transition, (key, old) -> new Transition(old.index(), key, old.priority(), delay));
        return this;
    }

    /** Takes one token from each of these places. */
    public TransitionStep input(String... from) {
        for (String one : from) {
            input(one, 1);
        }
        return this;
    }

    /** Takes {@code weight} tokens from a place. */
    public TransitionStep input(String from, int weight) {
        return with(ArcKind.INPUT, from, weight);
    }

    /** Puts one token into each of these places. */
    public TransitionStep output(String... to) {
        for (String one : to) {
            output(one, 1);
        }
        return this;
    }

    /** Puts {@code weight} tokens into a place. */
    public TransitionStep output(String to, int weight) {
        return with(ArcKind.OUTPUT, to, weight);
    }

    /** Needs {@code weight} tokens in a place, and leaves them there. */
    public TransitionStep test(String of, int weight) {
        return with(ArcKind.TEST, of, weight);
    }

    /** Needs fewer than {@code weight} tokens in a place. */
    public TransitionStep inhibitor(String of, int weight) {
        return with(ArcKind.INHIBITOR, of, weight);
    }

    private TransitionStep with(ArcKind kind, String place, int weight) {
        arc(kind, place, transition, weight);
        return this;
    }
}
