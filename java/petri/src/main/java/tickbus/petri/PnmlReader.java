package tickbus.petri;

import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.Deque;
import java.util.HashMap;
import java.util.HashSet;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Set;
import javax.xml.stream.XMLInputFactory;
import javax.xml.stream.XMLStreamConstants;
import javax.xml.stream.XMLStreamException;
import javax.xml.stream.XMLStreamReader;

/** Reads one net from PNML; what it does not know it refuses, so that no net loses what it means. */
final class PnmlReader {
    /** Pages in pages. */
    private static final int MOST_DEPTH = 100;

    private final SourceText source;
    private final Map<String, Node> nodes = new LinkedHashMap<>();
    private final List<Link> links = new ArrayList<>();
    private final Set<String> ids = new HashSet<>();
    private final Opening opening;
    private XMLStreamReader xml;
    private String netName = "";
    private int nets;
    /** Pages with nodes; each has coordinates of its own. */
    private final Set<String> drawnOn = new HashSet<>();

    /** A place, a transition, or a reference to one. */
    private static final class Node {
        final String id;
        final String tag;
        final int line;
        final String refers;
        String name = "";
        int initial;
        double[] at;
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

    private static final class Link {
        final String id;
        final int line;
        final String from;
        final String to;
        int weight = 1;
        ArcKind kind = ArcKind.INPUT;
        double[][] bends = {};

        Link(String id, int line, String from, String to) {
            this.id = id;
            this.line = line;
            this.from = from;
            this.to = to;
        }
    }

    /** Opens the document. */
    interface Opening {
        XMLStreamReader open(XMLInputFactory factory) throws XMLStreamException;
    }

    PnmlReader(String source, Opening opening) {
        this.source = new SourceText(source, "");
        this.opening = opening;
    }

    PetriNet net() {
        XMLInputFactory factory = XMLInputFactory.newDefaultFactory();
        factory.setProperty(XMLInputFactory.SUPPORT_DTD, false);
        factory.setProperty(XMLInputFactory.IS_SUPPORTING_EXTERNAL_ENTITIES, false);
        factory.setProperty(XMLInputFactory.IS_COALESCING, true);
        factory.setXMLResolver((publicId, systemId, base, namespace) -> {
            throw new XMLStreamException("external entities are not read");
        });
        try {
            xml = opening.open(factory);
            document();
        } catch (XMLStreamException broken) {
            int line = broken.getLocation() == null ? 0 : broken.getLocation().getLineNumber();
            throw source.mistake(line, "", "not well-formed XML: " + lastLine(broken.getMessage()));
        }
        return build();
    }

    private static String lastLine(String message) {
        return message == null ? "" : message.substring(message.lastIndexOf('\n') + 1).replaceFirst("^Message: ", "");
    }

    private void document() throws XMLStreamException {
        while (xml.hasNext()) {
            int event = xml.next();
            if (event == XMLStreamConstants.DTD) {
                throw mistake("", "a document type declaration; expected none, as PNML has none");
            }
            if (event == XMLStreamConstants.START_ELEMENT) {
                if (!xml.getLocalName().equals("pnml")) {
                    throw mistake("", "<" + xml.getLocalName() + ">; expected <pnml>");
                }
                children("pnml", tag -> {
                    if (!tag.equals("net")) {
                        throw unexpected("pnml", tag);
                    }
                    readNet();
                });
            }
        }
        if (nets == 0) {
            throw source.mistake(1, "", "there is no <net>");
        }
    }

    private interface Child {
        /** At the start of an element; returns at its end. */
        void read(String tag) throws XMLStreamException;
    }

    private void children(String of, Child child) throws XMLStreamException {
        while (true) {
            switch (xml.next()) {
                case XMLStreamConstants.START_ELEMENT -> child.read(xml.getLocalName());
                case XMLStreamConstants.END_ELEMENT -> {
                    return;
                }
                case XMLStreamConstants.CHARACTERS, XMLStreamConstants.CDATA -> {
                    if (!xml.isWhiteSpace()) {
                        throw mistake(of, "text '" + SourceText.shortened(xml.getText().strip()) + "'; expected elements");
                    }
                }
                case XMLStreamConstants.ENTITY_REFERENCE -> throw mistake(of, "entity &" + xml.getLocalName()
                    + ";; expected none");
                default -> { }
            }
        }
    }

