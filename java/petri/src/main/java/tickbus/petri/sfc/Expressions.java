package tickbus.petri.sfc;

import java.util.ArrayList;
import java.util.List;
import java.util.Map;

/** Reads expressions and statements in Structured Text. */
final class Expressions {
    private static final int DEEPEST = 100;
    /** Each operator is a call within a call when the expression is evaluated. */
    private static final int MOST_OPERATORS = 2_000;
    private static final List<List<String>> LEVELS = List.of(List.of("OR"), List.of("XOR"), List.of("AND", "&"),
        List.of("=", "<>"), List.of("<", ">", "<=", ">="), List.of("+", "-"), List.of("*", "/", "MOD"));

    private final Words words;
    private final List<Variable> variables;
    private final Map<String, Integer> indexes;
    private final Map<String, Integer> steps;
    private int depth;
    private int operators;

    /** The names are in capitals. */
    Expressions(Words words, List<Variable> variables, Map<String, Integer> indexes, Map<String, Integer> steps) {
        this.words = words;
        this.variables = variables;
        this.indexes = indexes;
        this.steps = steps;
    }

    /** An expression of this type. */
    Value of(Kind kind) {
        Word first = words.look();
        operators = 0;
        Value value = level(0);
        if (value.kind() != kind) {
            throw words.mistake(first, "this is " + value.kind() + "; expected " + kind);
        }
        return value;
    }

    private Value level(int level) {
        if (level == LEVELS.size()) {
            return unary();
        }
        Value left = level(level + 1);
        while (LEVELS.get(level).contains(words.look().text())) {
            Word sign = words.next();
            if (++operators > MOST_OPERATORS) {
                throw words.mistake(sign, "more than " + MOST_OPERATORS + " operators in one expression");
            }
            left = binary(sign, left, level(level + 1));
        }
        return left;
    }

    private Value binary(Word sign, Value left, Value right) {
        if (left.kind() != right.kind()) {
            throw words.mistake(sign, sign.written() + " between " + left.kind() + " and " + right.kind() + "; expected two of one type");
        }
        Kind kind = left.kind();
        Value.Of a = left.of();
        Value.Of b = right.of();
        Value result = switch (sign.text()) {
            case "OR" -> new Value(Kind.BOOL, s -> a.of(s) | b.of(s));
            case "XOR" -> new Value(Kind.BOOL, s -> a.of(s) ^ b.of(s));
            case "AND", "&" -> new Value(Kind.BOOL, s -> a.of(s) & b.of(s));
            case "=" -> new Value(Kind.BOOL, s -> a.of(s) == b.of(s) ? 1 : 0);
            case "<>" -> new Value(Kind.BOOL, s -> a.of(s) != b.of(s) ? 1 : 0);
            case "<" -> new Value(Kind.BOOL, s -> a.of(s) < b.of(s) ? 1 : 0);
            case ">" -> new Value(Kind.BOOL, s -> a.of(s) > b.of(s) ? 1 : 0);
            case "<=" -> new Value(Kind.BOOL, s -> a.of(s) <= b.of(s) ? 1 : 0);
            case ">=" -> new Value(Kind.BOOL, s -> a.of(s) >= b.of(s) ? 1 : 0);
            case "+" -> new Value(kind, s -> a.of(s) + b.of(s));
            case "-" -> new Value(kind, s -> a.of(s) - b.of(s));
            case "*" -> new Value(kind, s -> a.of(s) * b.of(s));
            case "/" -> new Value(kind, s -> b.of(s) == 0 ? 0 : a.of(s) / b.of(s));
            default -> new Value(kind, s -> b.of(s) == 0 ? 0 : a.of(s) % b.of(s));
        };
        boolean isLogic = List.of("OR", "XOR", "AND", "&").contains(sign.text());
        boolean isSum = List.of("+", "-").contains(sign.text());
        boolean isProduct = List.of("*", "/", "MOD").contains(sign.text());
        if (isLogic && kind != Kind.BOOL || (isSum || isProduct) && kind == Kind.BOOL || isProduct && kind == Kind.TIME) {
            throw words.mistake(sign, sign.written() + " does not work on " + kind);
        }
        return result;
    }

