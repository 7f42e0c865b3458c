package tickbus.petri.run;

import java.util.List;
import java.util.Optional;
import java.util.Set;
import java.util.TreeSet;
import java.util.concurrent.atomic.AtomicReference;
import tickbus.petri.analysis.Conflicts;
import tickbus.petri.net.Delay;
import tickbus.petri.net.Effects;
import tickbus.petri.net.Marking;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Transition;

/**
 * Runs a net as a control program, one {@link #scan} after the other.
 *
 * <p>A scan reads the inputs once. Then it fires until no transition is enabled, due and true: conditions are tested before
 * a transition is chosen, so a false one starves nobody. The greatest priority fires first, and among equal priorities the
 * one that was due first. Among ready transitions that are in conflict and equal in both, chance decides, by a seed; others
 * fire in the order of the net. Then the scan runs the continuous actions of the marked places and writes the outputs. The
 * same seed, times and inputs give the same firings. A scan allocates nothing in the steady state.
 *
 * <p>If something throws, or if the net does not come to rest, the controller stops for good with its outputs at their
 * fail-safe values, and {@link #stop} says why. Not thread-safe.
 */
public final class Coordinator implements RunningNet {
    /** The number of recent firings in a livelock report. */
    private static final int RECENT = 256;

    private enum Step { CLOCK, READER, CONDITION, FIRING, ENTRY, EXIT, CONTINUOUS, WRITER }

    private final PetriNet net;
    private final CoordinatorBuilder bound;
    private final Inputs inputs;
    private final Outputs outputs;
    private final double[] failSafe;
    private final SplitMix random;
    final Enabling enabling;
    private final boolean[] timed;
    /** True if the delay of an enabled transition is over. */
    private final boolean[] ripe;
    /** Enabled, ripe, and true in this scan. */
    private final Ready ready;
    /** When the end of a delay released the transition, in the scan of that number. */
    private final long[] releasedAt;
    private final long[] releasedIn;
    /** The scan since which the transition has been enabled with its edge unused: the edge counts from the next scan on. */
    private final long[] enabledIn;
    /** The due time that caused the current firing; {@link Ready#UNTIMED} if inputs caused it. */
    private long moment = Ready.UNTIMED;
    /** When the delays begin that begin now. */
    private long origin;
    private boolean firing;
    /** When tokens came into each empty place; only for a marked place. */
    private final long[] markedAt;
    /** The times for which places must be marked: all, those of each transition, and the transitions of each place; null for none. */
    private final CoordinatorBuilder.Age[] allAges;
    private final CoordinatorBuilder.Age[][] ages;
    private final int[][] agesOf;
    /** The scan in which the condition was last tested. */
    private final long[] testedIn;
    private final boolean[] holds;
    /** A bit for each place that is marked and has a continuous action. */
    private final long[] active;
    private final int[] recent = new int[RECENT];
    /** How often each transition has fired, and when last. */
    private final long[] fired;
    private final long[] lastFired;
    /** The conditions that know their parts; null for the others. */
    private final Conjunction[] conjunctions;
    private final AtomicReference<NetWatch> watch = new AtomicReference<>();
    private long scans;
    private long now = Long.MIN_VALUE;
    private boolean scanning;
    private Step step = Step.READER;
    private int at;
    private Stop stop;
    private int[] beginning;

    Coordinator(CoordinatorBuilder bound) {
        this.bound = bound;
        net = bound.net;
        inputs = new Inputs(new Signals("input", bound.inputs));
        outputs = new Outputs(new Signals("output", bound.outputs));
        failSafe = bound.failSafe.stream().mapToDouble(Double::doubleValue).toArray();
        System.arraycopy(failSafe, 0, outputs.signals.values, 0, failSafe.length);
        random = new SplitMix(bound.seed);
        beginning = net.initialMarking().toArray();
        int transitions = net.transitions().size();
        timed = new boolean[transitions];
        for (Transition transition : net.transitions()) {
            timed[transition.index()] = transition.delay().kind() != Delay.Kind.NONE;
        }
        ripe = new boolean[transitions];
        ready = new Ready(net.transitions().stream().mapToInt(Transition::priority).toArray(), Conflicts.clusters(net));
        releasedAt = new long[transitions];
        releasedIn = new long[transitions];
        enabledIn = new long[transitions];
        testedIn = new long[transitions];
        holds = new boolean[transitions];
        markedAt = new long[net.places().size()];
        allAges = bound.ages.toArray(CoordinatorBuilder.Age[]::new);
        ages = new CoordinatorBuilder.Age[transitions][];
        agesOf = new int[net.places().size()][];
        for (CoordinatorBuilder.Age age : allAges) {
            int t = age.transition();
            int p = age.place();
            ages[t] = bound.ages.stream().filter(one -> one.transition() == t).toArray(CoordinatorBuilder.Age[]::new);
            agesOf[p] = bound.ages.stream().filter(one -> one.place() == p).mapToInt(CoordinatorBuilder.Age::transition).toArray();
        }
        active = new long[(net.places().size() + 63) / 64];
        fired = new long[transitions];
        lastFired = new long[transitions];
        conjunctions = new Conjunction[transitions];
        for (int t = 0; t < transitions; t++) {
            conjunctions[t] = bound.conditions[t] instanceof Conjunction parts ? parts : null;
        }
        enabling = new Enabling(net, new Enabling.Watcher() {
            @Override
            public void enabled(int t) {
                enabledIn[t] = firing ? scans : scans - 1;
                arm(t);
            }

            @Override
            public void disabled(int t) {
                ready.remove(t);
                ripe[t] = false;
                if (timed[t]) {
                    enabling.due.remove(t);
                }
            }
        });
    }