    private void readNet() throws XMLStreamException {
        if (++nets > 1) {
            throw mistake("net " + id(), "a second net; expected one in a file");
        }
        String type = xml.getAttributeValue(null, "type");
        String element = "net " + id();
        if (!Pnml.TYPE.equals(type)) {
            throw mistake(element, "type '" + type + "'; expected " + Pnml.TYPE);
        }
        netName = id();
        children(element, tag -> {
            if (tag.equals("name")) {
                netName = label(element, tag);
            } else {
                pageChild(element, tag, 0);
            }
        });
    }

    private void pageChild(String within, String tag, int depth) throws XMLStreamException {
        switch (tag) {
            case "page" -> {
                if (depth == MOST_DEPTH) {
                    throw mistake(within, "pages within pages, " + MOST_DEPTH + " deep; expected fewer");
                }
                String element = "page " + id();
                claim(element);
                children(element, inner -> pageChild(element, inner, depth + 1));
            }
            case "place", "transition" -> {
                drawnOn.add(within);
                node(tag, null);
            }
            case "referencePlace", "referenceTransition" -> node(tag, attribute(tag + " " + id(), "ref"));
            case "arc" -> arc();
            case "name", "graphics", "toolspecific" -> skip();
            default -> throw unexpected(within, tag);
        }
    }

    private void node(String tag, String refers) throws XMLStreamException {
        String element = tag + " " + id();
        claim(element);
        Node node = new Node(id(), tag, line(), refers);
        nodes.put(node.id, node);
        children(element, inner -> {
            switch (inner) {
                case "name" -> node.name = label(element, inner).strip().replaceAll("\\s+", " ");
                case "initialMarking" -> {
                    if (!tag.equals("place")) {
                        throw unexpected(element, inner);
                    }
                    int at = line();
                    node.initial = source.number(at, element, "initial marking", label(element, inner), 0);
                }
                case "toolspecific" -> toolspecific(element, node);
                case "graphics" -> {
                    double[][] points = points();
                    node.at = points.length == 1 ? points[0] : null;
                }
                default -> throw unexpected(element, inner);
            }
        });
    }

    private void toolspecific(String element, Node node) throws XMLStreamException {
        if (!Pnml.TOOL.equals(xml.getAttributeValue(null, "tool"))) {
            skip();
            return;
        }
        children(element, tag -> node.own.put(tag, xml.getElementText().strip()));
    }

    private void arc() throws XMLStreamException {
        String element = "arc " + id();
        claim(element);
        Link link = new Link(id(), line(), attribute(element, "source"), attribute(element, "target"));
        links.add(link);
        children(element, tag -> {
            int at = line();
            switch (tag) {
                case "inscription" -> link.weight = source.number(at, element, "weight", label(element, tag), 1);
                case "type" -> {
                    link.kind = kind(element, attribute(element, "value"));
                    skip();
                }
                case "arctype" -> link.kind = kind(element, label(element, tag).strip());
                case "graphics" -> link.bends = points();
                case "name", "toolspecific" -> skip();
                default -> throw unexpected(element, tag);
            }
        });
    }

    private ArcKind kind(String element, String value) {
        return switch (value) {
            case "normal" -> ArcKind.INPUT;
            case "inhibitor" -> ArcKind.INHIBITOR;
            case "test", "read" -> ArcKind.TEST;
            default -> throw mistake(element, "arc type '" + SourceText.shortened(value)
                + "'; expected normal, inhibitor, test or read");
        };
    }

    /** The text of a label such as name or inscription. */
    private String label(String element, String tag) throws XMLStreamException {
        String[] text = {null};
        int at = line();
        children(element, inner -> {
            switch (inner) {
                case "text" -> text[0] = xml.getElementText();
                case "graphics", "toolspecific" -> skip();
                default -> throw unexpected(tag + " of " + element, inner);
            }
        });
        if (text[0] == null) {
            throw source.mistake(at, element, tag + " without <text>");
        }
        return text[0];
    }