    private Value unary() {
        Word word = words.look();
        if (++depth > DEEPEST) {
            throw words.mistake(word, "more than " + DEEPEST + " brackets or signs within each other");
        }
        Value value;
        if (words.takes("NOT")) {
            Value of = unary();
            check(word, of, Kind.BOOL);
            value = new Value(Kind.BOOL, s -> of.of().of(s) ^ 1);
        } else if (words.takes("-")) {
            Value of = unary();
            check(word, of, Kind.NUMBER);
            value = new Value(Kind.NUMBER, s -> -of.of().of(s));
        } else if (words.takes("(")) {
            value = level(0);
            words.expect(")");
        } else {
            value = operand(words.next());
        }
        depth--;
        return value;
    }

    private void check(Word at, Value value, Kind kind) {
        if (value.kind() != kind) {
            throw words.mistake(at, at.written() + " of " + value.kind() + "; expected " + kind);
        }
    }

    private Value operand(Word word) {
        if (Words.isTime(word)) {
            long nanos = words.time(word);
            return new Value(Kind.TIME, s -> nanos);
        }
        if (Character.isDigit(word.written().charAt(0))) {
            long number = words.number(word);
            return new Value(Kind.NUMBER, s -> number);
        }
        if (word.text().equals("TRUE") || word.text().equals("FALSE")) {
            long truth = word.text().equals("TRUE") ? 1 : 0;
            return new Value(Kind.BOOL, s -> truth);
        }
        Integer step = steps.get(word.text());
        if (step != null) {
            int index = step;
            words.expect(".");
            Word what = words.next();
            return switch (what.text()) {
                case "X" -> new Value(Kind.BOOL, s -> s.active[index] ? 1 : 0);
                case "T" -> new Value(Kind.TIME, s -> s.nanos[index]);
                default -> throw words.mistake(what, "a step has no '" + what.written() + "'; it has X and T");
            };
        }
        int index = variable(word);
        return new Value(variables.get(index).kind(), s -> s.values[index]);
    }

    private int variable(Word word) {
        Integer index = indexes.get(word.text());
        if (index == null || words.isNext("(")) {
            throw words.mistake(word, words.isNext("(") ? "a call of '" + word.written() + "'; functions and function blocks are not read"
                : "there is no variable or step '" + word.written() + "'; there are " + variables.stream().map(Variable::name).toList());
        }
        return index;
    }

    /** Statements up to one of these words, which it does not take. */
    Statement statements(String... ends) {
        List<Statement> all = new ArrayList<>();
        while (!List.of(ends).contains(words.look().text())) {
            all.add(statement());
        }
        return Statement.all(all);
    }

    private Statement statement() {
        Word first = words.next();
        if (first.text().equals(";")) {
            return state -> { };
        }
        if (first.text().equals("IF")) {
            Statement made = branch(first);
            words.takes(";");
            return made;
        }
        if (!indexes.containsKey(first.text()) || !words.isNext(":=")) {
            throw words.mistake(first, "'" + first.written() + "'; expected an assignment to a variable, or IF; nothing else is read in actions");
        }
        int index = variable(first);
        Variable variable = variables.get(index);
        if (variable.isInput()) {
            throw words.mistake(first, variable.name() + " is an input; expected a variable that a program may write");
        }
        words.expect(":=");
        Value value = of(variable.kind());
        words.expect(";");
        return state -> state.values[index] = variable.wrapped(value.of().of(state));
    }

    private Statement branch(Word first) {
        if (++depth > DEEPEST) {
            throw words.mistake(first, "more than " + DEEPEST + " branches of IF within each other");
        }
        Value condition = of(Kind.BOOL);
        words.expect("THEN");
        Statement then = statements("ELSIF", "ELSE", "END_IF", "");
        Statement otherwise = state -> { };
        if (words.isNext("ELSIF")) {
            otherwise = branch(words.next());
        } else {
            if (words.takes("ELSE")) {
                otherwise = statements("END_IF", "");
            }
            words.expect("END_IF");
        }
        depth--;
        Statement last = otherwise;
        return state -> {
            if (condition.holds(state)) {
                then.run(state);
            } else {
                last.run(state);
            }
        };
    }
}