    /** Binds conditions and actions to this net. */
    public static CoordinatorBuilder of(PetriNet net) {
        return new CoordinatorBuilder(net);
    }

    /** The net that runs. */
    @Override
    public PetriNet net() {
        return net;
    }

    @Override
    public List<String> inputNames() {
        return inputs.signals.names();
    }

    @Override
    public List<String> outputNames() {
        return outputs.signals.names();
    }

    @Override
    public Condition condition(int transition) {
        return bound.conditions[transition];
    }

    /** How often the transition with this index has fired. */
    public long firings(int transition) {
        return fired[transition];
    }

    /**
     * Begins with this marking in place of the initial one, such as the marking of an earlier run. The entry actions of its
     * marked places run in the first scan, and delays begin there. Only before the first scan.
     */
    public void resume(Marking marking) {
        if (scans > 0) {
            throw new IllegalStateException("net " + net.name() + " has been scanned; resume it before its first scan");
        }
        if (marking.net() != net) {
            throw new IllegalArgumentException("a marking of net " + marking.net().name() + "; expected one of net " + net.name());
        }
        beginning = marking.toArray();
    }

    /** A copy of the current marking; before the first scan, the marking with which it begins. */
    public Marking marking() {
        return net.marking(scans == 0 ? beginning : enabling.tokens);
    }

    /** The current tokens in the place with this index; before the first scan, those with which it begins. */
    public int tokens(int place) {
        return scans == 0 ? beginning[place] : enabling.tokens[place];
    }

    /** The number of scans, including the one that stopped the controller. */
    public long scans() {
        return scans;
    }

    /** The outputs, for views: the values last written, unless called from an action. */
    public Outputs outputs() {
        return outputs;
    }

    /** Why the controller stopped; empty while it runs. */
    public Optional<Stop> stop() {
        return Optional.ofNullable(stop);
    }

    /**
     * When the next delay is over, or a place has been marked for as long as a transition waits for; {@link Long#MAX_VALUE} if
     * nothing waits for the time.
     */
    public long nextDue() {
        long next = enabling.due.next();
        for (CoordinatorBuilder.Age age : allAges) {
            if (scans > 0 && enabling.tokens[age.place()] > 0) {
                long due = Enabling.after(markedAt[age.place()], age.nanos());
                next = due > now ? Math.min(next, due) : next;
            }
        }
        return next;
    }

    /** The time of the last scan in nanoseconds; {@link Long#MIN_VALUE} before the first. */
    public long nanos() {
        return now;
    }

    /** When tokens came into the place with this index while it was empty, in nanoseconds; only for a marked place. */
    public long markedSince(int place) {
        return markedAt[place];
    }

    /**
     * One scan at the time {@code nanos}. The clock can begin anywhere: tokens of the initial marking arrive with the first
     * scan. A clock that goes back stops the controller.
     *
     * @return how many transitions fired; 0 after the controller has stopped
     */
    public int scan(long nanos) {
        if (scanning) {
            throw new IllegalStateException("a scan within a scan; an action must not call scan");
        }
        int count = stop == null ? guarded(nanos) : 0;
        NetWatch viewer = watch.getOpaque();
        if (viewer != null) {
            viewer.offer();
        }
        return count;
    }

    private int guarded(long nanos) {
        scans++;
        scanning = true;
        try {
            step = Step.CLOCK;
            if (nanos < now) {
                throw new IllegalArgumentException("a scan at " + nanos + " ns after one at " + now
                    + "; expected a time that does not go back");
            }
            now = nanos;
            return run();
        } catch (Throwable thrown) {
            fail(thrown);
            return 0;
        } finally {
            scanning = false;
            firing = false;
        }
    }

