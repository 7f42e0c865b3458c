package tickbus.petri.format;

import java.util.ArrayList;
import java.util.HashMap;
import java.util.HashSet;
import java.util.List;
import java.util.Map;
import java.util.Objects;
import java.util.Set;
import javax.xml.stream.XMLInputFactory;
import javax.xml.stream.XMLStreamConstants;
import javax.xml.stream.XMLStreamException;
import javax.xml.stream.XMLStreamReader;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.NetException;

/**
 * Reads one net from PNML. The reader refuses elements and attributes that it does not know, so that no net changes its
 * meaning.
 */
final class PnmlReader {
    /** The most levels of pages in pages. */
    private static final int MOST_DEPTH = 100;
    /** Attributes of TAPAAL's project files that say where something is drawn. */
    private static final Set<String> DRAWN = Set.of("positionX", "positionY", "nameOffsetX", "nameOffsetY", "markingOffsetX",
        "markingOffsetY", "angle", "displayName");
    /** Other attributes of these files; {@link #node} and {@link #readNet} check those with a meaning. */
    private static final Set<String> TAPAAL = Set.of("active", "name", "invariant", "infiniteServer", "urgent", "timed");

    private final SourceText source;
    private final Dialect dialect;
    private final NetGraph graph;
    private final Set<String> ids = new HashSet<>();
    private final List<String> warnings = new ArrayList<>();
    private final Opening opening;
    private XMLStreamReader xml;
    private int nets;
    /** The ends of each arc, by its id. */
    private final Map<String, String> arcs = new HashMap<>();
    /** The colour of PIPE's tokens; a second colour would make a coloured net. */
    private String token;

    /** Opens the document. */
    interface Opening {
        XMLStreamReader open(XMLInputFactory factory) throws XMLStreamException;
    }

    PnmlReader(String source, Dialect dialect, Opening opening) {
        this.source = new SourceText(source, "");
        this.dialect = dialect == Dialect.STANDARD ? Dialect.STANDARD : Dialect.ANY;
        this.opening = opening;
        graph = new NetGraph(this.source);
    }

