package tickbus.petri.sfc;

import java.util.ArrayList;
import java.util.Collections;
import java.util.HashMap;
import java.util.IdentityHashMap;
import java.util.List;
import java.util.Map;
import java.util.Set;
import tickbus.petri.net.NetException;

/** The lines of a chart in PLCopen XML: the steps before and behind each transition. Each element refers to those above it. */
final class PlcopenLinks {
    private static final int MOST_NESTED = 100;
    private static final int MOST_LINES = 1_000_000;

    private final String file;
    private final Map<String, XmlElement> byId = new HashMap<>();
    /** The steps behind a transition, each at the place of the step or jump. */
    private final Map<XmlElement, List<Word>> behind = new IdentityHashMap<>();
    private int lines;

    PlcopenLinks(String file, XmlElement chart) {
        this.file = file;
        for (XmlElement one : chart.children()) {
            if (byId.putIfAbsent(one.attribute("localId"), one) != null) {
                throw mistake(one, "localId '" + one.attribute("localId") + "' is given twice; expected another number for each element");
            }
        }
        for (XmlElement one : chart.children()) {
            boolean isJump = one.name().equals("jumpStep");
            if (isJump || one.name().equals("step") && !connections(one.first("connectionPointIn")).isEmpty()) {
                List<XmlElement> before = new ArrayList<>();
                climb(one, one.first("connectionPointIn"), "transition", "selectionConvergence", "simultaneousDivergence", before, seen(), 0);
                Word name = one.word(one.attribute(isJump ? "targetName" : "name"));
                before.forEach(transition -> behind.computeIfAbsent(transition, key -> new ArrayList<>()).add(name));
            }
        }
    }

    /** The steps before a transition. */
    List<XmlElement> before(XmlElement transition) {
        List<XmlElement> steps = new ArrayList<>();
        climb(transition, transition.first("connectionPointIn"), "step", "simultaneousConvergence", "selectionDivergence", steps, seen(), 0);
        return steps;
    }

    /** The names of the steps behind a transition. */
    List<Word> behind(XmlElement transition) {
        List<Word> steps = behind.get(transition);
        if (steps == null) {
            throw mistake(transition, "no step follows this transition; expected a step or a jump");
        }
        return steps;
    }

    /** The step of an action block. */
    XmlElement stepOf(XmlElement actionBlock) {
        XmlElement step = source(actionBlock, actionBlock.first("connectionPointIn"));
        if (!step.name().equals("step")) {
            throw mistake(actionBlock, "an action block at a <" + step.name() + ">; expected it at a step");
        }
        return step;
    }

    private static Set<XmlElement> seen() {
        return Collections.newSetFromMap(new IdentityHashMap<>());
    }

    /**
     * Collects the elements {@code end} above a point: through {@code joined}, which has several lines above it, and
     * {@code split}, which has one.
     */
    private void climb(XmlElement from, XmlElement point, String end, String joined, String split, List<XmlElement> found,
            Set<XmlElement> seen, int depth) {
        XmlElement source = source(from, point);
        if (++lines > MOST_LINES) {
            throw mistake(from, "more than " + MOST_LINES + " lines between steps and transitions; expected fewer");
        }
        if (depth > MOST_NESTED) {
            throw mistake(from, "more than " + MOST_NESTED + " divergences and convergences behind each other");
        }
        if (!seen.add(source)) {
            throw mistake(from, "its lines reach the <" + source.name() + "> at line " + source.line() + " twice; expected no circle of "
                + "divergences and convergences, and one line from each element");
        }
        if (source.name().equals(end)) {
            found.add(source);
        } else if (source.name().equals(joined)) {
            for (XmlElement one : source.all("connectionPointIn")) {
                climb(source, one, end, joined, split, found, seen, depth + 1);
            }
        } else if (source.name().equals(split)) {
            climb(source, source.first("connectionPointIn"), end, joined, split, found, seen, depth + 1);
        } else {
            throw mistake(from, "this <" + from.name() + "> is below a <" + source.name() + ">; expected a <" + end + ">, <" + split
                + "> or <" + joined + "> there");
        }
    }

    private static List<XmlElement> connections(XmlElement point) {
        return point == null ? List.of() : point.all("connection");
    }

    private XmlElement source(XmlElement of, XmlElement point) {
        List<XmlElement> connections = connections(point);
        if (connections.size() != 1) {
            throw mistake(of, "this <" + of.name() + "> has " + connections.size() + " lines at a point above it; expected one"
                + (connections.isEmpty() ? "" : ", as a divergence or convergence joins several"));
        }
        String id = connections.get(0).attribute("refLocalId");
        XmlElement source = byId.get(id);
        if (source == null) {
            throw mistake(connections.get(0), "there is no element with localId '" + id + "'");
        }
        return source;
    }

    private NetException mistake(XmlElement at, String message) {
        return new NetException(file, at.line(), "", "column " + at.column() + ": " + message);
    }
}
