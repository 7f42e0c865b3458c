package tickbus.petri.sfc;

import java.util.ArrayList;
import java.util.Comparator;
import java.util.HashMap;
import java.util.HashSet;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Set;
import java.util.stream.IntStream;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.TransitionStep;

/** Reads a chart in two passes: first the names of variables, steps and actions, then conditions and actions, which use them. */
final class SfcReader {
    private static final Set<String> TYPES = Set.of("BOOL", "SINT", "INT", "DINT", "LINT", "USINT", "UINT", "UDINT", "TIME");
    private static final String NO_PRIORITY = "";
    private static final int LONGEST_NAME = 200;
    private static final int MOST_NAMES_SHOWN = 20;

    private final Words words;
    private final List<Variable> variables = new ArrayList<>();
    private final Map<String, Integer> indexes = new HashMap<>();
    private final Map<String, Integer> steps = new LinkedHashMap<>();
    private final List<Word> stepNames = new ArrayList<>();
    private int initial = -1;
    private final Map<String, Integer> actionIndexes = new HashMap<>();
    private final List<Sfc.Action> actions = new ArrayList<>();
    private final List<Association> associations = new ArrayList<>();
    private final List<Way> ways = new ArrayList<>();
    private final List<Value> conditions = new ArrayList<>();
    private final List<String> blocks = new ArrayList<>();
    private final List<String> conditionTexts = new ArrayList<>();
    private final List<String> actionNames = new ArrayList<>();
    private final List<String> bodies = new ArrayList<>();

    private record Way(String name, String priority, List<Word> from, List<Word> to) {
    }

    SfcReader(Words words) {
        this.words = words;
    }

    Sfc read() {
        while (!words.isNext("PROGRAM") && !words.isNext("FUNCTION_BLOCK")) {
            if (words.isNext("")) {
                throw words.mistake(words.look(), "there is no PROGRAM or FUNCTION_BLOCK");
            }
            words.next();
        }
        String kind = words.next().text();
        String end = "END_" + kind;
        String name = name("the program").written();
        while (words.look().text().startsWith("VAR")) {
            declarations(words.next());
        }
        int body = words.position();
        names(end);
        words.goTo(body);
        Expressions expressions = new Expressions(words, variables, indexes, steps);
        while (!words.takes(end)) {
            Word word = words.next();
            switch (word.text()) {
                case "INITIAL_STEP", "STEP" -> step();
                case "TRANSITION" -> transition(expressions);
                case "ACTION" -> {
                    Word action = name("an action");
                    words.expect(":");
                    int start = words.position();
                    int index = actionIndexes.get(action.text());
                    actions.set(index, new Sfc.Action(-1, expressions.statements("END_ACTION", "")));
                    bodies.set(index, words.text(start, words.position()));
                    words.expect("END_ACTION");
                }
                default -> throw words.mistake(word, "'" + word.written() + "'; expected STEP, TRANSITION, ACTION or " + end);
            }
        }
        return new Sfc(net(name), variables, conditions, associations, actions,
            new Sfc.Source(kind, blocks, conditionTexts, actionNames, bodies));
    }

    private void declarations(Word block) {
        if (!Set.of("VAR", "VAR_INPUT", "VAR_OUTPUT").contains(block.text())) {
            throw words.mistake(block, block.written() + " is not read; expected VAR, VAR_INPUT or VAR_OUTPUT");
        }
        StringBuilder kind = new StringBuilder(block.text());
        while (Set.of("CONSTANT", "RETAIN", "NON_RETAIN").contains(words.look().text())) {
            kind.append(' ').append(words.next().text());
        }
        while (!words.takes("END_VAR")) {
            List<Word> names = new ArrayList<>(List.of(name("a variable")));
            while (words.takes(",")) {
                names.add(name("a variable"));
            }
            String location = "";
            if (words.takes("AT")) {
                location = words.next().text();
                if (!location.startsWith("%")) {
                    throw words.mistake(names.get(0), "AT " + location + "; expected an address such as %IX0.0");
                }
            }
            words.expect(":");
            Word type = words.next();
            if (!TYPES.contains(type.text())) {
                throw words.mistake(type, "'" + type.written() + "' is not read; expected one of " + TYPES.stream().sorted().toList());
            }
            long value = words.takes(":=") ? initial(type.text()) : 0;
            words.expect(";");
            boolean isInput = block.text().equals("VAR_INPUT") || location.startsWith("%I");
            for (Word name : names) {
                add(indexes, name, variables.size());
                blocks.add(kind.toString());
                variables.add(new Variable(name.written(), type.text(), location, isInput, value));
            }
        }
    }

    private long initial(String type) {
        Kind kind = new Variable("", type, "", false, 0).kind();
        State none = new State(List.of(), 0);
        return new Expressions(words, List.of(), Map.of(), Map.of()).of(kind).of().of(none);
    }

    private Word name(String of) {
        Word name = words.name(of);
        if (name.text().length() > LONGEST_NAME) {
            throw words.mistake(name, "a name of " + name.text().length() + " characters; expected at most " + LONGEST_NAME);
        }
        return name;
    }

    private void add(Map<String, Integer> to, Word name, int index) {
        if (to.putIfAbsent(name.text(), index) != null) {
            throw words.mistake(name, name.written() + " is declared twice");
        }
    }

    private void add(String name, Sfc.Action action) {
        actions.add(action);
        actionNames.add(name);
        bodies.add("");
    }

