package tickbus.petri.run;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;

/** The rules of docs/petri.md by exhaustive search, with fixed delays. It repeats the firings of the coordinator under test. */
final class Reference {
    private static final long BEFORE = Long.MIN_VALUE;

    private final PetriNet net;
    private final boolean[] edge;
    /** When each token becomes available, for all places. */
    private final List<List<Long>> tokens = new ArrayList<>();
    /** When a transition may fire; null while it is not enabled. */
    private final Long[] due;
    /** For a transition that may fire in this scan: the due time of the event that released it. */
    private final long[] since;
    /** Enabled since this scan began, with an unused edge. */
    private final boolean[] fresh;
    private boolean[] holds;
    private long now = BEFORE;

    Reference(PetriNet net, boolean[] edge) {
        this.net = net;
        this.edge = edge;
        net.places().forEach(place -> tokens.add(new ArrayList<>()));
        due = new Long[edge.length];
        since = new long[edge.length];
        fresh = new boolean[edge.length];
    }

    /** Begins a scan: everything that became due happens at its own time, and delays that begin then begin with the scan. */
    void begin(long at, boolean[] conditions) {
        boolean first = now == BEFORE;
        long before = now;
        now = at;
        holds = conditions;
        Arrays.fill(since, BEFORE);
        for (Place place : net.places()) {
            for (int i = 0; first && i < place.initial(); i++) {
                tokens.get(place.index()).add(at + place.delay());
            }
        }
        if (first) {
            follow(at, BEFORE, -1);
        }
        for (long moment = Math.max(before, 0) + 1; moment <= at && !first; moment++) {
            for (int t = 0; t < due.length; t++) {
                since[t] = due[t] != null && due[t] == moment && isTimed(t) ? moment : since[t];
            }
            follow(moment, moment, -1);
        }
        for (int t = 0; t < due.length; t++) {
            fresh[t] = due[t] != null;
        }
    }

    private boolean isTimed(int t) {
        return net.transition(t).delay().first() > 0;
    }

    /**
     * The transitions that may fire now: of the greatest priority, due first, and of these one or those in conflict with it.
     */
    List<Integer> candidates() {
        List<Integer> best = new ArrayList<>();
        for (int t = 0; t < due.length; t++) {
            if (due[t] != null && due[t] <= now && holds[t] && (!edge[t] || fresh[t])) {
                int order = best.isEmpty() ? 0 : compare(t, best.get(0));
                if (order < 0) {
                    best.clear();
                }
                if (order <= 0) {
                    best.add(t);
                }
            }
        }
        if (!best.isEmpty()) {
            boolean[] cluster = cluster(best.get(0));
            best.removeIf(t -> !cluster[t]);
        }
        return best;
    }

    private int compare(int a, int b) {
        int byPriority = Integer.compare(net.transition(b).priority(), net.transition(a).priority());
        return byPriority != 0 ? byPriority : Long.compare(since[a], since[b]);
    }

    void fire(int t) {
        for (Arc arc : net.arcs()) {
            List<Long> place = tokens.get(arc.place());
            for (int i = 0; arc.transition() == t && arc.kind() == ArcKind.INPUT && i < arc.weight(); i++) {
                place.remove(place.stream().min(Long::compare).orElseThrow());
            }
        }
        for (Arc arc : net.arcs()) {
            for (int i = 0; arc.transition() == t && arc.kind() == ArcKind.OUTPUT && i < arc.weight(); i++) {
                tokens.get(arc.place()).add(now + net.place(arc.place()).delay());
            }
        }
        follow(now, since[t], t);
    }

    /** Enables and disables by the tokens of a moment; {@code cause} is the due time of the event that led to it. */
    private void follow(long moment, long cause, int fired) {
        for (int t = 0; t < due.length; t++) {
            boolean enabled = isEnabled(t, moment);
            if (enabled && (due[t] == null || t == fired)) {
                boolean again = due[t] != null && !isDelayed(t);
                due[t] = again ? due[t] : (Long) (now + net.transition(t).delay().first());
                since[t] = again ? since[t] : cause;
                fresh[t] = false;
            }
            due[t] = enabled ? due[t] : null;
        }
    }

    private boolean isDelayed(int t) {
        return net.transition(t).delay().kind() != Delay.Kind.NONE;
    }

    private boolean isEnabled(int t, long moment) {
        int[] gain = new int[tokens.size()];
        for (Arc arc : net.arcs()) {
            if (arc.transition() == t) {
                List<Long> place = tokens.get(arc.place());
                long available = place.stream().filter(at -> at <= moment).count();
                gain[arc.place()] += arc.kind() == ArcKind.OUTPUT ? arc.weight() : arc.kind() == ArcKind.INPUT ? -arc.weight() : 0;
                boolean met = switch (arc.kind()) {
                    case INPUT, TEST -> available >= arc.weight();
                    case INHIBITOR -> place.size() < arc.weight();
                    case OUTPUT -> true;
                };
                if (!met) {
                    return false;
                }
            }
        }
        for (Place place : net.places()) {
            int p = place.index();
            if (gain[p] > 0 && tokens.get(p).size() + (long) gain[p] > place.capacity()) {
                return false;
            }
        }
        return true;
    }

    /**
     * The transitions in conflict with one, directly or by others: both take, or one takes what the other tests, or one
     * fills the other's.
     */
    private boolean[] cluster(int of) {
        boolean[] in = new boolean[due.length];
        in[of] = true;
        for (int round = 0; round < in.length; round++) {
            for (int a = 0; a < in.length; a++) {
                for (int b = 0; b < in.length; b++) {
                    in[b] |= in[a] && (disables(a, b) || disables(b, a));
                }
            }
        }
        return in;
    }

    private boolean disables(int a, int b) {
        for (Place place : net.places()) {
            int takes = weight(a, place, ArcKind.INPUT);
            boolean fills = weight(a, place, ArcKind.OUTPUT) > takes;
            boolean uses = weight(b, place, ArcKind.INPUT) + weight(b, place, ArcKind.TEST) > 0;
            boolean fillsToo = weight(b, place, ArcKind.OUTPUT) > weight(b, place, ArcKind.INPUT);
            boolean minds = weight(b, place, ArcKind.INHIBITOR) > 0 || fillsToo && place.isLimited();
            if (takes > 0 && uses || fills && minds) {
                return true;
            }
        }
        return false;
    }

    private int weight(int t, Place place, ArcKind kind) {
        return net.arcs().stream().filter(arc -> arc.transition() == t && arc.place() == place.index() && arc.kind() == kind)
            .mapToInt(Arc::weight).sum();
    }

    int[] tokens() {
        return tokens.stream().mapToInt(List::size).toArray();
    }

    /** When a token or a delay is due next. */
    long nextDue() {
        long next = Long.MAX_VALUE;
        for (List<Long> place : tokens) {
            next = Math.min(next, place.stream().filter(at -> at > now).min(Long::compare).orElse(Long.MAX_VALUE));
        }
        for (Long at : due) {
            next = at != null && at > now ? Math.min(next, at) : next;
        }
        return next;
    }

    @Override
    public String toString() {
        return "tokens " + tokens + ", due " + Arrays.toString(due) + ", since " + Arrays.toString(since);
    }
}
