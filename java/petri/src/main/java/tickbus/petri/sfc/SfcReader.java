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
        String end = "END_" + words.next().text();
        String name = words.name("the program").written();
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
                    Word action = words.name("an action");
                    words.expect(":");
                    actions.set(actionIndexes.get(action.text()), new Sfc.Action(-1, expressions.statements("END_ACTION", "")));
                    words.expect("END_ACTION");
                }
                default -> throw words.mistake(word, "'" + word.written() + "'; expected STEP, TRANSITION, ACTION or " + end);
            }
        }
        return new Sfc(net(name), variables, conditions, associations, actions);
    }

    private void declarations(Word block) {
        if (!Set.of("VAR", "VAR_INPUT", "VAR_OUTPUT").contains(block.text())) {
            throw words.mistake(block, block.written() + " is not read; expected VAR, VAR_INPUT or VAR_OUTPUT");
        }
        while (Set.of("CONSTANT", "RETAIN", "NON_RETAIN").contains(words.look().text())) {
            words.next();
        }
        while (!words.takes("END_VAR")) {
            List<Word> names = new ArrayList<>(List.of(words.name("a variable")));
            while (words.takes(",")) {
                names.add(words.name("a variable"));
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
                variables.add(new Variable(name.written(), type.text(), location, isInput, value));
            }
        }
    }

    private long initial(String type) {
        Kind kind = new Variable("", type, "", false, 0).kind();
        State none = new State(List.of(), 0);
        return new Expressions(words, List.of(), Map.of(), Map.of()).of(kind).of().of(none);
    }

    private void add(Map<String, Integer> to, Word name, int index) {
        if (to.putIfAbsent(name.text(), index) != null) {
            throw words.mistake(name, name.written() + " is declared twice");
        }
    }

    /** The names of steps and actions. */
    private void names(String end) {
        while (!words.isNext(end)) {
            Word word = words.next();
            switch (word.text()) {
                case "INITIAL_STEP", "STEP" -> {
                    Word name = words.name("a step");
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
                    add(actionIndexes, words.name("an action"), actions.size());
                    actions.add(null);
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
            Word action = words.name("an action");
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
        actions.add(new Sfc.Action(variable, null));
        return actions.size() - 1;
    }

    private void transition(Expressions expressions) {
        String name = words.isNext("(") || words.isNext("FROM") ? "" : words.name("a transition").written();
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
        conditions.add(expressions.of(Kind.BOOL));
        words.expect(";");
        words.expect("END_TRANSITION");
        ways.add(new Way(name.isEmpty() ? text(from) + " to " + text(to) : name, priority, from, to));
    }

    private static String text(List<Word> steps) {
        return String.join(", ", steps.stream().map(Word::written).toList());
    }

    private List<Word> stepList() {
        boolean isList = words.takes("(");
        List<Word> all = new ArrayList<>();
        do {
            Word name = words.name("a step");
            if (!steps.containsKey(name.text())) {
                throw words.mistake(name, "there is no step '" + name.written() + "'; there are "
                    + stepNames.stream().map(Word::written).toList());
            }
            if (all.stream().anyMatch(one -> one.text().equals(name.text()))) {
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
        Set<String> taken = new HashSet<>();
        for (int i = 0; i < ways.size(); i++) {
            Way way = ways.get(i);
            String unique = way.name;
            for (int number = 2; !taken.add(unique); number++) {
                unique = way.name + " (" + number + ")";
            }
            TransitionStep transition = builder.transition(unique).priority(priority[i]);
            way.from.forEach(step -> transition.input(stepNames.get(steps.get(step.text())).written()));
            way.to.forEach(step -> transition.output(stepNames.get(steps.get(step.text())).written()));
        }
        return builder.build();
    }
}