    private int run() {
        step = Step.READER;
        bound.reader.read(inputs.signals.values);
        ready.clear();
        origin = now;
        if (scans == 1) {
            enabling.start(beginning, now);
            for (int p = 0; p < enabling.tokens.length; p++) {
                if (enabling.tokens[p] > 0) {
                    markedAt[p] = now;
                    act(bound.entry, Step.ENTRY, p);
                    mark(p);
                }
            }
        }
        if (!bound.exactDelays) {
            release(now);
        }
        for (int i = 0; i < enabling.enabled.size(); i++) {
            consider(enabling.enabled.get(i));
        }
        int count = fireAll();
        while (count >= 0 && enabling.due.isDue(now)) {
            release(enabling.due.next());
            int more = fireAll();
            count = more < 0 ? more : count + more;
        }
        if (count < 0) {
            livelock();
            return 0;
        }
        for (int word = 0; word < active.length; word++) {
            for (long bits = active[word]; bits != 0; bits &= bits - 1) {
                act(bound.continuous, Step.CONTINUOUS, 64 * word + Long.numberOfTrailingZeros(bits));
            }
        }
        step = Step.WRITER;
        bound.writer.write(outputs.signals.values);
        return count;
    }

    /** Fires until nothing is ready, and returns how often; -1 if that has no end. */
    private int fireAll() {
        firing = true;
        int count = 0;
        while (ready.size() > 0) {
            if (count == bound.limit) {
                return -1;
            }
            int choices = ready.choices();
            int t = ready.choice(choices == 1 ? 0 : random.below(choices));
            recent[count++ % RECENT] = t;
            fire(t, choices);
        }
        firing = false;
        return count;
    }

    /** Releases everything that is due until a time, each with its own time: the earliest due time fires first. */
    private void release(long until) {
        while (enabling.due.isDue(until)) {
            moment = enabling.due.next();
            origin = bound.exactDelays ? moment : now;
            int index = enabling.due.pop();
            if (index < timed.length) {
                ripe[index] = true;
                releasedAt[index] = moment;
                releasedIn[index] = scans;
                consider(index);
            } else {
                enabling.release(index - timed.length, moment);
            }
        }
        moment = Ready.UNTIMED;
        origin = now;
    }

    private void act(Action[] actions, Step of, int index) {
        if (actions[index] != null) {
            step = of;
            at = index;
            actions[index].run(inputs, outputs);
        }
    }

    /** Starts the delay of an enabled transition; each of its firings starts it again. */
    private void arm(int t) {
        if (timed[t]) {
            long delay = random.draw(net.transition(t).delay());
            ripe[t] = delay == 0;
            if (delay > 0) {
                enabling.due.put(t, Enabling.after(origin, delay));
                ready.remove(t);
            }
        } else {
            ripe[t] = true;
        }
        releasedAt[t] = moment;
        releasedIn[t] = scans;
        consider(t);
    }

    private void consider(int t) {
        if (!ripe[t] || isEdgeOver(t)) {
            return;
        }
        if (testedIn[t] != scans) {
            Condition condition = bound.conditions[t];
            step = Step.CONDITION;
            at = t;
            holds[t] = isOldEnough(t) && (condition == null || condition.test(inputs));
            testedIn[t] = scans;
        }
        if (holds[t]) {
            ready.add(t, releasedIn[t] == scans ? releasedAt[t] : Ready.UNTIMED);
        }
    }

    /** An edge counts for the transitions enabled when the scan began, and for one firing of each. */
    private boolean isEdgeOver(int t) {
        return bound.edge[t] && enabledIn[t] == scans;
    }

    private boolean isOldEnough(int t) {
        if (ages[t] != null) {
            for (CoordinatorBuilder.Age age : ages[t]) {
                if (enabling.tokens[age.place()] == 0 || now < Enabling.after(markedAt[age.place()], age.nanos())) {
                    return false;
                }
            }
        }
        return true;
    }

    /** Begins the time of a place that a firing empties. Until the next scan, the place is not old enough for any transition. */
    private void renew(int p) {
        markedAt[p] = origin;
        if (agesOf[p] != null) {
            for (int t : agesOf[p]) {
                testedIn[t] = scans;
                holds[t] = false;
                ready.remove(t);
            }
        }
    }

