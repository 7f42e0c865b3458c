package tickbus.petri.run;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.Marking;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.net.Transition;

/**
 * A net step by step: fires the transitions that its caller chooses, lets time pass, and takes steps back.
 *
 * <p>A stepper has no inputs and no conditions. A transition can fire when the marking enables it and its delay is over;
 * priorities count only in {@link #choose}. The same seed and the same steps give the same delays. Not thread-safe.
 */
public final class Stepper implements RunningNet {
    /** A step that lets time pass; any other one is the index of a transition. */
    private static final int TIME = -1;

    private final PetriNet net;
    private final long seed;
    private final SplitMix choices;
    /** The steps taken, and the time after each. */
    private int[] steps = new int[64];
    private long[] times = new long[64];
    private int size;
    private final long[] fired;
    private final long[] lastFired;
    private final boolean[] ripe;
    private final boolean[] timed;
    private SplitMix delays;
    private Enabling enabling;
    private long now;

    /** Begins at time 0 with the initial marking; the seed is for random delays and for {@link #choose}. */
    public Stepper(PetriNet net, long seed) {
        this.net = net;
        this.seed = seed;
        // A different sequence from that of the delays.
        choices = new SplitMix(~seed);
        int transitions = net.transitions().size();
        fired = new long[transitions];
        lastFired = new long[transitions];
        ripe = new boolean[transitions];
        timed = new boolean[transitions];
        for (Transition transition : net.transitions()) {
            timed[transition.index()] = transition.delay().kind() != Delay.Kind.NONE;
        }
        restart();
    }

    private void restart() {
        now = 0;
        delays = new SplitMix(seed);
        Arrays.fill(fired, 0);
        Arrays.fill(ripe, false);
        enabling = new Enabling(net, new Enabling.Watcher() {
            @Override
            public void enabled(int t) {
                arm(t);
            }

            @Override
            public void disabled(int t) {
                ripe[t] = false;
                enabling.due.remove(t);
            }
        });
        enabling.start(net.initialMarking().toArray(), now);
        release();
    }

    private void arm(int t) {
        long delay = timed[t] ? delays.draw(net.transition(t).delay()) : 0;
        ripe[t] = delay == 0;
        if (delay > 0) {
            enabling.due.put(t, Enabling.after(now, delay));
        }
    }

    private void release() {
        while (enabling.due.isDue(now)) {
            int index = enabling.due.pop();
            if (index < timed.length) {
                ripe[index] = true;
            } else {
                enabling.release(index - timed.length, now);
            }
        }
    }

    @Override
    public PetriNet net() {
        return net;
    }

    /** No inputs. */
    @Override
    public List<String> inputNames() {
        return List.of();
    }

    /** No outputs. */
    @Override
    public List<String> outputNames() {
        return List.of();
    }

    /** No condition. */
    @Override
    public Condition condition(int transition) {
        return null;
    }

    /** A copy of the marking. */
    public Marking marking() {
        return net.marking(enabling.tokens);
    }

    /** The time in nanoseconds, from 0. */
    public long time() {
        return now;
    }

    /** The number of steps taken, all of which {@link #undo} can take back. */
    public int steps() {
        return size;
    }

    /** True if the transition with this index can fire now. */
    public boolean canFire(int transition) {
        return enabling.enabled.contains(transition) && ripe[transition];
    }

    /** The transitions that can fire now, in the order of the net. */
    public List<Transition> ready() {
        return net.transitions().stream().filter(transition -> canFire(transition.index())).toList();
    }

    /** When the delay of an enabled transition is over; {@link Long#MAX_VALUE} if it does not wait for the time. */
    public long due(int transition) {
        return enabling.due.at(transition);
    }

    /** When the next delay is over; {@link Long#MAX_VALUE} if nothing waits for the time. */
    public long nextDue() {
        return enabling.due.next();
    }

    /** Fires a transition; an {@link IllegalStateException} says why it cannot fire. */
    public void fire(int transition) {
        if (!canFire(transition)) {
            throw new IllegalStateException("net " + net.name() + ": transition " + net.transition(transition).name()
                + " cannot fire: " + String.join("; ", obstacles(transition)));
        }
        perform(transition, now);
        keep(transition);
    }

    private void perform(int step, long time) {
        now = time;
        if (step == TIME) {
            release();
            return;
        }
        try {
            enabling.fire(step, now);
        } catch (ArithmeticException overflow) {
            throw new IllegalStateException("net " + net.name() + ": transition " + net.transition(step).name()
                + " cannot fire: " + overflow.getMessage(), overflow);
        }
        fired[step]++;
        lastFired[step] = now;
        if (timed[step] && enabling.enabled.contains(step)) {
            arm(step);
        }
    }