    private void skip() throws XMLStreamException {
        int depth = 1;
        while (depth > 0) {
            int event = xml.next();
            depth += event == XMLStreamConstants.START_ELEMENT ? 1 : event == XMLStreamConstants.END_ELEMENT ? -1 : 0;
        }
    }

    /** The positions in graphics. What cannot be read there is left out, as it does not matter to the net. */
    private double[][] points() throws XMLStreamException {
        List<double[]> points = new ArrayList<>();
        int depth = 1;
        while (depth > 0) {
            int event = xml.next();
            if (event == XMLStreamConstants.START_ELEMENT) {
                depth++;
                if (xml.getLocalName().equals("position")) {
                    try {
                        double x = Double.parseDouble(String.valueOf(xml.getAttributeValue(null, "x")));
                        double y = Double.parseDouble(String.valueOf(xml.getAttributeValue(null, "y")));
                        if (Double.isFinite(x) && Double.isFinite(y)) {
                            points.add(new double[] {x, y});
                        }
                    } catch (NumberFormatException unreadable) {
                        // Left out.
                    }
                }
            } else if (event == XMLStreamConstants.END_ELEMENT) {
                depth--;
            }
        }
        return points.toArray(new double[0][]);
    }

    private String id() {
        return attribute(xml.getLocalName(), "id");
    }

    private String attribute(String element, String name) {
        String value = xml.getAttributeValue(null, name);
        if (value == null || value.isBlank()) {
            throw mistake(element, "there is no attribute " + name);
        }
        return value;
    }

    private void claim(String element) {
        if (!ids.add(id())) {
            throw mistake(element, "id " + id() + " is given twice; expected one of its own");
        }
    }

    private int line() {
        return xml.getLocation().getLineNumber();
    }

    private NetException mistake(String element, String message) {
        return source.mistake(line(), element, message);
    }

    private NetException unexpected(String element, String tag) {
        return mistake(element, "<" + tag + ">, which a place/transition net does not have");
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

    private PetriNet build() {
        // Each reference is resolved, even one without an arc.
        nodes.values().forEach(node -> resolve(new Link("", node.line, "", ""), "reference", node.id));
        Map<String, String> names = new HashMap<>();
        names(names, "place");
        names(names, "transition");
        NetBuilder builder = PetriNet.named(netName.isBlank() ? "net" : netName.strip());
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
                builder.placeAt(names.get(node.id), node.at);
            } else if (node.at != null && node.tag.equals("transition")) {
                builder.transitionAt(names.get(node.id), node.at);
            }
        }
        for (Link link : links) {
            Ends ends = ends(link, resolve(link, "source", link.from), resolve(link, "target", link.to));
            if (link.bends.length > 0) {
                builder.bends(ends.kind, names.get(ends.place), names.get(ends.transition), link.bends);
            }
        }
    }

    /** The names, if all nodes of the kind have one of their own; otherwise their ids. */
    private void names(Map<String, String> names, String tag) {
        List<Node> all = nodes.values().stream().filter(node -> node.tag.equals(tag)).toList();
        Set<String> different = new HashSet<>();
        boolean named = all.stream().allMatch(node -> !node.name.isEmpty() && different.add(node.name));
        all.forEach(node -> names.put(node.id, named ? node.name : node.id));
    }

    private void place(NetBuilder builder, Node node, String name) {
        String element = "place " + node.id;
        builder.place(name, node.initial);
        node.own.forEach((tag, value) -> {
            switch (tag) {
                case "capacity" -> {
                    int capacity = source.number(node.line, element, tag, value, 1);
                    if (node.initial > capacity) {
                        throw source.mistake(node.line, element, node.initial + " tokens; expected at most its capacity of "
                            + capacity);
                    }
                    builder.capacity(capacity);
                }
                case "delay" -> builder.delay(nanos(node, element, value));
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
        builder.transition(name);
        node.own.forEach((tag, value) -> {
            switch (tag) {
                case "priority" -> builder.priority(source.number(node.line, element, tag, value, Integer.MIN_VALUE));
                case "delay" -> {
                    String[] parts = value.split("\\s+");
                    try {
                        builder.delay(new Delay(Delay.Kind.valueOf(parts[0]), Long.parseLong(parts[1]), Long.parseLong(parts[2])));
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
