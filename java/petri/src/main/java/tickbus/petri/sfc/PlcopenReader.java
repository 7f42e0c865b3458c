package tickbus.petri.sfc;

import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.Collections;
import java.util.Comparator;
import java.util.Deque;
import java.util.HashMap;
import java.util.HashSet;
import java.util.IdentityHashMap;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.Set;
import java.util.stream.Stream;
import tickbus.petri.net.NetException;

/**
 * Reads a chart in PLCopen XML: it makes the words of the same chart in text, each at the place of its element, which
 * {@link SfcReader} reads.
 */
final class PlcopenReader {
    private static final Map<String, String> BLOCKS = Map.of("localVars", "VAR", "inputVars", "VAR_INPUT", "outputVars", "VAR_OUTPUT",
        "inOutVars", "VAR_IN_OUT", "externalVars", "VAR_EXTERNAL", "globalVars", "VAR_GLOBAL", "tempVars", "VAR_TEMP", "accessVars", "VAR_ACCESS");
    private static final Set<String> OF_A_CHART = Set.of("step", "transition", "jumpStep", "actionBlock", "selectionDivergence",
        "selectionConvergence", "simultaneousDivergence", "simultaneousConvergence", "comment");
    /** Words of the text around code. */
    private static final Set<String> NOT_IN_CODE = Set.of("STEP", "INITIAL_STEP", "END_STEP", "TRANSITION", "END_TRANSITION", "ACTION",
        "END_ACTION", "END_PROGRAM", "END_FUNCTION_BLOCK");

    private final String file;
    private final List<Word> words = new ArrayList<>();
    private final Map<String, XmlElement> actions = new HashMap<>();
    private final Map<String, XmlElement> conditions = new HashMap<>();
    private final Map<String, XmlElement> steps = new HashMap<>();
    private final Map<XmlElement, List<XmlElement>> blocks = new IdentityHashMap<>();
    private final Map<XmlElement, List<XmlElement>> after = new IdentityHashMap<>();
    private final Map<XmlElement, List<XmlElement>> before = new IdentityHashMap<>();
    private final Set<String> taken = new HashSet<>();
    private int inline;
    private PlcopenLinks links;

    private PlcopenReader(String file) {
        this.file = file;
    }

    /** The words of the first chart of a project. */
    static Words read(String file, byte[] bytes) {
        return new PlcopenReader(file).project(XmlTree.read(file, bytes));
    }

    private Words project(XmlElement root) {
        if (!root.name().equals("project")) {
            throw mistake(root, "<" + root.name() + ">; expected <project> of PLCopen XML");
        }
        List<XmlElement> pous = Stream.of(root).flatMap(one -> one.all("types").stream()).flatMap(one -> one.all("pous").stream())
            .flatMap(one -> one.all("pou").stream()).toList();
        XmlElement pou = pous.stream().filter(one -> one.all("body").stream().anyMatch(body -> body.first("SFC") != null)).findFirst()
            .orElseThrow(() -> mistake(root, "there is no POU whose body is a chart; there are "
                + pous.stream().limit(20).map(one -> one.attribute("name")).toList()));
        List<XmlElement> bodies = pou.all("body").stream().flatMap(one -> one.children().stream()).toList();
        if (bodies.size() > 1) {
            throw mistake(bodies.get(1), "a second body in POU " + pou.attribute("name") + "; expected one");
        }
        boolean isBlock = pou.attribute("pouType").equals("functionBlock");
        put(pou, isBlock ? "FUNCTION_BLOCK" : "PROGRAM", pou.attribute("name"));
        pou.all("interface").forEach(this::declarations);
        named(pou, "actions", "action", actions);
        named(pou, "transitions", "transition", conditions);
        chart(bodies.get(0));
        put(pou, isBlock ? "END_FUNCTION_BLOCK" : "END_PROGRAM");
        words.add(new Word("", "the end of the chart", pou.line(), pou.column()));
        return new Words(file, words);
    }

    private void declarations(XmlElement all) {
        for (XmlElement block : all.children()) {
            String kind = BLOCKS.get(block.name());
            if (kind == null) {
                throw mistake(block, "<" + block.name() + "> is not read; expected <localVars>, <inputVars> or <outputVars>");
            }
            put(block, kind);
            for (XmlElement variable : block.all("variable")) {
                put(variable, variable.attribute("name"));
                taken.add(variable.attribute("name").toUpperCase(Locale.ROOT));
                if (!variable.attribute("address").isEmpty()) {
                    put(variable, "AT", variable.attribute("address"));
                }
                put(variable, ":");
                XmlElement type = variable.first("type") == null ? null : variable.first("type").children().stream().findFirst().orElse(null);
                if (type == null) {
                    throw mistake(variable, "no type; expected one such as <BOOL/>");
                }
                put(type, type.name().equals("derived") ? type.attribute("name") : type.name());
                XmlElement initial = variable.first("initialValue");
                if (initial != null) {
                    XmlElement value = initial.first("simpleValue");
                    if (value == null) {
                        throw mistake(initial, "an initial value of another kind; expected <simpleValue>");
                    }
                    put(variable, ":=");
                    words.addAll(parts(value, value.attribute("value")));
                }
                put(variable, ";");
            }
            put(block, "END_VAR");
        }
    }