    private void keep(int step) {
        if (size == steps.length) {
            int longer = (int) Math.min(Integer.MAX_VALUE - 16, 2L * size);
            steps = Arrays.copyOf(steps, longer);
            times = Arrays.copyOf(times, longer);
        }
        steps[size] = step;
        times[size++] = now;
    }

    /** Lets time pass, in nanoseconds, 0 or more. Transitions that become due stay ready: none fires automatically. */
    public void advance(long nanos) {
        if (nanos < 0) {
            throw new IllegalArgumentException("a time of " + nanos + " ns; expected 0 or more");
        }
        perform(TIME, Enabling.after(now, nanos));
        keep(TIME);
    }

    /**
     * Takes the last steps back, 0 or more, by repeating those before them. Returns the number taken back, at most as
     * requested.
     */
    public int undo(int count) {
        int back = Math.min(Math.max(0, count), size);
        size -= back;
        restart();
        for (int i = 0; i < size; i++) {
            perform(steps[i], times[i]);
        }
        return back;
    }

    /** A random transition, by the seed, among those of the greatest priority that can fire; -1 if none can. */
    public int choose() {
        List<Transition> ready = ready();
        int greatest = ready.stream().mapToInt(Transition::priority).max().orElse(0);
        List<Transition> first = ready.stream().filter(one -> one.priority() == greatest).toList();
        return first.isEmpty() ? -1 : first.get(choices.below(first.size())).index();
    }

    /** The reasons why a transition cannot fire, each a sentence without a full stop; empty if it can. */
    public List<String> obstacles(int transition) {
        List<String> found = new ArrayList<>();
        int[] gains = new int[net.places().size()];
        for (Arc arc : net.arcs()) {
            if (arc.transition() == transition) {
                gains[arc.place()] += arc.kind() == ArcKind.INPUT ? -arc.weight() : arc.kind() == ArcKind.OUTPUT ? arc.weight() : 0;
                obstacle(net.place(arc.place()), arc, found);
            }
        }
        for (Place place : net.places()) {
            int have = enabling.tokens[place.index()];
            int gain = gains[place.index()];
            if (gain > 0 && place.isLimited() && (long) have + gain > place.capacity()) {
                found.add("place " + place.name() + " has " + tokens(have) + ", " + gain + " would come, and its capacity is "
                    + place.capacity());
            }
        }
        if (found.isEmpty() && !ripe[transition]) {
            long due = due(transition);
            found.add(due == Long.MAX_VALUE ? "its delay ends after all time" : "its delay is over in " + Delay.seconds(due - now));
        }
        return found;
    }

    private void obstacle(Place place, Arc arc, List<String> found) {
        int have = enabling.tokens[place.index()];
        if (arc.kind() == ArcKind.INHIBITOR) {
            if (have >= arc.weight()) {
                found.add("place " + place.name() + " has " + tokens(have) + ", and inhibits from " + arc.weight() + " on");
            }
        } else if (arc.kind() != ArcKind.OUTPUT && enabling.available(place.index()) < arc.weight()) {
            String young = "";
            if (have > enabling.available(place.index())) {
                long next = enabling.nextOf(place.index());
                young = ", " + enabling.available(place.index()) + " of them old enough"
                    + (next == Long.MAX_VALUE ? "" : " (the next in " + Delay.seconds(next - now) + ")");
            }
            found.add("place " + place.name() + " has " + tokens(have) + young + "; " + arc.weight() + " needed"
                + (arc.kind() == ArcKind.TEST ? ", by a test arc" : ""));
        }
    }

    private static String tokens(int count) {
        return count == 0 ? "no token" : count == 1 ? "1 token" : count + " tokens";
    }

    /** One line for each firing, as {@link FiringLog} has them: number, nanoseconds, transition. */
    public String log() {
        StringBuilder text = new StringBuilder();
        int number = 0;
        for (int i = 0; i < size; i++) {
            if (steps[i] != TIME) {
                text.append(++number).append(' ').append(times[i]).append(' ').append(net.transition(steps[i]).name()).append('\n');
            }
        }
        return text.toString();
    }

    @Override
    public void copyTo(NetState state) {
        state.scans = size + 1L;
        state.nanos = now;
        enabling.copyTokens(state);
        System.arraycopy(fired, 0, state.fired, 0, fired.length);
        System.arraycopy(lastFired, 0, state.lastFired, 0, fired.length);
        for (int t = 0; t < fired.length; t++) {
            boolean enabled = enabling.enabled.contains(t);
            state.phases[t] = !enabled ? NetState.Phase.DISABLED : ripe[t] ? NetState.Phase.READY : NetState.Phase.DELAYED;
            state.due[t] = enabled && !ripe[t] ? enabling.due.at(t) : Long.MAX_VALUE;
            state.failed[t] = -1;
        }
    }
}
