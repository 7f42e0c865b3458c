package tickbus.petri.sfc;

import java.util.ArrayList;
import java.util.HashMap;
import java.util.HashSet;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.Set;
import tickbus.petri.analysis.Exploration;
import tickbus.petri.analysis.Verdict;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.net.Transition;

/** Makes a chart of a net, or names everything that a chart cannot hold. */
final class NetChart {
    private static final int MOST_MARKINGS = 1_000_000;
    /** Words of IEC 61131-3 that begin or end a part of a chart, or are operators or types. */
    private static final Set<String> KEYWORDS = Set.of("ACTION", "AND", "ARRAY", "AT", "BOOL", "BY", "BYTE", "CASE", "CONFIGURATION", "CONSTANT", "D",
        "DATE", "DATE_AND_TIME", "DINT", "DO", "DS", "DT", "DWORD", "ELSE", "ELSIF", "EN", "ENO", "EXIT", "FALSE", "FOR", "FROM", "FUNCTION",
        "FUNCTION_BLOCK", "F_EDGE", "IF", "INITIAL_STEP", "INT", "INTERVAL", "L", "LINT", "LREAL", "LWORD", "MOD", "N", "NON_RETAIN", "NOT", "OF",
        "ON", "OR", "P", "P0", "P1", "PRIORITY", "PROGRAM", "R", "READ_ONLY", "READ_WRITE", "REAL", "REPEAT", "RESOURCE", "RETAIN", "RETURN",
        "R_EDGE", "S", "SD", "SINGLE", "SINT", "SL", "STEP", "STRING", "STRUCT", "T", "TASK", "THEN", "TIME", "TIME_OF_DAY", "TO", "TOD",
        "TRANSITION", "TRUE", "TYPE", "UDINT", "UINT", "ULINT", "UNTIL", "USINT", "WHILE", "WITH", "WORD", "WSTRING", "X", "XOR");
    /** The other words: ends such as END_STEP, VAR_INPUT and the like, and the types ANY. */
    private static final String KEYWORD_WITH_MORE = "(VAR|ANY)(_.*)?|END_.*";

    private final PetriNet net;
    private final List<String> mistakes = new ArrayList<>();
    /** The arcs of each transition. */
    private final List<List<Arc>> arcs;
    private final Map<String, Integer> numbers = new HashMap<>();
    /** Beside them the names of what the text has around the chart. */
    private final Set<String> taken = new HashSet<>(
        Set.of(SfcWriter.NONE.name().toUpperCase(Locale.ROOT), "CONFIG", "INSTANCE0", "PLC", "RESOURCE1", "TASK0"));

    NetChart(PetriNet net) {
        this.net = net;
        arcs = net.transitions().stream().map(one -> (List<Arc>) new ArrayList<Arc>()).toList();
        net.arcs().forEach(arc -> arcs.get(arc.transition()).add(arc));
    }

    Sfc chart() {
        refuseTokens();
        net.arcs().forEach(this::refuse);
        net.transitions().forEach(this::refuse);
        if (!mistakes.isEmpty()) {
            throw new NetException("net " + net.name(), 0, "", String.join("\n", mistakes));
        }
        Sfc chart = Sfc.parse("net " + net.name(), text());
        Verdict safe = Exploration.of(chart.net()).markings(MOST_MARKINGS).withoutFirings().run().isSafe();
        if (safe != Verdict.YES) {
            throw new NetException("net " + net.name(), 0, "", (safe == Verdict.NO ? "not safe" : "not proven to be safe within "
                + MOST_MARKINGS + " markings") + " (without its test and inhibitor arcs, as two transitions of a chart fire at once);"
                + " expected at most one token in each place, as a step is active or not");
        }
        return chart;
    }

    private void refuseTokens() {
        List<Place> marked = net.places().stream().filter(one -> one.initial() > 0).toList();
        if (marked.size() != 1 || marked.get(0).initial() > 1) {
            mistakes.add("the initial marking " + net.initialMarking() + "; expected one token, in the initial step");
        }
        for (Place one : net.places()) {
            if (one.isLimited()) {
                mistakes.add("place " + one.name() + ": a capacity of " + one.capacity() + "; expected none");
            }
        }
    }

