package tickbus.petri.format;

import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.Deque;
import java.util.HashMap;
import java.util.HashSet;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Set;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.PlaceStep;
import tickbus.petri.net.TransitionStep;

/** The nodes and arcs of a file as read; makes the net from them. */
final class NetGraph {
    final Map<String, Node> nodes = new LinkedHashMap<>();
    final List<Link> links = new ArrayList<>();
    /** The pages of PNML with nodes; each page has its own coordinates. */
    final Set<String> drawnOn = new HashSet<>();
    String name = "";
    private final SourceText source;

    /** A place, a transition, or a reference to one. */
    static final class Node {
        final String id;
        final String tag;
        final int line;
        final String refers;
        String name = "";
        int initial;
        double[] at;
        boolean isTimedByRate;
        final Map<String, String> own = new HashMap<>();

        Node(String id, String tag, int line, String refers) {
            this.id = id;
            this.tag = tag;
            this.line = line;
            this.refers = refers;
        }

        boolean isPlace() {
            return tag.equals("place") || tag.equals("referencePlace");
        }
    }

    static final class Link {
        final String id;
        final int line;
        final String from;
        final String to;
        int weight = 1;
        ArcKind kind;
        double[][] bends = {};

        Link(String id, int line, String from, String to) {
            this.id = id;
            this.line = line;
            this.from = from;
            this.to = to;
        }
    }

    NetGraph(SourceText source) {
        this.source = source;
    }

    private Node resolve(Link link, String end, String id) {
        Deque<String> seen = new ArrayDeque<>();
        Node node = nodes.get(id);
        boolean place = node != null && node.isPlace();
        while (node != null && node.refers != null) {
            if (seen.contains(node.id)) {
                throw source.mistake(node.line, node.tag + " " + node.id, "refers to itself by way of " + seen);
            }
            seen.push(node.id);
            Node next = nodes.get(node.refers);
            if (next == null || next.isPlace() != place) {
                throw source.mistake(node.line, node.tag + " " + node.id, "refers to '" + node.refers + "'; expected the id of "
                    + (place ? "a place" : "a transition"));
            }
            node = next;
        }
        if (node == null) {
            throw source.mistake(link.line, "arc " + link.id, end + " '" + id
                + "' is not there; expected the id of a place or transition");
        }
        return node;
    }

    PetriNet net() {
        // Each reference is resolved, even one without an arc.
        nodes.values().forEach(node -> resolve(new Link("", node.line, "", ""), "reference", node.id));
        Map<String, String> names = new HashMap<>();
        names(names, "place");
        names(names, "transition");
        NetBuilder builder = PetriNet.named(name.isBlank() ? "net" : name.strip());
        for (Node node : nodes.values()) {
            if (node.tag.equals("place")) {
                place(builder, node, names.get(node.id));
            }
        }
        for (Node node : nodes.values()) {
            if (node.tag.equals("transition")) {
                transition(builder, node, names.get(node.id));
            }
        }
        arcs(builder, names);
        if (drawnOn.size() == 1) {
            positions(builder, names);
        }
        return builder.build();
    }

    private void positions(NetBuilder builder, Map<String, String> names) {
        for (Node node : nodes.values()) {
            if (node.at != null && node.tag.equals("place")) {
                builder.placeAt(names.get(node.id), node.at[0], node.at[1]);
            } else if (node.at != null && node.tag.equals("transition")) {
                builder.transitionAt(names.get(node.id), node.at[0], node.at[1]);
            }
        }
        for (Link link : links) {
            Ends ends = ends(link, resolve(link, "source", link.from), resolve(link, "target", link.to));
            if (link.bends.length > 0) {
                builder.bends(ends.kind, names.get(ends.place), names.get(ends.transition), link.bends);
            }
        }
    }

    /** The names, if all nodes of the kind have different names; otherwise their ids. */
    private void names(Map<String, String> names, String tag) {
        List<Node> all = nodes.values().stream().filter(node -> node.tag.equals(tag)).toList();
        Set<String> different = new HashSet<>();
        boolean named = all.stream().allMatch(node -> !node.name.isEmpty() && different.add(node.name));
        all.forEach(node -> names.put(node.id, named ? node.name : node.id));
    }

