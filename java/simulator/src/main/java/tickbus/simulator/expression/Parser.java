package tickbus.simulator.expression;

import java.util.ArrayList;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.Set;
import tickbus.simulator.text.NearestName;

/** Makes the node of an expression: a recursive-descent parser for the grammar of IEC 61131-3, annex B.3.1. */
final class Parser {
    /** Functions and blocks in the order of the help. */
    static final Map<String, Callable> CALLABLES = new LinkedHashMap<>();

    /** Operators from the weakest to the strongest; operators of one level are computed from left to right. */
    private static final List<Set<String>> LEVELS = List.of(Set.of("OR"), Set.of("XOR"), Set.of("AND", "&"),
            Set.of("=", "<>"), Set.of("<", ">", "<=", ">="), Set.of("+", "-"), Set.of("*", "/", "MOD"));

    private static final Set<String> RESERVED = Set.of("OR", "XOR", "AND", "MOD", "NOT", "TRUE", "FALSE");

    /** More would be no expression that a person reads. Nodes call one another as deep as that. */
    private static final int MOST_TOKENS = 1000;
    private static final int MOST_NESTED = 50;

    static {
        Functions.ALL.forEach(one -> CALLABLES.put(one.name(), one));
        Blocks.ALL.forEach(one -> CALLABLES.put(one.name(), one));
    }

    private final List<Token> tokens;
    private final Names names;
    private final Typing typing;
    private final Operators operators;
    private final long stepNanos;
    private int next;
    private int nested;

    Parser(List<Token> tokens, Names names, long stepNanos) {
        this.tokens = tokens;
        this.names = names;
        this.stepNanos = stepNanos;
        typing = new Typing(names);
        operators = new Operators(typing);
    }

    /** The names in an expression. */
    static List<Token> names(List<Token> tokens) {
        List<Token> found = new ArrayList<>();
        for (int i = 0; i < tokens.size() - 1; i++) {
            Token token = tokens.get(i);
            Token behind = tokens.get(i + 1);
            boolean member = i > 0 && tokens.get(i - 1).is(".");
            if (token.kind() == Token.Kind.QUOTED || token.kind() == Token.Kind.WORD && !isReserved(token)
                    && !behind.is("(") && !behind.is(":=") && !member) {
                found.add(token);
            }
        }
        return found;
    }

    private static boolean isReserved(Token token) {
        return RESERVED.contains(token.text().toUpperCase(Locale.ROOT));
    }

    Node parse() {
        if (tokens.size() > MOST_TOKENS) {
            throw new ExpressionException(tokens.get(MOST_TOKENS).offset(), "the expression is too long; give parts of it"
                    + " a row and a variable each");
        }
        Node node = level(0);
        if (peek().kind() != Token.Kind.END) {
            throw new ExpressionException(peek().offset(), "an operator is expected before " + peek().told());
        }
        return node;
    }

    private Token peek() {
        return tokens.get(next);
    }

    private Token take() {
        return tokens.get(next++);
    }

    private Node level(int level) {
        if (level == LEVELS.size()) {
            return unary();
        }
        Node left = level(level + 1);
        while (operator(LEVELS.get(level))) {
            Token sign = take();
            left = operators.binary(sign.text().toUpperCase(Locale.ROOT), sign.offset(), left, level(level + 1));
        }
        return left;
    }

    private boolean operator(Set<String> signs) {
        Token token = peek();
        return (token.kind() == Token.Kind.SIGN || token.kind() == Token.Kind.WORD)
                && signs.contains(token.text().toUpperCase(Locale.ROOT));
    }

    private Node unary() {
        Token token = peek();
        if (token.is("-") || token.isWord("NOT")) {
            take();
            deeper(token);
            Node node = unary();
            nested--;
            return token.is("-") ? operators.negative(token.offset(), node) : operators.not(token.offset(), node);
        }
        return primary();
    }

    private void deeper(Token token) {
        nested++;
        if (nested > MOST_NESTED) {
            throw new ExpressionException(token.offset(), "the expression is nested too deeply; give parts of it a row"
                    + " and a variable each");
        }
    }