    private void fire(int t, int choices) {
        Effects effects = net.effects();
        step = Step.FIRING;
        at = t;
        moment = ready.since(t);
        // What needs an input happens at the scan, whatever came before it.
        boolean isByTimeAlone = moment != Ready.UNTIMED && bound.conditions[t] == null && ages[t] == null;
        origin = bound.exactDelays && isByTimeAlone ? moment : now;
        for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
            int p = effects.changePlace(i);
            if (enabling.tokens[p] == effects.takes(i)) {
                renew(p);
            }
        }
        enabling.fire(t, origin);
        fired[t]++;
        lastFired[t] = now;
        if (bound.edge[t]) {
            enabledIn[t] = scans;
            ready.remove(t);
        }
        if (timed[t] && enabling.enabled.contains(t)) {
            arm(t);
        }
        // The conditions of newly enabled transitions were tested in between.
        step = Step.FIRING;
        at = t;
        bound.listener.fired(scans, now, t, choices);
        for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
            mark(effects.changePlace(i));
            if (effects.takes(i) > 0) {
                act(bound.exit, Step.EXIT, effects.changePlace(i));
            }
        }
        act(bound.firing, Step.FIRING, t);
        for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
            if (effects.puts(i) > 0) {
                act(bound.entry, Step.ENTRY, effects.changePlace(i));
            }
        }
    }

    private void mark(int p) {
        if (bound.continuous[p] != null) {
            long bit = 1L << p;
            active[p / 64] = enabling.tokens[p] > 0 ? active[p / 64] | bit : active[p / 64] & ~bit;
        }
    }

    void attach(NetWatch by) {
        if (!watch.compareAndSet(null, by)) {
            throw new IllegalStateException("net " + net.name() + " is watched already; close that watch first");
        }
    }

    void detach(NetWatch by) {
        watch.compareAndSet(by, null);
    }

    @Override
    public void copyTo(NetState state) {
        state.scans = scans;
        state.nanos = now;
        state.stop = stop;
        System.arraycopy(inputs.signals.values, 0, state.inputs, 0, state.inputs.length);
        System.arraycopy(outputs.signals.values, 0, state.outputs, 0, state.outputs.length);
        System.arraycopy(fired, 0, state.fired, 0, fired.length);
        System.arraycopy(lastFired, 0, state.lastFired, 0, fired.length);
        if (scans == 0) {
            System.arraycopy(beginning, 0, state.tokens, 0, beginning.length);
            System.arraycopy(beginning, 0, state.available, 0, beginning.length);
        } else {
            enabling.copyTokens(state);
        }
        for (int t = 0; t < fired.length; t++) {
            state.phases[t] = phase(t, state.tokens);
            state.due[t] = state.phases[t] == NetState.Phase.DELAYED ? enabling.due.at(t) : Long.MAX_VALUE;
            state.failed[t] = state.phases[t] == NetState.Phase.HELD && conjunctions[t] != null ? conjunctions[t].failed() : -1;
        }
    }

    private NetState.Phase phase(int t, int[] tokens) {
        if (scans == 0) {
            return net.effects().isEnabled(tokens, t) ? NetState.Phase.READY : NetState.Phase.DISABLED;
        }
        if (!enabling.enabled.contains(t)) {
            return NetState.Phase.DISABLED;
        }
        if (!ripe[t]) {
            return NetState.Phase.DELAYED;
        }
        return testedIn[t] == scans && !holds[t] || isEdgeOver(t) ? NetState.Phase.HELD : NetState.Phase.READY;
    }

    private void livelock() {
        Set<String> names = new TreeSet<>();
        for (int i = 0; i < Math.min(RECENT, bound.limit); i++) {
            names.add(net.transition(recent[i]).name());
        }
        halt(Stop.Cause.LIVELOCK, "transitions " + names, bound.limit
            + " firings in one scan, and the net does not come to rest; lately " + names + " fired. Give one of them a "
            + "condition that becomes false or a delay, or raise the limit", null);
    }

    private void fail(Throwable thrown) {
        String element = switch (step) {
            case CLOCK -> "clock";
            case READER -> "reader of the inputs";
            case CONDITION -> "condition of transition " + net.transition(at).name();
            case FIRING -> "firing of transition " + net.transition(at).name();
            case ENTRY -> "entry action of place " + net.place(at).name();
            case EXIT -> "exit action of place " + net.place(at).name();
            case CONTINUOUS -> "continuous action of place " + net.place(at).name();
            case WRITER -> "writer of the outputs";
        };
        halt(Stop.Cause.THROWN, element, element + " threw " + thrown, thrown);
    }

    private void halt(Stop.Cause cause, String element, String message, Throwable thrown) {
        System.arraycopy(failSafe, 0, outputs.signals.values, 0, failSafe.length);
        stop = new Stop(cause, element, "net " + net.name() + ", scan " + scans + ": " + message, thrown, scans, marking());
        try {
            bound.writer.write(outputs.signals.values);
        } catch (Throwable again) {
            stop = new Stop(cause, element, stop.message() + "; the fail-safe values could not be written either: " + again,
                thrown, scans, stop.marking());
        }
    }
}
