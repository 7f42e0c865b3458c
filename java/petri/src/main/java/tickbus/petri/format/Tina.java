package tickbus.petri.format;

import java.io.IOException;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.HashSet;
import java.util.List;
import java.util.Set;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.net.Transition;

/**
 * Reads and writes the textual nets of TINA, {@code .net}: weights, test and inhibitor arcs, and time intervals.
 *
 * <p>An interval becomes a {@link Delay}: {@code [a,a]} a fixed one, {@code [a,b]} one between two bounds, and {@code [a,w[},
 * which has no end, the earliest one. Stopwatch arcs, and priorities between single transitions, are refused.
 */
public final class Tina {
    private static final Pattern TOKEN = Pattern.compile("#[^\\n]*|\\{[^\\\\}]*+(?:\\\\.[^\\\\}]*+)*+\\}|->|[\\]\\[(),:*?!<>-]|[^\\s\\]\\[(),:*?!<>{}#-]+|\\S",
        Pattern.DOTALL);
    private static final Set<String> WORDS = Set.of("net", "tr", "pl", "lb", "pr", "nt");

    private final SourceText source;
    private final long unit;
    private final NetGraph graph;
    private final List<String> warnings = new ArrayList<>();
    private final List<String> tokens = new ArrayList<>();
    private final List<Integer> lines = new ArrayList<>();
    private final Set<NetGraph.Node> marked = new HashSet<>();
    private int at;

    private Tina(SourceText source, long unit) {
        if (unit < 1) {
            throw new IllegalArgumentException("a unit of " + unit + " ns; expected 1 or more");
        }
        this.source = source;
        this.unit = unit;
        graph = new NetGraph(source);
    }

    /** Reads a file; {@code unit} is the length of the unit of its time intervals in nanoseconds, 1 or more. */
    public static Imported read(Path file, long unit) throws IOException {
        return new Tina(SourceText.read(file), unit).net();
    }

    /** Reads a text; {@code source} is its name in messages. */
    public static Imported parse(String source, String text, long unit) {
        return new Tina(new SourceText(source, text), unit).net();
    }

    private Imported net() {
        int line = 1;
        int end = 0;
        for (Matcher found = TOKEN.matcher(source.text()); found.find(); end = found.start()) {
            line += (int) source.text().substring(end, found.start()).chars().filter(c -> c == '\n').count();
            if (!found.group().startsWith("#")) {
                tokens.add(found.group());
                lines.add(line);
            }
        }
        lines.add(line);
        graph.name = "net";
        while (at < tokens.size()) {
            String word = next();
            at++;
            switch (word) {
                case "net" -> graph.name = name("net");
                case "tr" -> transition();
                case "pl" -> place();
                case "lb" -> {
                    name("label");
                    name("label");
                }
                case "nt" -> {
                    name("note");
                    name("note");
                    name("note");
                }
                case "pr" -> throw mistake("pr", "a priority between transitions; expected a net without");
                default -> {
                    at--;
                    throw mistake("", "'" + SourceText.shortened(word) + "'; expected net, tr, pl, lb or nt");
                }
            }
        }
        if (tokens.isEmpty()) {
            throw source.mistake(1, "", "there is nothing; expected a net of TINA");
        }
        return new Imported(graph.net(), List.copyOf(warnings));
    }

    private String next() {
        return at < tokens.size() ? tokens.get(at) : "the end";
    }

    private NetException mistake(String element, String message) {
        return source.mistake(lines.get(at), element, message);
    }

    private boolean skip(String token) {
        boolean isThere = next().equals(token);
        at += isThere ? 1 : 0;
        return isThere;
    }

    private void take(String element, String token) {
        if (!skip(token)) {
            throw mistake(element, "'" + SourceText.shortened(next()) + "'; expected " + token);
        }
    }

    /** A name, without the braces in which any name can stand. */
    private String name(String element) {
        String token = next();
        if (at == tokens.size() || token.matches("[\\]\\[(),:*?!<>{}-]|->")) {
            throw mistake(element, "'" + SourceText.shortened(token) + "'; expected a name");
        }
        at++;
        String name = token.startsWith("{") ? token.substring(1, token.length() - 1).replaceAll("\\\\(.)", "$1") : token;
        return name.replaceAll("\\s+", " ").strip();
    }

    private int number(String element, String what, int least) {
        int line = lines.get(at);
        String digits = name(element);
        int times = digits.endsWith("K") ? 1_000 : digits.endsWith("M") ? 1_000_000 : 1;
        int number = source.number(line, element, what, times == 1 ? digits : digits.substring(0, digits.length() - 1), least);
        if ((long) number * times > Integer.MAX_VALUE) {
            throw source.mistake(line, element, what + " " + digits + "; expected at most " + Integer.MAX_VALUE);
        }
        return number * times;
    }

    private NetGraph.Node node(String tag, String name) {
        NetGraph.Node node = graph.nodes.computeIfAbsent(tag.charAt(0) + ":" + name, id -> new NetGraph.Node(id, tag, lines.get(at), null));
        node.name = name;
        return node;
    }

    private void place() {
        String name = name("place");
        String element = "place " + name;
        NetGraph.Node node = node("place", name);
        label(element);
        if (skip("(")) {
            int initial = number(element, "marking", 0);
            take(element, ")");
            if (!marked.add(node) && node.initial != initial) {
                throw mistake(element, "marked with " + node.initial + " and with " + initial + "; expected one marking");
            }
            node.initial = initial;
        }
        arcs(element, node, "transition");
    }

    private void transition() {
        String name = name("transition");
        String element = "transition " + name;
        NetGraph.Node node = node("transition", name);
        label(element);
        if (next().equals("[") || next().equals("]")) {
            interval(element, node);
        }
        arcs(element, node, "place");
    }

