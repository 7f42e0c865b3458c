package tickbus.simulator.expression;

import java.util.Collections;
import java.util.List;
import java.util.Set;
import tickbus.simulator.text.Columns;

/**
 * An expression in Structured Text, as IEC 61131-3 defines it.
 *
 * <ul>
 * <li>Operators, from the strongest: {@code -} and {@code NOT}; {@code * / MOD}; {@code + -}; {@code < > <= >=}; {@code =
 *       <>}; {@code AND &}; {@code XOR}; {@code OR}.
 *   <li>Literals: {@code TRUE}, {@code 12}, {@code 16#FF}, {@code 2.5}, {@code T#1m30s}.
 *   <li>Names, as they are or in double quotes.
 *   <li>Functions and blocks, which {@link #help} lists, with arguments in their order or by name: {@code TON(IN := a, PT :=
 *       T#1s)}. A block's value is its first output; {@code .ET} behind its bracket takes another one.
 * </ul>
 *
 * <p>The types are those of {@link Type}. Nothing is converted silently, except that a whole number as written is an LREAL
 * beside one. Both sides of an operator and all arguments are computed in every tick. A LINT divided by 0 is 0.
 */
public final class Expression {
    private final List<Token> tokens;

    private Expression(List<Token> tokens) {
        this.tokens = tokens;
    }

    /**
     * A name in an expression.
     *
     * @param text without quotes
     * @param offset characters from the beginning of the expression
     */
    public record Name(String text, int offset) {
    }

    /** Computes the value of a tick. */
    @FunctionalInterface
    public interface Value {
        /**
         * The value as a table keeps it; to be called once per tick.
         *
         * @param values all values of the table
         * @return 0 or 1 for a BOOL
         */
        double of(double[] values);
    }

    /**
     * An expression that can be computed.
     *
     * @param type its type, never TIME; null for a name without a type
     * @param offset the place of its result, for messages: characters from the beginning of the expression
     * @param value its value
     */
    public record Compiled(Type type, int offset, Value value) {
    }

    /**
     * Reads an expression as far as that is possible without its names' types.
     *
     * @param text the expression
     * @return the expression
     * @throws ExpressionException if a character begins no word, literal or sign
     */
    public static Expression read(String text) {
        return new Expression(Lexer.tokens(text));
    }

    /**
     * The names of the functions and blocks.
     *
     * @return in capitals, in the order of {@link #help}
     */
    public static Set<String> functions() {
        return Collections.unmodifiableSet(Parser.CALLABLES.keySet());
    }

    /**
     * The names in the expression.
     *
     * @return in the order of the text, also those that come several times
     */
    public List<Name> names() {
        return Parser.names(tokens).stream().map(token -> new Name(token.text(), token.offset())).toList();
    }

    /**
     * Checks the types, and makes what computes the expression. Each call makes new blocks, without a past.
     *
     * @param names the table's names
     * @param stepNanos time from one tick to the next, above 0
     * @return the expression, ready for its first tick
     * @throws ExpressionException with the first mistake
     */
    public Compiled compile(Names names, long stepNanos) {
        Node node = new Parser(tokens, names, stepNanos).parse();
        if (node.type == Type.TIME) {
            throw new ExpressionException(node.offset, "the result is TIME; write TO_LREAL(…), which gives seconds");
        }
        Node.Real stored = node.stored();
        return new Compiled(node.type, node.offset, stored::of);
    }

    /**
     * The functions and blocks, for people.
     *
     * @return a table with one line for each
     */
    public static String help() {
        Columns table = new Columns("function", "result");
        Parser.CALLABLES.values().forEach(one -> table.row(one.shape()
                + (one.outputs().size() > 1 ? " ." + String.join(" .", one.outputs()) : ""), one.meaning()));
        return table.text("  ");
    }
}
