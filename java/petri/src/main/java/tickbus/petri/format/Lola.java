package tickbus.petri.format;

import java.io.IOException;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.Set;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import java.util.stream.Collectors;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.net.Transition;

/**
 * Reads and writes the place/transition nets of the model checker LoLA, {@code .lola}.
 *
 * <p>The format has weights, and no other arcs than inputs and outputs. High-level nets are refused.
 */
public final class Lola {
    private static final Pattern TOKEN = Pattern.compile(
        "\\{[^}]*\\}|//[^\\n]*|/\\*.*?\\*/|[,:;]|[^\\s,:;(){}]+|[^\\s]", Pattern.DOTALL);
    private static final Set<String> WORDS = Set.of("PLACE", "MARKING", "TRANSITION", "CONSUME", "PRODUCE", "SAFE", "STRONG", "WEAK",
        "FAIR", "FORMULA", "ANALYSE", "SORT", "FUNCTION", "CONSTANT", "VAR", "GUARD");

    private final SourceText source;
    private final NetGraph graph;
    private final List<String> warnings = new ArrayList<>();
    private final List<String> tokens = new ArrayList<>();
    private final List<Integer> lines = new ArrayList<>();
    private int at;

    private Lola(SourceText source) {
        this.source = source;
        graph = new NetGraph(source);
    }

    /** Reads a file; warnings name omitted parts, a {@link NetException} the mistake. */
    public static Imported read(Path file) throws IOException {
        return new Lola(SourceText.read(file)).net();
    }

    /** Reads a text; {@code source} is its name in messages. */
    public static Imported parse(String source, String text) {
        return new Lola(new SourceText(source, text)).net();
    }

    private Imported net() {
        int line = 1;
        int end = 0;
        for (Matcher found = TOKEN.matcher(source.text()); found.find(); end = found.start()) {
            line += (int) source.text().substring(end, found.start()).chars().filter(c -> c == '\n').count();
            if (!found.group().startsWith("{") && !found.group().startsWith("//") && !found.group().startsWith("/*")) {
                tokens.add(found.group());
                lines.add(line);
            }
        }
        lines.add(line);
        graph.name = "net";
        take("PLACE");
        places();
        take("MARKING");
        list("marking", this::mark);
        while (at < tokens.size() && !next().equals("FORMULA")) {
            transition();
        }
        if (at < tokens.size()) {
            warnings.add(mistake("FORMULA", "left out, with all that follows").getMessage());
        }
        return new Imported(graph.net(), List.copyOf(warnings));
    }

    private String next() {
        return at < tokens.size() ? tokens.get(at) : "the end";
    }

    private NetException mistake(String element, String message) {
        return source.mistake(lines.get(at), element, message);
    }

    private void take(String word) {
        if (!next().equals(word)) {
            throw mistake("", "'" + SourceText.shortened(next()) + "'; expected " + word
                + (at == 0 || WORDS.contains(next()) ? ", as in a place/transition net of LoLA" : ""));
        }
        at++;
    }

    private boolean skip(String word) {
        boolean isThere = next().equals(word);
        at += isThere ? 1 : 0;
        return isThere;
    }

    private String name(String element) {
        String name = next();
        if (at == tokens.size() || WORDS.contains(name) || !name.matches("[^\\s,:;(){}]+")) {
            throw mistake(element, "'" + SourceText.shortened(name) + "'; expected a name");
        }
        at++;
        return name;
    }

    /** Groups of names; a group can state a bound. */
    private void places() {
        boolean warned = false;
        do {
            if (skip("SAFE")) {
                if (!warned) {
                    warnings.add(source.mistake(lines.get(at), "SAFE", "a promise about the net, and left out").getMessage());
                    warned = true;
                }
                if (!next().equals(":")) {
                    source.number(lines.get(at), "SAFE", "bound", name("SAFE"), 0);
                }
                take(":");
            }
            do {
                int line = lines.get(at);
                String name = name("places");
                NetGraph.Node node = new NetGraph.Node("p:" + name, "place", line, null);
                node.name = name;
                if (graph.nodes.put(node.id, node) != null) {
                    throw source.mistake(line, "place " + name, "given twice; expected a name of its own");
                }
            } while (skip(","));
            take(";");
        } while (!next().equals("MARKING"));
    }

    private interface Entry {
        void read(String element, int line, String place, int count);
    }