    private void named(XmlElement pou, String all, String each, Map<String, XmlElement> into) {
        for (XmlElement one : pou.all(all).stream().flatMap(list -> list.all(each).stream()).toList()) {
            String name = one.attribute("name").toUpperCase(Locale.ROOT);
            if (into.putIfAbsent(name, one) != null) {
                throw mistake(one, "<" + each + "> " + one.attribute("name") + " is given twice");
            }
            taken.add(name);
        }
    }

    private void chart(XmlElement chart) {
        for (XmlElement one : chart.children()) {
            if (!OF_A_CHART.contains(one.name())) {
                throw mistake(one, "<" + one.name() + "> in a chart is not read; expected steps, transitions, jumps, divergences and "
                    + "convergences, action blocks, and conditions in Structured Text");
            }
            if (one.is("negated")) {
                throw mistake(one, "a negated <" + one.name() + "> is not read");
            }
        }
        links = new PlcopenLinks(file, chart);
        List<XmlElement> initialFirst = chart.all("step").stream().sorted(Comparator.comparing(one -> !one.is("initialStep"))).toList();
        initialFirst.forEach(one -> steps.putIfAbsent(one.attribute("name").toUpperCase(Locale.ROOT), one));
        taken.addAll(steps.keySet());
        for (XmlElement one : chart.all("actionBlock")) {
            blocks.computeIfAbsent(links.stepOf(one), key -> new ArrayList<>()).add(one);
        }
        // Without priorities, the standard tests the branches from left to right.
        for (XmlElement one : chart.all("transition").stream().sorted(Comparator.comparingDouble(this::x)).toList()) {
            before.put(one, links.before(one));
            before.get(one).forEach(step -> after.computeIfAbsent(step, key -> new ArrayList<>()).add(one));
        }
        inOrder(initialFirst);
    }

    /** Steps and transitions along the lines from the initial step, as Beremiz writes them. */
    private void inOrder(List<XmlElement> initialFirst) {
        Set<XmlElement> done = Collections.newSetFromMap(new IdentityHashMap<>());
        Deque<XmlElement> next = new ArrayDeque<>();
        for (XmlElement start : initialFirst) {
            next.push(start);
            while (!next.isEmpty()) {
                XmlElement one = next.pop();
                if (!done.add(one)) {
                    continue;
                }
                List<XmlElement> following;
                if (one.name().equals("step")) {
                    step(one);
                    following = after.getOrDefault(one, List.of());
                } else {
                    transition(one);
                    following = links.behind(one).stream().map(name -> steps.get(name.text())).filter(step -> step != null).toList();
                }
                for (int i = following.size() - 1; i >= 0; i--) {
                    next.push(following.get(i));
                }
            }
        }
    }

    private double x(XmlElement of) {
        XmlElement position = of.first("position");
        try {
            return position == null ? 0 : Double.parseDouble(position.attribute("x"));
        } catch (NumberFormatException wrong) {
            throw mistake(position, "x is '" + position.attribute("x") + "'; expected a number");
        }
    }

    private void step(XmlElement step) {
        put(step, step.is("initialStep") ? "INITIAL_STEP" : "STEP", step.attribute("name"), ":");
        List<Word> bodies = new ArrayList<>();
        for (XmlElement block : blocks.getOrDefault(step, List.of())) {
            for (XmlElement action : block.all("action")) {
                association(step, action, bodies);
            }
        }
        put(step, "END_STEP");
        words.addAll(bodies);
    }