    /** The names of steps and actions. */
    private void names(String end) {
        while (!words.isNext(end)) {
            Word word = words.next();
            switch (word.text()) {
                case "INITIAL_STEP", "STEP" -> {
                    Word name = name("a step");
                    if (word.text().startsWith("INITIAL")) {
                        if (initial >= 0) {
                            throw words.mistake(name, "a second INITIAL_STEP; expected one in a chart");
                        }
                        initial = steps.size();
                    }
                    if (indexes.containsKey(name.text())) {
                        throw words.mistake(name, name.written() + " is a variable already");
                    }
                    add(steps, name, steps.size());
                    stepNames.add(name);
                }
                case "ACTION" -> {
                    Word name = name("an action");
                    add(actionIndexes, name, actions.size());
                    add(name.written(), null);
                }
                case "" -> throw words.mistake(word, "the end of the file; expected " + end);
                default -> { }
            }
        }
        if (initial < 0) {
            throw words.mistake(words.look(), "the program has no INITIAL_STEP; expected a sequential function chart");
        }
    }

    private void step() {
        Word name = words.next();
        words.expect(":");
        while (!words.takes("END_STEP")) {
            Word action = name("an action");
            Association.Qualifier qualifier = Association.Qualifier.N;
            long nanos = 0;
            if (words.takes("(")) {
                if (!words.isNext(")")) {
                    qualifier = qualifier(words.next());
                }
                if (qualifier.isTimed()) {
                    words.expect(",");
                    Word time = words.next();
                    if (!Words.isTime(time)) {
                        throw words.mistake(time, "'" + time.written() + "'; expected a time as written, such as T#1s");
                    }
                    nanos = words.time(time);
                }
                words.expect(")");
            }
            words.expect(";");
            associations.add(new Association(steps.get(name.text()), actionOf(action), qualifier, nanos));
        }
    }

    private Association.Qualifier qualifier(Word word) {
        try {
            return Association.Qualifier.valueOf(word.text());
        } catch (IllegalArgumentException wrong) {
            throw words.mistake(word, "there is no qualifier '" + word.written() + "'; there are "
                + List.of(Association.Qualifier.values()));
        }
    }

    private int actionOf(Word name) {
        Integer known = actionIndexes.get(name.text());
        if (known != null) {
            return known;
        }
        Integer variable = indexes.get(name.text());
        if (variable == null || variables.get(variable).kind() != Kind.BOOL || variables.get(variable).isInput()) {
            throw words.mistake(name, "'" + name.written() + "' is no ACTION, and no variable of type BOOL that a program may write");
        }
        actionIndexes.put(name.text(), actions.size());
        add(name.written(), new Sfc.Action(variable, null));
        return actions.size() - 1;
    }

    private void transition(Expressions expressions) {
        String name = words.isNext("(") || words.isNext("FROM") ? "" : name("a transition").written();
        String priority = NO_PRIORITY;
        if (words.takes("(")) {
            words.expect("PRIORITY");
            words.expect(":=");
            priority = Long.toString(words.number(words.next()));
            words.expect(")");
        }
        words.expect("FROM");
        List<Word> from = stepList();
        words.expect("TO");
        List<Word> to = stepList();
        words.expect(":=");
        int start = words.position();
        conditions.add(expressions.of(Kind.BOOL));
        conditionTexts.add(words.text(start, words.position()));
        words.expect(";");
        words.expect("END_TRANSITION");
        ways.add(new Way(name.isEmpty() ? text(from) + " to " + text(to) : name, priority, from, to));
    }

    private static String text(List<Word> steps) {
        return String.join(", ", steps.stream().limit(MOST_NAMES_SHOWN).map(Word::written).toList())
            + (steps.size() > MOST_NAMES_SHOWN ? ", …" : "");
    }

    private List<Word> stepList() {
        boolean isList = words.takes("(");
        List<Word> all = new ArrayList<>();
        Set<String> seen = new HashSet<>();
        do {
            Word name = name("a step");
            if (!steps.containsKey(name.text())) {
                throw words.mistake(name, "there is no step '" + name.written() + "'; there are "
                    + stepNames.stream().limit(MOST_NAMES_SHOWN).map(Word::written).toList());
            }
            if (!seen.add(name.text())) {
                throw words.mistake(name, "step " + name.written() + " is given twice");
            }
            all.add(name);
        } while (isList && words.takes(","));
        if (isList) {
            words.expect(")");
        }
        return all;
    }

    private PetriNet net(String name) {
        NetBuilder builder = PetriNet.named(name);
        stepNames.forEach(step -> builder.place(step.written(), steps.get(step.text()) == initial ? 1 : 0));
        List<Integer> order = IntStream.range(0, ways.size()).boxed().sorted(Comparator.<Integer>comparingLong(i ->
            ways.get(i).priority.equals(NO_PRIORITY) ? Long.MAX_VALUE : Long.parseLong(ways.get(i).priority))).toList();
        int[] priority = new int[ways.size()];
        for (int rank = 0; rank < order.size(); rank++) {
            priority[order.get(rank)] = order.size() - rank;
        }
        Map<String, Integer> numbers = new HashMap<>();
        for (int i = 0; i < ways.size(); i++) {
            Way way = ways.get(i);
            int number = numbers.merge(way.name, 1, Integer::sum);
            String unique = number == 1 ? way.name : way.name + " (" + number + ")";
            TransitionStep transition = builder.transition(unique).priority(priority[i]);
            way.from.forEach(step -> transition.input(stepNames.get(steps.get(step.text())).written()));
            way.to.forEach(step -> transition.output(stepNames.get(steps.get(step.text())).written()));
        }
        return builder.build();
    }
}
