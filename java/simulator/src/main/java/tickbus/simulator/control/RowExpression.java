package tickbus.simulator.control;

import java.util.BitSet;
import java.util.List;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import java.util.stream.IntStream;
import tickbus.simulator.expression.Expression;
import tickbus.simulator.expression.ExpressionException;
import tickbus.simulator.expression.Names;
import tickbus.simulator.expression.Type;

/**
 * One row's expression, and the names that it can use: the sources of its source column as {@code IN1}, {@code IN2}, …, or
 * {@code IN} where there is one; the table's variables; and all sources, in double quotes.
 */
final class RowExpression implements Names {
    private static final Pattern COLUMN = Pattern.compile("(?i)IN([1-9]\\d{0,3})?");

    private final Row row;
    /** Indices of the sources in the source column; -1 for a wrong one. */
    private final int[] column;
    private final Binder binder;
    private final BitSet used = new BitSet();
    private Expression expression;
    private boolean right;

    RowExpression(Row row, int[] column, Binder binder) {
        this.row = row;
        this.column = column;
        this.binder = binder;
    }

    /**
     * Reads the expression, and resolves its names; reports mistakes to the binder.
     *
     * @return the indices of the values that it reads
     */
    int[] read() {
        try {
            expression = Expression.read(row.expression());
        } catch (ExpressionException e) {
            binder.mistake(row, e.offset(), e.getMessage());
            return new int[0];
        }
        right = IntStream.of(column).allMatch(index -> index >= 0);
        List<Expression.Name> names = expression.names();
        int[] read = names.stream().mapToInt(this::find).filter(index -> index >= 0).toArray();
        int unused = used.nextClearBit(0);
        if (right && unused < column.length) {
            right = false;
            binder.mistake(row, 0, "the expression does not use the source \"" + row.sources().get(unused)
                    + "\"; its name there is " + (column.length == 1 ? "IN" : "IN" + (unused + 1)));
        }
        return read;
    }

    private int find(Expression.Name name) {
        try {
            return index(name.text());
        } catch (IllegalArgumentException e) {
            binder.mistake(row, name.offset(), e.getMessage());
            right = false;
            return -1;
        }
    }

    /** Returns whether {@link #read} found no mistake. */
    boolean isRight() {
        return right;
    }

    /**
     * Compiles the expression, after the rows that it reads.
     *
     * @throws ExpressionException with the first mistake
     */
    Expression.Compiled compile(long stepNanos) {
        return expression.compile(this, stepNanos);
    }

    @Override
    public int index(String name) {
        Matcher matcher = COLUMN.matcher(name);
        if (column.length == 0 || !matcher.matches()) {
            return binder.find(name);
        }
        int place = matcher.group(1) == null ? 0 : Integer.parseInt(matcher.group(1)) - 1;
        if (place >= column.length || matcher.group(1) == null && column.length > 1) {
            throw new IllegalArgumentException("\"" + name + "\" is no source of this row; "
                    + (column.length == 1 ? "it has IN" : "it has IN1 to IN" + column.length));
        }
        used.set(place);
        return column[place];
    }

    @Override
    public Type type(int index) {
        return binder.types().get(index);
    }

    @Override
    public Type used(int index) {
        return binder.used().get(index);
    }

    @Override
    public void use(int index, Type type) {
        binder.used().put(index, type);
    }
}
