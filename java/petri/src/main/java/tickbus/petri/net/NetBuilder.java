package tickbus.petri.net;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.HashMap;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;

/**
 * Builds a net step by step. What {@link #place(String)} and {@link #transition} return has the properties of that place or
 * transition, and continues with the next one. Arcs can name places that come later. {@link #build} reports all mistakes at
 * once.
 */
public sealed class NetBuilder permits PlaceStep, TransitionStep {
    private final String name;
    final Map<String, Place> places;
    final Map<String, Transition> transitions;
    private final List<Pending> arcs;
    final List<String> mistakes;
    private final Map<String, double[]> placesAt;
    private final Map<String, double[]> transitionsAt;
    private final Map<String, double[][]> bends;
    private final Map<String, MacroStep> macroSteps;

    /**
     * A macro step.
     *
     * @param steps the places of its expansion
     * @param entry the place into which arcs to the macro step put tokens
     * @param exit the place from which arcs from the macro step take tokens
     */
    private record MacroStep(List<String> steps, String entry, String exit) {
    }

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
        places = new LinkedHashMap<>();
        transitions = new LinkedHashMap<>();
        arcs = new ArrayList<>();
        mistakes = new ArrayList<>();
        placesAt = new HashMap<>();
        transitionsAt = new HashMap<>();
        bends = new HashMap<>();
        macroSteps = new LinkedHashMap<>();
    }

    /** Continues the net of another builder. */
    NetBuilder(NetBuilder of) {
        name = of.name;
        places = of.places;
        transitions = of.transitions;
        arcs = of.arcs;
        mistakes = of.mistakes;
        placesAt = of.placesAt;
        transitionsAt = of.transitionsAt;
        bends = of.bends;
        macroSteps = of.macroSteps;
    }

    /** A place without tokens. */
    public PlaceStep place(String name) {
        return place(name, 0);
    }

    /** A place with tokens in the initial marking. */
    public PlaceStep place(String name, int initial) {
        if (initial < 0) {
            mistakes.add("place " + name + ": " + initial + " tokens; expected 0 or more");
        }
        checkName("place", name, places);
        places.put(name, new Place(places.size(), name, initial, Place.UNLIMITED, 0));
        return new PlaceStep(this, name);
    }

    /** An immediate transition of priority 0. */
    public TransitionStep transition(String name) {
        checkName("transition", name, transitions);
        transitions.put(name, new Transition(transitions.size(), name, 0, Delay.NONE));
        return new TransitionStep(this, name);
    }

    /**
     * A macro step, as in Grafcet (IEC 60848): it stands for another net, its expansion, of which this net gets a copy with the
     * names {@code M2.E2}, {@code M2.S2} and so on. An output arc to the macro step puts its token into the entry step, an input
     * arc takes it from the exit step, and an inhibitor arc of weight 1 needs all steps of the expansion to be empty.
     *
     * @param name the name of the macro step, such as {@code M2}
     * @param expansion the net that the macro step stands for; it can have macro steps
     * @param entry the place of the expansion that is the entry step, such as {@code E2}
     * @param exit the place of the expansion that is the exit step, such as {@code S2}; another one than {@code entry}
     */
    public NetBuilder macroStep(String name, PetriNet expansion, String entry, String exit) {
        checkName("macro step", name, macroSteps);
        List<String> steps = expansion.places().stream().map(Place::name).toList();
        for (String one : List.of(entry, exit)) {
            if (!steps.contains(one)) {
                mistakes.add("macro step " + name + ": there is no place '" + one + "' in " + expansion.name());
            }
        }
        if (entry.equals(exit)) {
            mistakes.add("macro step " + name + ": " + entry + " is entry and exit; expected two steps");
        }
        String prefix = name + ".";
        for (Place one : expansion.places()) {
            place(prefix + one.name(), one.initial());
            places.computeIfPresent(prefix + one.name(), (key, made) -> new Place(made.index(), key, one.initial(), one.capacity(), one.delay()));
        }
        for (Transition one : expansion.transitions()) {
            transition(prefix + one.name()).priority(one.priority()).delay(one.delay());
        }
        for (Arc arc : expansion.arcs()) {
            arc(arc.kind(), prefix + expansion.place(arc.place()).name(), prefix + expansion.transition(arc.transition()).name(), arc.weight());
        }
        macroSteps.put(name, new MacroStep(steps.stream().map(one -> prefix + one).toList(), prefix + entry, prefix + exit));
        return this;
    }

    /** The arcs that an arc to or from a macro step stands for. */
    private List<Pending> expanded(Pending arc) {
        MacroStep macro = macroSteps.get(arc.place);
        if (macro == null) {
            return List.of(arc);
        }
        return switch (arc.kind) {
            case INPUT -> List.of(new Pending(arc.kind, macro.exit, arc.transition, arc.weight));
            case OUTPUT -> List.of(new Pending(arc.kind, macro.entry, arc.transition, arc.weight));
            case INHIBITOR -> {
                if (arc.weight > 1) {
                    mistakes.add(arc.text() + ": weight " + arc.weight + " at a macro step; expected 1");
                }
                yield macro.steps.stream().map(one -> new Pending(arc.kind, one, arc.transition, 1)).toList();
            }
            case TEST -> {
                mistakes.add(arc.text() + ": a test arc at a macro step, which is active while any of its steps is; expected one of its steps, "
                    + "such as " + macro.exit);
                yield List.of();
            }
        };
    }

    /** An arc of any kind between nodes by name, for readers of files: a place, and a transition. */
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
        macroSteps.keySet().stream().filter(places::containsKey)
            .forEach(one -> mistakes.add("macro step " + one + ": there is a place of this name; expected another one"));
        for (Pending arc : arcs.stream().flatMap(one -> expanded(one).stream()).toList()) {
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
