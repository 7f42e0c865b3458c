package tickbus.petri.net;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.HashMap;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;

/**
 * Builds a net step by step. {@link #capacity} and the delays belong to the last named place or transition, {@link
 * #priority} and the arcs to the last named transition. Arcs can name places that come later. {@link #build} reports all
 * mistakes at once.
 */
public final class NetBuilder {
    private final String name;
    private final Map<String, Place> places = new LinkedHashMap<>();
    private final Map<String, Transition> transitions = new LinkedHashMap<>();
    private final List<Pending> arcs = new ArrayList<>();
    private final List<String> mistakes = new ArrayList<>();
    private final Map<String, double[]> placesAt = new HashMap<>();
    private final Map<String, double[]> transitionsAt = new HashMap<>();
    private final Map<String, double[][]> bends = new HashMap<>();
    private String place;
    private String transition;
    private boolean placeIsLast;

    private record Pending(ArcKind kind, String place, String transition, int weight) {
        String text() {
            return switch (kind) {
                case OUTPUT -> "arc " + transition + " -> " + place;
                case INPUT -> "arc " + place + " -> " + transition;
                case TEST -> "test arc " + place + " -> " + transition;
                case INHIBITOR -> "inhibitor arc " + place + " -> " + transition;
            };
        }
    }

    NetBuilder(String name) {
        this.name = name;
    }

    /** A place without tokens. */
    public NetBuilder place(String name) {
        return place(name, 0);
    }

    /** A place with tokens in the initial marking. */
    public NetBuilder place(String name, int initial) {
        if (initial < 0) {
            mistakes.add("place " + name + ": " + initial + " tokens; expected 0 or more");
        }
        checkName("place", name, places);
        places.put(name, new Place(places.size(), name, initial, Place.UNLIMITED, 0));
        place = name;
        placeIsLast = true;
        return this;
    }

    /** The most tokens that the last place may hold, 1 or more. A transition has no capacity. */
    public NetBuilder capacity(int most) {
        if (!placeIsLast) {
            mistakes.add("capacity " + most + (transition == null ? ": there is no place yet" : " of transition " + transition)
                + "; call place(...) before capacity(...)");
            return this;
        }
        if (most < 1) {
            mistakes.add("place " + place + ": capacity " + most + "; expected 1 or more");
        }
        places.computeIfPresent(place, (key, old) ->
            new Place(old.index(), key, old.initial(), most, old.delay()));
        return this;
    }

    /**
     * A fixed delay in nanoseconds, 0 or more, of the last place or transition: how long a token that arrives in that place
     * is unavailable, or how long that transition must be enabled before it fires.
     */
    public NetBuilder delay(long nanos) {
        if (place == null && transition == null) {
            mistakes.add("delay " + nanos + ": there is no place or transition yet; call place(...) or transition(...) before delay");
            return this;
        }
        if (nanos < 0) {
            mistakes.add((placeIsLast ? "place " + place : "transition " + transition) + ": delay " + nanos + " ns; expected 0 or more");
            return this;
        }
        if (!placeIsLast) {
            return delay(Delay.fixed(nanos));
        }
        places.computeIfPresent(place, (key, old) ->
            new Place(old.index(), key, old.initial(), old.capacity(), nanos));
        return this;
    }

    /** An immediate transition of priority 0. */
    public NetBuilder transition(String name) {
        checkName("transition", name, transitions);
        transitions.put(name, new Transition(transitions.size(), name, 0, Delay.NONE));
        transition = name;
        placeIsLast = false;
        return this;
    }

    /** The priority of the last transition; the greatest fires first. */
    public NetBuilder priority(int priority) {
        if (isTransition("priority(int)")) {
            transitions.computeIfPresent(transition, (key, old) ->
                new Transition(old.index(), key, priority, old.delay()));
        }
        return this;
    }

    /** The delay of the last place or transition, as {@link #delay(long)}; that of a place is fixed or {@link Delay#NONE}. */
    public NetBuilder delay(Delay delay) {
        if (placeIsLast) {
            if (delay.kind() == Delay.Kind.FIXED || delay.kind() == Delay.Kind.NONE) {
                return delay(delay.first());
            }
            mistakes.add("place " + place + ": a delay of kind " + delay.kind() + "; expected a fixed one");
            return this;
        }
        if (isTransition("delay(Delay)")) {
            transitions.computeIfPresent(transition, (key, old) ->
                new Transition(old.index(), key, old.priority(), delay));
        }
        return this;
    }

    /** The last transition takes one token from each of these places. */
    public NetBuilder input(String... from) {
        for (String one : from) {
            input(one, 1);
        }
        return this;
    }

    /** The last transition takes {@code weight} tokens from a place. */
    public NetBuilder input(String from, int weight) {
        return arc(ArcKind.INPUT, from, weight);
    }

    /** The last transition puts one token into each of these places. */
    public NetBuilder output(String... to) {
        for (String one : to) {
            output(one, 1);
        }
        return this;
    }

    /** The last transition puts {@code weight} tokens into a place. */
    public NetBuilder output(String to, int weight) {
        return arc(ArcKind.OUTPUT, to, weight);
    }