    Imported net() {
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
        return new Imported(graph.net(), List.copyOf(warnings));
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
                children("pnml", this::part);
            }
        }
        if (nets == 0) {
            throw source.mistake(1, "", "there is no <net>");
        }
    }

    private void part(String tag) throws XMLStreamException {
        if (tag.equals("net")) {
            if (dialect == Dialect.ANY && "false".equals(xml.getAttributeValue(null, "active"))) {
                warn("net " + id(), "inactive, and left out");
                skip();
            } else {
                readNet();
            }
        } else if (dialect == Dialect.ANY && List.of("constant", "query", "k-bound", "feature").contains(tag)) {
            skip();
        } else if (dialect == Dialect.ANY && tag.startsWith("shared-")) {
            throw mistake("pnml", "<" + tag + ">: components that share nodes; expected one net. Compose them in TAPAAL, and export "
                + "the result as PNML");
        } else {
            throw unexpected("pnml", tag);
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
        String type = xml.getAttributeValue(null, "type");
        String id = dialect == Dialect.STANDARD ? id() : Objects.requireNonNullElse(xml.getAttributeValue(null, "id"), "net");
        String element = "net " + id;
        if (++nets > 1) {
            throw mistake(element, "a second net; expected one in a file");
        }
        attributes(element, "id", "type");
        if (!Pnml.TYPE.equals(type)) {
            if (dialect == Dialect.STANDARD || !isOfPlacesAndTransitions(type)) {
                throw mistake(element, "type '" + type + "'; expected " + Pnml.TYPE
                    + (isOfPlacesAndTransitions(type) ? "; Dialect.ANY reads this one" : ""));
            }
            warn(element, (type == null ? "without a type, and" : "type '" + type + "' is") + " read as "
                + (type == null ? "" : "that of ") + "a place/transition net");
        }
        graph.name = id;
        children(element, tag -> {
            if (tag.equals("name")) {
                graph.name = label(element, tag);
            } else if (dialect == Dialect.ANY && tag.equals("finalmarkings")) {
                warn(element, "the final markings are left out");
                skip();
            } else if (dialect == Dialect.ANY && tag.equals("token")) {
                token(element);
            } else if (dialect == Dialect.ANY && tag.equals("labels")) {
                skip();
            } else {
                pageChild(element, tag, 0);
            }
        });
    }

    /**
     * The standard's core model, which ProM and pm4py name; the types of 2003, which WoPeD, LoLA and ProM 5 name; Yasper's;
     * that of PIPE and TAPAAL. Some tools write no type.
     */
    private static boolean isOfPlacesAndTransitions(String type) {
        return type == null || type.matches("P/T net|Petri ?net|(.*/)?(?i:pnmlcoremodel|ptnetb?|basicPNML(\\.rng)?|epnml-1\\.1)");
    }

    private void token(String element) throws XMLStreamException {
        if (token != null && !token.equals(id())) {
            throw mistake(element, "tokens '" + token + "' and '" + id() + "'; expected one kind, as colours are not read");
        }
        token = id();
        skip();
    }

    private void pageChild(String within, String tag, int depth) throws XMLStreamException {
        switch (tag) {
            case "page" -> {
                if (depth == MOST_DEPTH) {
                    throw mistake(within, "pages within pages, " + MOST_DEPTH + " deep; expected fewer");
                }
                String element = "page " + id();
                claim(element);
                attributes(element, "id");
                children(element, inner -> pageChild(element, inner, depth + 1));
            }
            case "place", "transition" -> {
                graph.drawnOn.add(within);
                node(tag, null);
            }
            case "referencePlace", "referenceTransition" -> node(tag, attribute(tag + " " + id(), "ref"));
            case "arc" -> arc(null);
            case "inhibitorArc" -> arc(ArcKind.INHIBITOR);
            case "inputArc", "outputArc" -> {
                // TAPAAL's composed nets.
                if (dialect == Dialect.STANDARD) {
                    throw unexpected(within, tag);
                }
                arc(ArcKind.INPUT);
            }
            case "name", "graphics", "toolspecific" -> skip();
            default -> throw unexpected(within, tag);
        }
    }

    private void node(String tag, String refers) throws XMLStreamException {
        String element = tag + " " + id();
        boolean place = tag.equals("place");
        claim(element);
        attributes(element, "id", place ? "initialMarking" : tag.equals("transition") ? "priority" : "ref");
        NetGraph.Node node = new NetGraph.Node(id(), tag, line(), refers);
        if (dialect == Dialect.ANY) {
            tapaal(element, node);
        }
        graph.nodes.put(node.id, node);
        Figure initial = new Figure(element, "initial marking", 0, xml.getAttributeValue(null, "initialMarking"));
        String priority = xml.getAttributeValue(null, "priority");
        if (priority != null && tag.equals("transition")) {
            node.own.put("priority", priority);
        }
        children(element, inner -> {
            switch (inner) {
                case "name" -> node.name = label(element, inner).strip().replaceAll("\\s+", " ");
                case "initialMarking" -> {
                    if (!place) {
                        throw unexpected(element, inner);
                    }
                    initial.read(line(), count(element, inner));
                }
                case "toolspecific" -> toolspecific(element, node);
                case "graphics" -> {
                    double[][] points = points();
                    node.at = points.length == 1 ? points[0] : null;
                }
                default -> {
                    if (dialect == Dialect.STANDARD || !pipe(element, inner, node)) {
                        throw unexpected(element, inner);
                    }
                }
            }
        });
        if (node.isTimedByRate) {
            // PIPE fires immediate transitions first, whose priority is 1 or more.
            node.own.remove("priority");
            warn(element, "timed by a rate, and read as an immediate transition of priority 0");
        }
        node.initial = initial.value(0);
    }

    /** Reads the attributes that a node has in TAPAAL's project files. */
    private void tapaal(String element, NetGraph.Node node) {
        String invariant = xml.getAttributeValue(null, "invariant");
        if (invariant != null && !invariant.replace(" ", "").equals("<inf")) {
            throw mistake(element, "invariant '" + SourceText.shortened(invariant) + "': a net with ages; expected '< inf'");
        }
        node.name = Objects.requireNonNullElse(xml.getAttributeValue(null, "name"), "").strip();
        node.isTimedByRate = "true".equals(xml.getAttributeValue(null, "timed"));
        String x = xml.getAttributeValue(null, "positionX");
        String y = xml.getAttributeValue(null, "positionY");
        try {
            node.at = x == null || y == null ? null : new double[] {Double.parseDouble(x), Double.parseDouble(y)};
        } catch (NumberFormatException unreadable) {
            // Drawn elsewhere: the net does not need positions.
        }
    }

    /** Reads PIPE's own elements of a node; false if this element is not one of them. */
    private boolean pipe(String element, String tag, NetGraph.Node node) throws XMLStreamException {
        boolean place = node.tag.equals("place");
        boolean transition = node.tag.equals("transition");
        if (place && tag.equals("tagged")) {
            // A token that PIPE follows, and that fires like others.
            skip();
        } else if (place && tag.equals("capacity")) {
            int capacity = source.number(line(), element, tag, label(element, tag), 0);
            // PIPE writes 0 for no capacity.
            if (capacity > 0) {
                own(element, node, tag, Integer.toString(capacity));
            }
        } else if (transition && tag.equals("priority")) {
            own(element, node, tag, label(element, tag).strip());
        } else if (transition && tag.equals("timed")) {
            node.isTimedByRate = label(element, tag).strip().equals("true");
        } else if (transition && (tag.equals("orientation") || tag.equals("rate") || tag.equals("infiniteServer"))) {
            skip();
        } else {
            return false;
        }
        return true;
    }

    private void own(String element, NetGraph.Node node, String tag, String value) {
        String other = node.own.put(tag, value);
        if (other != null && !other.equals(value)) {
            throw mistake(element, tag + " '" + SourceText.shortened(value) + "' and '" + SourceText.shortened(other)
                + "'; expected one");
        }
    }

    /** A number from an attribute or an element; if both have it, they must agree. */
    private final class Figure {
        private final String element;
        private final String what;
        private final int least;
        private Integer found;

        Figure(String element, String what, int least, String attribute) {
            this.element = element;
            this.what = what;
            this.least = least;
            if (attribute != null) {
                read(line(), attribute);
            }
        }

        void read(int line, String digits) {
            int number = source.number(line, element, what, digits, least);
            if (found != null && found != number) {
                throw source.mistake(line, element, what + " " + found + " and " + number + "; expected one");
            }
            found = number;
        }

        int value(int unless) {
            return found == null ? unless : found;
        }
    }

    private void toolspecific(String element, NetGraph.Node node) throws XMLStreamException {
        if (!Pnml.TOOL.equals(xml.getAttributeValue(null, "tool"))) {
            skip();
            return;
        }
        children(element, tag -> own(element, node, tag, xml.getElementText().strip()));
    }

    private void arc(ArcKind given) throws XMLStreamException {
        NetGraph.Link link = link();
        String element = "arc " + link.id;
        attributes(element, "id", "source", "target", "type", "inscription", "weight");
        graph.links.add(link);
        link.kind = given;
        String type = xml.getAttributeValue(null, "type");
        if (type != null) {
            kind(element, link, type);
        }
        Figure weight = new Figure(element, "weight", 1, inscription(element));
        String further = xml.getAttributeValue(null, "weight");
        if (further != null) {
            weight.read(line(), further);
        }
        children(element, tag -> {
            switch (tag) {
                case "inscription" -> weight.read(line(), count(element, tag));
                case "type" -> {
                    String value = xml.getAttributeValue(null, "value");
                    if (value == null) {
                        kind(element, link, label(element, tag).strip());
                    } else {
                        kind(element, link, value);
                        skip();
                    }
                }
                case "arctype" -> kind(element, link, label(element, tag).strip());
                case "graphics" -> link.bends = points();
                case "name", "toolspecific" -> skip();
                default -> {
                    // PIPE's bends and its tagged tokens, which fire like other tokens.
                    if (dialect == Dialect.STANDARD || !tag.equals("arcpath") && !tag.equals("tagged")) {
                        throw unexpected(element, tag);
                    }
                    skip();
                }
            }
        });
        link.weight = weight.value(1);
        link.kind = link.kind == null ? ArcKind.INPUT : link.kind;
    }

    /**
     * The arc that begins here. Nothing refers to arcs, so two between different nodes may have one id; between the same nodes
     * they could be one arc or two.
     */
    private NetGraph.Link link() {
        String from = attribute(xml.getLocalName(), "source");
        String to = attribute(xml.getLocalName(), "target");
        if (dialect == Dialect.STANDARD) {
            claim("arc " + id());
            return new NetGraph.Link(id(), line(), from, to);
        }
        String id = Objects.requireNonNullElse(xml.getAttributeValue(null, "id"), from + " to " + to);
        String other = arcs.put(id, from + " to " + to);
        if (other != null && xml.getAttributeValue(null, "id") != null) {
            if (other.equals(from + " to " + to)) {
                throw mistake("arc " + id, "given twice, " + other + "; expected an id of its own for each arc");
            }
            warn("arc " + id, "its id is given twice");
        }
        return new NetGraph.Link(id, line(), from, to);
    }

    /** The weight in the attribute of an arc, or null. In TAPAAL's project files an interval of ages is there. */
    private String inscription(String element) {
        String text = xml.getAttributeValue(null, "inscription");
        if (text == null || dialect == Dialect.STANDARD) {
            return text;
        }
        if (text.startsWith("[") || text.startsWith("(")) {
            if (!text.replace(" ", "").matches("\\[0,inf\\)(:\\d+)?")) {
                throw mistake(element, "interval '" + SourceText.shortened(text) + "': a net with ages; expected '[0,inf)'");
            }
            return null;
        }
        boolean counts = xml.getAttributeValue(null, "weight") == null || xml.getAttributeValue(null, "type") == null;
        return text.isBlank() || !counts && text.equals("1") ? null : text;
    }

    /** Takes the kind of an arc from one of the places where tools write it. */
    private void kind(String element, NetGraph.Link link, String value) {
        boolean isOfAges = dialect == Dialect.ANY && List.of("timed", "transport", "tapnInhibitor").contains(value);
        ArcKind kind = switch (isOfAges ? value.equals("tapnInhibitor") ? "inhibitor" : "normal" : value) {
            case "normal" -> ArcKind.INPUT;
            case "inhibitor" -> ArcKind.INHIBITOR;
            case "test", "read" -> ArcKind.TEST;
            default -> throw mistake(element, "arc type '" + SourceText.shortened(value)
                + "'; expected normal, inhibitor, test or read");
        };
        if (link.kind != null && link.kind != kind) {
            throw mistake(element, "arc type '" + value + "' beside another one; expected one");
        }
        link.kind = kind;
    }

    /** The text of a label such as name or inscription. */
    private String label(String element, String tag) throws XMLStreamException {
        String[] text = {null};
        int at = line();
        children(element, inner -> {
            switch (inner) {
                case "text" -> text[0] = xml.getElementText();
                case "graphics", "toolspecific" -> skip();
                default -> {
                    if (dialect == Dialect.STANDARD || !inner.equals("value")) {
                        throw unexpected(tag + " of " + element, inner);
                    }
                    text[0] = xml.getElementText();
                }
            }
        });
        if (text[0] == null) {
            throw source.mistake(at, element, tag + " without <text>");
        }
        return text[0];
    }

    /** The text of a label with a number, without the colour that PIPE writes before it. */
    private String count(String element, String tag) throws XMLStreamException {
        String text = label(element, tag).strip();
        return dialect == Dialect.STANDARD ? text : text.replaceFirst("^[^,]*,", "");
    }

    private void skip() throws XMLStreamException {
        int depth = 1;
        while (depth > 0) {
            int event = xml.next();
            depth += event == XMLStreamConstants.START_ELEMENT ? 1 : event == XMLStreamConstants.END_ELEMENT ? -1 : 0;
        }
    }

    /** The positions in graphics. Unreadable ones are left out, because the net does not need them. */
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
                        // Unreadable: left out.
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

    /** Refuses unknown attributes, except those of other namespaces. */
    private void attributes(String element, String... known) {
        for (int i = 0; i < xml.getAttributeCount(); i++) {
            String namespace = xml.getAttributeNamespace(i);
            String name = xml.getAttributeLocalName(i);
            boolean isTapaal = dialect == Dialect.ANY && (DRAWN.contains(name) || TAPAAL.contains(name));
            if ((namespace == null || namespace.isEmpty()) && !isTapaal && !List.of(known).contains(name)) {
                throw mistake(element, "attribute " + name + "=\""
                    + SourceText.shortened(xml.getAttributeValue(i)) + "\"; expected " + String.join(", ", known)
                    + " and no other");
            }
        }
    }

    private void warn(String element, String message) {
        warnings.add(mistake(element, message).getMessage());
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
}