    private void label(String element) {
        if (skip(":")) {
            name(element);
        }
    }

    private void interval(String element, NetGraph.Node node) {
        int line = lines.get(at);
        boolean closed = skip("[") || !skip("]");
        int earliest = number(element, "earliest time", 0);
        take(element, ",");
        boolean hasEnd = !skip("w");
        int latest = hasEnd ? number(element, "latest time", 0) : earliest;
        closed &= skip("]") || !hasEnd;
        if (!tokens.get(at - 1).equals("]")) {
            take(element, "[");
        }
        if (latest < earliest) {
            throw source.mistake(line, element, "an interval from " + earliest + " to " + latest + "; expected the earliest time first");
        }
        if (!closed) {
            warnings.add(source.mistake(line, element, "its interval is read with its bounds").getMessage());
        }
        if (!hasEnd && earliest > 0) {
            warnings.add(source.mistake(line, element, "it may fire at any time from " + earliest + " on, and is read to fire then").getMessage());
        }
        if (latest > 0) {
            Delay.Kind kind = latest == earliest ? Delay.Kind.FIXED : Delay.Kind.UNIFORM;
            try {
                node.own.put("delay", kind + " " + Math.multiplyExact(earliest, unit) + " "
                    + (kind == Delay.Kind.FIXED ? 0 : Math.multiplyExact(latest, unit)));
            } catch (ArithmeticException overflow) {
                throw source.mistake(line, element, latest + " units of " + unit + " ns; expected at most " + Long.MAX_VALUE + " ns");
            }
        }
    }

    /** The nodes before and behind this one, if they are given. */
    private void arcs(String element, NetGraph.Node node, String other) {
        boolean before = true;
        int first = graph.links.size();
        while (at < tokens.size()) {
            if (skip("->")) {
                if (!before) {
                    throw mistake(element, "a second ->; expected one");
                }
                before = false;
                continue;
            }
            if (WORDS.contains(next())) {
                break;
            }
            int line = lines.get(at);
            NetGraph.Node with = node(other, name(element));
            NetGraph.Link link = new NetGraph.Link("of " + element, line, before ? with.id : node.id, before ? node.id : with.id);
            link.kind = ArcKind.INPUT;
            if (skip("*")) {
                link.weight = number(element, "weight", 1);
            } else if (skip("?")) {
                link.kind = skip("-") ? ArcKind.INHIBITOR : ArcKind.TEST;
                link.weight = number(element, "weight", 1);
            } else if (skip("!")) {
                throw mistake(element, "a stopwatch arc; expected a net without");
            }
            graph.links.add(link);
        }
        if (before && graph.links.size() > first) {
            throw mistake(element, "nodes without ->; expected inputs -> outputs");
        }
    }

    /**
     * The net as a text for TINA; {@code unit} is the length of the unit of its time intervals in nanoseconds, 1 or more. A
     * capacity becomes an inhibitor arc. Timed places, exponential delays, priorities, and delays that are no multiple of
     * the unit, are refused with a {@link NetException}.
     */
    public static String write(PetriNet net, long unit) {
        List<String> mistakes = new ArrayList<>();
        StringBuilder out = new StringBuilder("net ").append(quoted(net.name())).append('\n');
        for (Place place : net.places()) {
            if (place.delay() > 0) {
                mistakes.add("place " + place.name() + ": a delay; TINA has delays of transitions only");
            }
            out.append("pl ").append(quoted(place.name())).append(" (").append(place.initial()).append(")\n");
        }
        for (Transition one : net.transitions()) {
            if (one.priority() != 0) {
                mistakes.add("transition " + one.name() + ": priority " + one.priority() + "; it is not written for TINA");
            }
            if (one.delay().kind() == Delay.Kind.EXPONENTIAL) {
                mistakes.add("transition " + one.name() + ": an exponential delay; TINA has intervals only");
            }
            for (long nanos : new long[] {one.delay().first(), one.delay().second()}) {
                if (nanos % unit != 0 || nanos / unit > Integer.MAX_VALUE) {
                    mistakes.add("transition " + one.name() + ": a delay of " + nanos + " ns in units of " + unit + " ns; expected a whole "
                        + "number up to " + Integer.MAX_VALUE);
                }
            }
        }
        if (!mistakes.isEmpty()) {
            throw new NetException("net " + net.name(), 0, "", String.join("\n", mistakes));
        }
        List<Arc> arcs = ForeignArcs.of(net, "TINA", ForeignArcs.Has.INHIBITORS_AND_TESTS);
        for (Transition one : net.transitions()) {
            Delay delay = one.delay();
            out.append("tr ").append(quoted(one.name())).append(switch (delay.kind()) {
                case FIXED -> " [" + delay.first() / unit + "," + delay.first() / unit + "]";
                case UNIFORM -> " [" + delay.first() / unit + "," + delay.second() / unit + "]";
                default -> " [0,w[";
            });
            for (Arc arc : arcs) {
                if (arc.transition() == one.index() && arc.kind() != ArcKind.OUTPUT) {
                    out.append(' ').append(quoted(net.place(arc.place()).name()))
                        .append(arc.kind() == ArcKind.INPUT ? "*" : arc.kind() == ArcKind.TEST ? "?" : "?-").append(arc.weight());
                }
            }
            out.append(" ->");
            for (Arc arc : arcs) {
                if (arc.transition() == one.index() && arc.kind() == ArcKind.OUTPUT) {
                    out.append(' ').append(quoted(net.place(arc.place()).name())).append('*').append(arc.weight());
                }
            }
            out.append('\n');
        }
        return out.toString();
    }

    private static String quoted(String name) {
        return "{" + name.replaceAll("([\\\\{}])", "\\\\$1") + "}";
    }
}