    private void place(NetBuilder builder, Node node, String name) {
        String element = "place " + node.id;
        PlaceStep place = builder.place(name, node.initial);
        node.own.forEach((tag, value) -> {
            switch (tag) {
                case "capacity" -> {
                    int capacity = source.number(node.line, element, tag, value, 1);
                    if (node.initial > capacity) {
                        throw source.mistake(node.line, element, node.initial + " tokens; expected at most its capacity of "
                            + capacity);
                    }
                    place.capacity(capacity);
                }
                case "delay" -> place.delay(nanos(node, element, value));
                default -> throw source.mistake(node.line, element, "<" + tag + ">; expected <capacity> or <delay>");
            }
        });
    }

    private long nanos(Node node, String element, String value) {
        try {
            long nanos = Long.parseLong(value);
            if (nanos >= 0) {
                return nanos;
            }
        } catch (NumberFormatException wrong) {
            // The mistake below says what was expected.
        }
        throw source.mistake(node.line, element, "delay '" + SourceText.shortened(value) + "'; expected nanoseconds, 0 or more");
    }

    private void transition(NetBuilder builder, Node node, String name) {
        String element = "transition " + node.id;
        TransitionStep transition = builder.transition(name);
        node.own.forEach((tag, value) -> {
            switch (tag) {
                case "priority" -> transition.priority(source.number(node.line, element, tag, value, Integer.MIN_VALUE));
                case "delay" -> {
                    String[] parts = value.split("\\s+");
                    try {
                        transition.delay(new Delay(Delay.Kind.valueOf(parts[0]), Long.parseLong(parts[1]), Long.parseLong(parts[2])));
                    } catch (IllegalArgumentException | ArrayIndexOutOfBoundsException wrong) {
                        throw source.mistake(node.line, element, "delay '" + SourceText.shortened(value)
                            + "'; expected FIXED, EXPONENTIAL or UNIFORM and two figures in nanoseconds");
                    }
                }
                default -> throw source.mistake(node.line, element, "<" + tag + ">; expected <priority> or <delay>");
            }
        });
    }

    private record Ends(ArcKind kind, String place, String transition) {
    }

    private static Ends ends(Link link, Node from, Node to) {
        return to.isPlace() ? new Ends(ArcKind.OUTPUT, to.id, from.id) : new Ends(link.kind, from.id, to.id);
    }

    private void arcs(NetBuilder builder, Map<String, String> names) {
        Map<Ends, Integer> weights = new LinkedHashMap<>();
        for (Link link : links) {
            Node from = resolve(link, "source", link.from);
            Node to = resolve(link, "target", link.to);
            String element = "arc " + link.id;
            if (from.isPlace() == to.isPlace()) {
                throw source.mistake(link.line, element, "from " + from.tag + " " + from.id + " to " + to.tag + " " + to.id
                    + "; expected a place at one end and a transition at the other");
            }
            if (to.isPlace() && link.kind != ArcKind.INPUT) {
                throw source.mistake(link.line, element, link.kind + " arc to a place; expected one to a transition");
            }
            Ends ends = ends(link, from, to);
            boolean adds = ends.kind == ArcKind.INPUT || ends.kind == ArcKind.OUTPUT;
            if (weights.containsKey(ends) && !adds) {
                throw source.mistake(link.line, element, "a second " + ends.kind + " arc between " + from.id + " and " + to.id);
            }
            try {
                // The standard allows several arcs between the same nodes: their weights add up.
                weights.merge(ends, link.weight, Math::addExact);
            } catch (ArithmeticException overflow) {
                throw source.mistake(link.line, element, "the arcs between " + from.id + " and " + to.id
                    + " weigh more than " + Integer.MAX_VALUE + " together");
            }
        }
        weights.forEach((ends, weight) ->
            builder.arc(ends.kind, names.get(ends.place), names.get(ends.transition), weight));
    }
}