    private void association(XmlElement step, XmlElement action, List<Word> bodies) {
        if (!action.attribute("indicator").isEmpty()) {
            throw mistake(action, "the indicator " + action.attribute("indicator") + " is not read; expected none");
        }
        XmlElement reference = action.first("reference");
        XmlElement body = action.first("inline");
        String name;
        if (reference != null) {
            name = reference.attribute("name");
            XmlElement declared = actions.remove(name.toUpperCase(Locale.ROOT));
            body = declared == null ? null : body(declared, declared.first("body"));
        } else {
            do {
                name = step.attribute("name").toUpperCase(Locale.ROOT) + "_INLINE" + ++inline;
            } while (!taken.add(name));
            body = body(action, body);
        }
        put(action, name, "(", action.attribute("qualifier").isEmpty() ? "N" : action.attribute("qualifier"));
        if (!action.attribute("duration").isEmpty()) {
            put(action, ",");
            words.addAll(parts(action, action.attribute("duration")));
        }
        put(action, ")", ";");
        if (body != null) {
            Stream.of("ACTION", name, ":").map(action::word).forEach(bodies::add);
            bodies.addAll(code(body));
            bodies.add(action.word("END_ACTION"));
        }
    }

    private void transition(XmlElement transition) {
        put(transition, "TRANSITION");
        if (!transition.attribute("priority").isEmpty()) {
            put(transition, "(", "PRIORITY", ":=", transition.attribute("priority"), ")");
        }
        put(transition, "FROM");
        list(transition, before.get(transition).stream().map(step -> transition.word(step.attribute("name"))).toList());
        put(transition, "TO");
        list(transition, links.behind(transition));
        XmlElement condition = transition.first("condition");
        if (condition == null || condition.children().isEmpty()) {
            throw mistake(transition, "this transition has no condition");
        }
        List<Word> code = condition(transition, condition.children().get(0));
        if (code.isEmpty()) {
            throw mistake(condition, "an empty condition");
        }
        put(condition, ":=");
        if (condition.is("negated")) {
            put(condition, "NOT", "(");
        }
        words.addAll(code);
        put(condition, condition.is("negated") ? ")" : "", ";", "END_TRANSITION");
    }

    private List<Word> condition(XmlElement transition, XmlElement condition) {
        switch (condition.name()) {
            case "inline" -> {
                return code(body(transition, condition));
            }
            case "reference" -> {
                String name = condition.attribute("name");
                XmlElement named = conditions.get(name.toUpperCase(Locale.ROOT));
                if (named == null) {
                    throw mistake(condition, "there is no transition '" + name + "'");
                }
                List<Word> code = code(body(named, named.first("body")));
                int start = !code.isEmpty() && code.get(0).text().equals(name.toUpperCase(Locale.ROOT)) ? 1 : 0;
                if (code.size() <= start || !code.get(start).text().equals(":=")) {
                    throw mistake(named, "the condition '" + name + "'; expected := and an expression");
                }
                int end = code.size() - (code.get(code.size() - 1).text().equals(";") ? 1 : 0);
                return code.subList(Math.min(start + 1, end), end);
            }
            default -> throw mistake(condition, "a condition by a line from a diagram is not read; expected one in Structured Text");
        }
    }

    /** The code of a body, which must be in Structured Text. */
    private XmlElement body(XmlElement of, XmlElement body) {
        XmlElement code = body == null || body.children().isEmpty() ? null : body.children().get(0);
        if (code == null || !code.name().equals("ST")) {
            throw mistake(code == null ? of : code, code == null ? "there is no body; expected one in Structured Text"
                : "a body in " + code.name() + " is not read; expected one in Structured Text");
        }
        return code;
    }

    private List<Word> code(XmlElement of) {
        List<Word> all = Word.all(file, of.code());
        if (words.size() + all.size() > Word.MOST) {
            throw mistake(of, "more than " + Word.MOST + " words in the chart; expected fewer");
        }
        List<Word> code = all.subList(0, all.size() - 1);
        for (Word word : code) {
            if (NOT_IN_CODE.contains(word.text())) {
                throw new NetException(file, word.line(), "", "column " + word.column() + ": " + word.written() + " is no statement");
            }
        }
        return code;
    }

    /** The words of an attribute, all at the place of its element. */
    private List<Word> parts(XmlElement of, String text) {
        List<Word> all = Word.all(file, List.of(new Word.Piece(text, of.line(), of.column())));
        return all.subList(0, all.size() - 1).stream().map(word -> of.word(word.written())).toList();
    }

    private void list(XmlElement at, List<Word> names) {
        boolean isList = names.size() > 1;
        put(at, isList ? "(" : "");
        for (int i = 0; i < names.size(); i++) {
            put(at, i > 0 ? "," : "");
            words.add(names.get(i));
        }
        put(at, isList ? ")" : "");
    }

    private void put(XmlElement at, String... texts) {
        for (String text : texts) {
            if (!text.isEmpty()) {
                words.add(at.word(text));
            }
        }
    }

    private NetException mistake(XmlElement at, String message) {
        return new NetException(file, at.line(), "", "column " + at.column() + ": " + message);
    }
}