    private void refuse(Arc arc) {
        String name = "arc between place " + net.place(arc.place()).name() + " and transition " + net.transition(arc.transition()).name() + ": ";
        if (arc.weight() > 1) {
            mistakes.add(name + "weight " + arc.weight() + "; expected 1");
        } else if (arc.kind() == ArcKind.INHIBITOR && net.transition(arc.transition()).delay().kind() != Delay.Kind.NONE) {
            mistakes.add(name + "an inhibitor arc of a transition with a delay; a chart has no time since a step was left");
        }
    }

    private void refuse(Transition one) {
        String name = "transition " + one.name() + ": ";
        for (ArcKind kind : List.of(ArcKind.INPUT, ArcKind.OUTPUT)) {
            if (arcs.get(one.index()).stream().noneMatch(arc -> arc.kind() == kind)) {
                mistakes.add(name + "no " + kind.name().toLowerCase(Locale.ROOT) + " arc; expected one, as there is a step before and behind it");
            }
        }
        if (one.delay().kind() != Delay.Kind.NONE && one.delay().kind() != Delay.Kind.FIXED) {
            mistakes.add(name + "a random delay (" + one.delay().kind() + "); expected a fixed one");
        }
    }

    private String text() {
        StringBuilder out = new StringBuilder("PROGRAM ").append(identifier(net.name(), "chart")).append('\n');
        List<String> steps = net.places().stream().map(one -> identifier(one.name(), "step" + one.index())).toList();
        for (Place one : net.places()) {
            out.append(one.initial() > 0 ? "INITIAL_STEP " : "STEP ").append(steps.get(one.index())).append(": END_STEP\n");
        }
        for (Transition one : net.transitions()) {
            List<Arc> arcs = this.arcs.get(one.index());
            out.append("TRANSITION ").append(identifier(one.name(), "transition" + one.index())).append(" (PRIORITY := ")
                .append((long) Integer.MAX_VALUE - one.priority()).append(") FROM ").append(list(arcs, ArcKind.INPUT, steps)).append(" TO ")
                .append(list(arcs, ArcKind.OUTPUT, steps)).append(" := ").append(condition(one, arcs, steps)).append("; END_TRANSITION\n");
        }
        return out.append("END_PROGRAM\n").toString();
    }

    private static String list(List<Arc> arcs, ArcKind kind, List<String> steps) {
        return arcs.stream().filter(arc -> arc.kind() == kind).map(arc -> steps.get(arc.place())).toList().toString().replace('[', '(')
            .replace(']', ')');
    }

    private String condition(Transition of, List<Arc> arcs, List<String> steps) {
        List<String> all = new ArrayList<>();
        for (Arc arc : arcs) {
            String step = steps.get(arc.place());
            long ofPlace = net.place(arc.place()).delay();
            long nanos = ofPlace + Math.min(of.delay().first(), Long.MAX_VALUE - ofPlace);
            if (arc.kind() == ArcKind.TEST) {
                all.add(step + ".X");
            }
            if (arc.kind() == ArcKind.INHIBITOR) {
                all.add("NOT " + step + ".X");
            } else if (arc.kind() != ArcKind.OUTPUT && nanos > 0) {
                all.add(step + ".T >= " + SfcWriter.time(nanos));
            }
        }
        return all.isEmpty() ? "TRUE" : String.join(" AND ", all);
    }

    private static boolean isKeyword(String name) {
        return KEYWORDS.contains(name) || name.matches(KEYWORD_WITH_MORE);
    }

    /** A name of letters, digits and single underscores that is not taken yet. */
    private String identifier(String name, String without) {
        String plain = name.replaceAll("[^A-Za-z0-9]+", "_").replaceAll("^_|_$", "");
        String base = plain.isEmpty() ? without : Character.isDigit(plain.charAt(0)) || isKeyword(plain.toUpperCase(Locale.ROOT)) ? "n_" + plain
            : plain;
        String unique = base;
        while (!taken.add(unique.toUpperCase(Locale.ROOT))) {
            unique = base + "_" + numbers.merge(base.toUpperCase(Locale.ROOT), 2, (old, two) -> old + 1);
        }
        return unique;
    }
}