    /** Places with counts, up to a semicolon. */
    private void list(String element, Entry entry) {
        while (!skip(";")) {
            int line = lines.get(at);
            String place = name(element);
            if (!graph.nodes.containsKey("p:" + place)) {
                throw source.mistake(line, element, "there is no place '" + SourceText.shortened(place) + "'");
            }
            int count = 1;
            if (skip(":")) {
                line = lines.get(at);
                count = source.number(line, element, "number", name(element), 0);
            }
            entry.read(element, line, place, count);
            if (!skip(",") && !next().equals(";")) {
                throw mistake(element, "'" + SourceText.shortened(next()) + "'; expected , or ;");
            }
        }
    }

    private void mark(String element, int line, String place, int count) {
        NetGraph.Node node = graph.nodes.get("p:" + place);
        if ((long) node.initial + count > Integer.MAX_VALUE) {
            throw source.mistake(line, "place " + place, "more than " + Integer.MAX_VALUE + " tokens");
        }
        node.initial += count;
    }

    private void transition() {
        take("TRANSITION");
        int line = lines.get(at);
        String name = name("transitions");
        String element = "transition " + name;
        NetGraph.Node node = new NetGraph.Node("t:" + name, "transition", line, null);
        node.name = name;
        if (graph.nodes.put(node.id, node) != null) {
            throw source.mistake(line, element, "given twice; expected a name of its own");
        }
        if (skip("STRONG") || skip("WEAK")) {
            take("FAIR");
            warnings.add(source.mistake(line, element, "its fairness is left out").getMessage());
        }
        take("CONSUME");
        list(element, (of, where, place, count) -> link(of, where, "p:" + place, node.id, count));
        take("PRODUCE");
        list(element, (of, where, place, count) -> link(of, where, node.id, "p:" + place, count));
    }

    private void link(String element, int line, String from, String to, int weight) {
        if (weight > 0) {
            NetGraph.Link link = new NetGraph.Link("of " + element, line, from, to);
            link.kind = ArcKind.INPUT;
            link.weight = weight;
            graph.links.add(link);
        }
    }

    /**
     * The net as a text for LoLA. A test arc takes its tokens and puts them back. Delays and priorities are in comments.
     * Inhibitor arcs and capacities are refused with a {@link NetException}, as LoLA has none.
     */
    public static String write(PetriNet net) {
        List<Arc> arcs = ForeignArcs.of(net, "LoLA", ForeignArcs.Has.INPUTS_AND_OUTPUTS);
        List<String> places = ForeignArcs.names(net.places().stream().map(Place::name).toList(), Lola::isName);
        List<String> transitions = ForeignArcs.names(net.transitions().stream().map(Transition::name).toList(), Lola::isName);
        if (places.isEmpty()) {
            throw new NetException("net " + net.name(), 0, "", "there is no place; LoLA needs one");
        }
        StringBuilder out = new StringBuilder();
        comment(out, net.name());
        for (Place place : net.places()) {
            if (place.delay() > 0) {
                comment(out, places.get(place.index()) + ": delay " + place.delay() + " ns");
            }
        }
        out.append("PLACE ").append(String.join(", ", places)).append(";\nMARKING ");
        out.append(net.places().stream().filter(place -> place.initial() > 0)
            .map(place -> places.get(place.index()) + ": " + place.initial()).collect(Collectors.joining(", "))).append(";\n");
        for (Transition one : net.transitions()) {
            if (one.priority() != 0 || one.delay().first() != 0 || one.delay().second() != 0) {
                comment(out, transitions.get(one.index()) + ": priority " + one.priority() + ", delay " + one.delay().kind() + " "
                    + one.delay().first() + " " + one.delay().second());
            }
            out.append("TRANSITION ").append(transitions.get(one.index())).append("\nCONSUME ")
                .append(list(arcs, one.index(), ArcKind.INPUT, places)).append(";\nPRODUCE ")
                .append(list(arcs, one.index(), ArcKind.OUTPUT, places)).append(";\n");
        }
        return out.toString();
    }

    private static void comment(StringBuilder out, String text) {
        out.append("{ ").append(text.replaceAll("[{}]", "_")).append(" }\n");
    }

    private static String list(List<Arc> arcs, int transition, ArcKind kind, List<String> places) {
        return arcs.stream().filter(arc -> arc.transition() == transition && arc.kind() == kind)
            .map(arc -> places.get(arc.place()) + ": " + arc.weight()).collect(Collectors.joining(", "));
    }

    private static boolean isName(String name) {
        return name.matches("[A-Za-z_][^\\s,:;(){}/*\"'<>=!&|~.\\[\\]+-]*") && !WORDS.contains(name);
    }
}