    private Node primary() {
        Token token = take();
        long number = token.number();
        switch (token.kind()) {
            case WHOLE:
                return Node.literal(token.offset(), number);
            case REAL:
                double real = Double.longBitsToDouble(number);
                return Node.real(token.offset(), values -> real);
            case TIME:
                return Node.time(token.offset(), values -> number);
            case QUOTED:
                return name(token);
            case WORD:
                if (token.isWord("TRUE") || token.isWord("FALSE")) {
                    boolean truth = token.isWord("TRUE");
                    return Node.truth(token.offset(), values -> truth);
                }
                if (!isReserved(token)) {
                    return peek().is("(") ? call(token) : name(token);
                }
                break;
            default:
                if (token.is("(")) {
                    deeper(token);
                    Node node = level(0);
                    nested--;
                    expect(")");
                    return node;
                }
        }
        throw new ExpressionException(token.offset(), "a value is expected in the place of " + token.told());
    }

    private void expect(String sign) {
        if (!peek().is(sign)) {
            throw new ExpressionException(peek().offset(), "\"" + sign + "\" is expected in the place of " + peek().told());
        }
        take();
    }

    private Node name(Token token) {
        try {
            int index = names.index(token.text());
            return Node.value(token.offset(), token.text(), index, names.type(index));
        } catch (IllegalArgumentException e) {
            throw new ExpressionException(token.offset(), e.getMessage());
        }
    }

    private Node call(Token name) {
        Callable callable = CALLABLES.get(name.text().toUpperCase(Locale.ROOT));
        if (callable == null) {
            String hint = NearestName.hint(name.text(), CALLABLES.keySet());
            throw new ExpressionException(name.offset(), "there is no function or block \"" + name.text() + "\""
                    + (hint.isEmpty() ? "; there are " + String.join(", ", CALLABLES.keySet()) : hint));
        }
        List<Node> arguments = arguments(name, callable);
        Token output = null;
        if (peek().is(".")) {
            take();
            output = take();
            String wanted = output.text().toUpperCase(Locale.ROOT);
            if (!callable.outputs().contains(wanted)) {
                throw new ExpressionException(output.offset(), callable.name() + " has no output " + output.told()
                        + (callable.outputs().isEmpty() ? "; functions have none"
                                : "; there are " + String.join(", ", callable.outputs())));
            }
        }
        return callable.maker().make(typing, new Call(callable.name(), name.offset(), arguments,
                output == null ? null : output.text().toUpperCase(Locale.ROOT), stepNanos));
    }

    /** The arguments in the order of the parameters; written in this order, or each with its parameter's name. */
    private List<Node> arguments(Token name, Callable callable) {
        deeper(take());
        Map<String, Node> named = new LinkedHashMap<>();
        List<Node> arguments = new ArrayList<>();
        boolean more = !peek().is(")");
        while (more) {
            if (peek().kind() == Token.Kind.WORD && tokens.get(next + 1).is(":=")) {
                named(callable, named);
            } else {
                arguments.add(level(0));
            }
            more = peek().is(",");
            if (more) {
                take();
            }
        }
        nested--;
        expect(")");
        if (!named.isEmpty() && arguments.isEmpty()) {
            callable.parameters().stream().filter(named::containsKey).map(named::get).forEach(arguments::add);
        } else if (!named.isEmpty()) {
            throw new ExpressionException(name.offset(), "name all arguments of " + callable.name() + " or none; right is "
                    + callable.shape());
        }
        int count = arguments.size();
        int least = callable.parameters().size();
        if (count < least || count > least && !callable.open()) {
            throw new ExpressionException(name.offset(), callable.name() + " has " + count
                    + (count == 1 ? " argument" : " arguments") + "; right is " + callable.shape());
        }
        return arguments;
    }

    private void named(Callable callable, Map<String, Node> named) {
        Token parameter = take();
        take();
        String key = parameter.text().toUpperCase(Locale.ROOT);
        if (!callable.parameters().contains(key)) {
            throw new ExpressionException(parameter.offset(), callable.name() + " has no input " + parameter.told()
                    + "; right is " + callable.shape());
        }
        if (named.put(key, level(0)) != null) {
            throw new ExpressionException(parameter.offset(), "input " + parameter.told() + " is given twice");
        }
    }
}