    /** The last transition needs {@code weight} tokens in a place, and leaves them there. */
    public NetBuilder test(String of, int weight) {
        return arc(ArcKind.TEST, of, weight);
    }

    /** The last transition needs fewer than {@code weight} tokens in a place. */
    public NetBuilder inhibitor(String of, int weight) {
        return arc(ArcKind.INHIBITOR, of, weight);
    }

    private NetBuilder arc(ArcKind kind, String with, int weight) {
        if (isTransition("an arc")) {
            arc(kind, with, transition, weight);
        }
        return this;
    }

    /** An arc of any kind between nodes by name, for readers of files: a place, and a transition that need not be the last one. */
    public NetBuilder arc(ArcKind kind, String with, String by, int weight) {
        arcs.add(new Pending(kind, with, by, weight));
        return this;
    }

    /** The position of a place in the file's drawing. A net has {@link Positions} if all of its nodes have one. */
    public NetBuilder placeAt(String name, double x, double y) {
        placesAt.put(name, new double[] {x, y});
        return this;
    }

    /** The position of a transition in the file's drawing. */
    public NetBuilder transitionAt(String name, double x, double y) {
        transitionsAt.put(name, new double[] {x, y});
        return this;
    }

    /** The bends of an arc in the file's drawing, x and y of each, in the order from its source to its target. */
    public NetBuilder bends(ArcKind kind, String with, String by, double[][] at) {
        bends.put(new Pending(kind, with, by, 0).text(), Arrays.stream(at).map(double[]::clone).toArray(double[][]::new));
        return this;
    }

    private boolean isTransition(String what) {
        if (transition == null) {
            mistakes.add(what + ": there is no transition yet; call transition(...) before it");
        }
        return transition != null;
    }

    private void checkName(String kind, String given, Map<String, ?> others) {
        if (given == null || given.isBlank()) {
            mistakes.add(kind + " number " + (others.size() + 1) + ": no name; expected one");
        } else if (!given.equals(given.strip()) || given.chars().anyMatch(Character::isISOControl)) {
            mistakes.add(kind + " '" + given + "': a blank at an end or a control character; expected a name without");
        } else if (given.chars().anyMatch(NetBuilder::turnsText)) {
            mistakes.add(kind + " number " + (others.size() + 1) + ": its name turns the direction of the text, so that another name is "
                + "shown; expected one without such characters");
        } else if (others.containsKey(given)) {
            mistakes.add(kind + " " + given + ": given twice; expected a name of its own");
        }
    }

    /** True if a character is invisible but reverses the text around it, as U+202E does. */
    private static boolean turnsText(int c) {
        return c == 0x61C || c == 0x200E || c == 0x200F || c >= 0x202A && c <= 0x202E || c >= 0x2066 && c <= 0x2069;
    }

    /** The net; throws a {@link NetException} with all mistakes if there are any. */
    public PetriNet build() {
        Map<String, String> seen = new HashMap<>();
        List<Arc> made = new ArrayList<>();
        for (Pending arc : arcs) {
            Place with = places.get(arc.place);
            Transition by = transitions.get(arc.transition);
            if (with == null) {
                mistakes.add(arc.text() + ": there is no place '" + arc.place + "'");
            } else if (by == null) {
                mistakes.add(arc.text() + ": there is no transition '" + arc.transition + "'");
            } else if (arc.weight < 1) {
                mistakes.add(arc.text() + ": weight " + arc.weight + "; expected 1 or more");
            } else if (seen.put(arc.text(), "") != null) {
                mistakes.add(arc.text() + ": given twice; expected one arc with a weight");
            } else {
                made.add(new Arc(arc.kind, with.index(), by.index(), arc.weight));
            }
        }
        for (Place one : places.values()) {
            if (one.initial() > one.capacity() && one.capacity() > 0) {
                mistakes.add("place " + one.name() + ": " + one.initial() + " tokens; expected at most its capacity of "
                    + one.capacity());
            }
        }
        if (!mistakes.isEmpty()) {
            throw new NetException("net " + name, 0, "", String.join("\n", mistakes));
        }
        return new PetriNet(name, List.copyOf(places.values()), List.copyOf(transitions.values()), made, positions(made));
    }

    /** Null unless all nodes have a position. */
    private Positions positions(List<Arc> made) {
        if (!placesAt.keySet().containsAll(places.keySet()) || !transitionsAt.keySet().containsAll(transitions.keySet())) {
            return null;
        }
        double[][] nodes = new double[places.size() + transitions.size()][];
        places.values().forEach(one -> nodes[one.index()] = placesAt.get(one.name()));
        transitions.values().forEach(one -> nodes[places.size() + one.index()] = transitionsAt.get(one.name()));
        List<String> placeNames = List.copyOf(places.keySet());
        List<String> transitionNames = List.copyOf(transitions.keySet());
        Map<Arc, double[][]> bent = new HashMap<>();
        for (Arc arc : made) {
            double[][] points = bends.get(
                new Pending(arc.kind(), placeNames.get(arc.place()), transitionNames.get(arc.transition()), 0).text());
            if (points != null) {
                bent.put(arc, points);
            }
        }
        return new Positions(nodes, bent);
    }
}
