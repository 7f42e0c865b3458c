package tickbus.simulator.control;

import java.util.ArrayList;
import java.util.Collection;
import java.util.Comparator;
import java.util.HashMap;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import tickbus.simulator.expression.Expression;
import tickbus.simulator.expression.ExpressionException;
import tickbus.simulator.expression.Type;
import tickbus.simulator.text.NearestName;

/**
 * Binds rows to endpoints and sorts them: resolves names to numbers, puts every row after those whose variables it
 * reads, makes their functions, and separates the rows that the machine's inputs depend on from all others.
 */
final class Binder {
    /** A row whose names are resolved. */
    static final class BoundRow {
        final Row row;
        /** Null until the types of its sources are known, and if the row has a mistake. */
        TransferFunction function;
        /** Null for a transfer function. */
        final RowExpression expression;
        /** Indices of the sources in the table's values. */
        final int[] from;
        final List<BoundRow> needs = new ArrayList<>();
        /** Index of the result in the table's values, -1 if it has no variable. */
        final int variable;
        /** Number of the destination, -1 if it has none. */
        final int destination;
        private boolean visited;
        private boolean active;
        private boolean beforeStep;

        BoundRow(Row row, RowExpression expression, int[] from, int variable, int destination) {
            this.row = row;
            this.expression = expression;
            this.from = from;
            this.variable = variable;
            this.destination = destination;
        }
    }

    private final String file;
    private final Endpoints endpoints;
    private final long stepNanos;
    private final List<Mistake> mistakes;
    private final Map<String, Integer> variables = new LinkedHashMap<>();
    private final Map<String, Row> variableRows = new HashMap<>();
    private final Map<String, Row> destinationRows = new HashMap<>();
    private final Map<Integer, BoundRow> makers = new HashMap<>();
    /** Types of values by their indices; none for a variable of the machine. */
    private final Map<Integer, Type> types = new HashMap<>();
    /** The types with which expressions use the others. */
    private final Map<Integer, Type> used = new HashMap<>();

    private final List<BoundRow> beforeStep = new ArrayList<>();
    private final List<BoundRow> afterStep = new ArrayList<>();

    Binder(String file, Endpoints endpoints, long stepNanos, List<Mistake> mistakes) {
        this.file = file;
        this.endpoints = endpoints;
        this.stepNanos = stepNanos;
        this.mistakes = mistakes;
    }

    void bind(List<Row> rows) {
        for (Row row : rows) {
            declare(row);
        }
        List<BoundRow> bound = new ArrayList<>();
        for (Row row : rows) {
            bound.add(bind(row));
        }
        bindModel(bound);
        for (BoundRow row : bound) {
            for (int index : row.from) {
                if (makers.containsKey(index)) {
                    row.needs.add(makers.get(index));
                }
            }
        }
        List<BoundRow> ordered = new ArrayList<>();
        for (BoundRow row : bound) {
            visit(row, new ArrayList<>(), ordered);
        }
        endpoints.sources().values().forEach(index -> types.put(index, endpoints.sourceType(index)));
        ordered.forEach(this::makeFunction);
        for (BoundRow row : ordered) {
            if (row.destination >= 0 && endpoints.isMachineInput(row.destination)) {
                markBeforeStep(row);
            }
        }
        for (BoundRow row : ordered) {
            (row.beforeStep ? beforeStep : afterStep).add(row);
        }
        mistakes.sort(Comparator.comparingInt(Mistake::line).thenComparingInt(Mistake::column));
    }

    List<BoundRow> beforeStep() {
        return beforeStep;
    }

    List<BoundRow> afterStep() {
        return afterStep;
    }

    /** Variables and their indices in the table's values, after the sources. */
    Map<String, Integer> variables() {
        return variables;
    }

    private void declare(Row row) {
        if (!row.variable().isEmpty()) {
            Row earlier = variableRows.putIfAbsent(row.variable(), row);
            if (earlier == null) {
                variables.put(row.variable(), endpoints.sources().size() + variables.size());
            } else {
                mistake(row, "variable \"" + row.variable() + "\" already gets its value in line " + earlier.line());
            }
        }
        if (!row.destination().isEmpty()) {
            Row earlier = destinationRows.putIfAbsent(row.destination(), row);
            if (earlier != null) {
                mistake(row, "destination \"" + row.destination() + "\" is already written in line "
                        + earlier.line());
            }
        }
    }

    private BoundRow bind(Row row) {
        int[] from = row.sources().stream().mapToInt(name -> source(row, name)).toArray();
        int destination = row.destination().isEmpty() ? -1 : destination(row);
        int variable = row.variable().isEmpty() ? -1 : variables.get(row.variable());
        RowExpression expression = TransferFunctions.isCall(row.transfer(), variables.keySet()) ? null
                : new RowExpression(row, from, this);
        BoundRow bound = new BoundRow(row, expression, expression == null ? from : expression.read(), variable, destination);
        if (variable >= 0) {
            makers.putIfAbsent(variable, bound);
        }
        return bound;
    }

    /** Connects components that are named as a variable of the model, and have no row, with this variable. */
    private void bindModel(List<BoundRow> bound) {
        for (String name : endpoints.destinations().keySet()) {
            String source = name.substring(name.indexOf(':') + 1);
            if (source.startsWith(Endpoints.MODEL + ":") && endpoints.sources().containsKey(source)
                    && !destinationRows.containsKey(name)) {
                bound.add(bind(new Row(0, List.of(source), "", "", "", 0, name)));
            }
        }
    }

    /** Makes a row's function, after those of the rows that it reads. */
    private void makeFunction(BoundRow bound) {
        Row row = bound.row;
        Type type = null;
        try {
            if (bound.expression == null) {
                bound.function = TransferFunctions.read(row.transfer(), bound.from.length, stepNanos);
                type = TransferFunctions.result(row.transfer(), bound.from.length == 0 ? null : types.get(bound.from[0]));
            } else if (bound.expression.isRight()) {
                Expression.Compiled compiled = bound.expression.compile(stepNanos);
                type = compiled.type();
                Expression.Value value = compiled.value();
                bound.function = (values, from) -> value.of(values);
                checkDestination(bound, compiled);
            }
        } catch (ExpressionException e) {
            mistake(row, e.offset(), e.getMessage());
        } catch (IllegalArgumentException e) {
            mistake(row, e.getMessage());
        }
        if (bound.variable >= 0) {
            types.put(bound.variable, type);
        }
    }

    private void checkDestination(BoundRow bound, Expression.Compiled compiled) {
        Type type = compiled.type();
        Type wanted = bound.destination < 0 ? null : endpoints.destinationType(bound.destination);
        if (type != null && wanted != null && (type == Type.BOOL) != (wanted == Type.BOOL)) {
            mistake(bound.row, compiled.offset(), "the result is " + type + ", and \"" + bound.row.destination() + "\" is "
                    + (wanted == Type.BOOL ? "BOOL; compare it, such as … <> 0" : "a number; write SEL(…, 0, 1)"));
        }
    }

    /** Types of values by their indices. */
    Map<Integer, Type> types() {
        return types;
    }

    /** The types with which expressions use values without a type, by their indices. */
    Map<Integer, Type> used() {
        return used;
    }

    private int source(Row row, String name) {
        try {
            return find(name);
        } catch (IllegalArgumentException e) {
            mistake(row, e.getMessage());
            return -1;
        }
    }

    /**
     * The index of a variable or source.
     *
     * @throws IllegalArgumentException with a text for people, if nothing that can be read has this name
     */
    int find(String name) {
        Integer index = name.indexOf(':') < 0 ? variables.get(name) : endpoints.sources().get(name);
        if (index != null) {
            return index;
        }
        if (endpoints.destinations().containsKey(name)) {
            throw new IllegalArgumentException("\"" + name + "\" can only be written; it is a destination, not a source");
        }
        if (name.indexOf(':') < 0) {
            List<String> known = new ArrayList<>(variables.keySet());
            known.addAll(endpoints.sources().keySet());
            String hint = endpoints.sources().containsKey(Endpoints.MACHINE + ":" + name)
                    ? "; did you mean \"" + Endpoints.MACHINE + ":" + name + "\"?"
                    : NearestName.hint(name, known);
            throw new IllegalArgumentException("no row gives variable \"" + name + "\" a value" + hint);
        }
        throw new IllegalArgumentException(unknown("source", name, endpoints.sources().keySet()));
    }

    private int destination(Row row) {
        String name = row.destination();
        Integer index = endpoints.destinations().get(name);
        if (index != null) {
            return index;
        }
        if (endpoints.sources().containsKey(name)) {
            mistake(row, "\"" + name + "\" can only be read; it is a source, not a destination");
        } else if (name.indexOf(':') < 0) {
            mistake(row, "\"" + name + "\" is no destination; write <driver id>:<component> or machine:<variable>"
                    + NearestName.hint(name, endpoints.destinations().keySet()));
        } else {
            mistake(row, unknown("destination", name, endpoints.destinations().keySet()));
        }
        return -1;
    }

    private static String unknown(String kind, String name, Collection<String> known) {
        String owner = name.substring(0, name.indexOf(':') + 1);
        boolean ownerKnown = known.stream().anyMatch(other -> other.startsWith(owner));
        List<String> owners = known.stream().map(other -> other.substring(0, other.indexOf(':') + 1)).distinct()
                .toList();
        return "there is no " + kind + " \"" + name + "\"" + (ownerKnown || owners.isEmpty() ? ""
                : "; names begin with one of " + String.join(" ", owners)) + NearestName.hint(name, known);
    }

    /** Depth-first in file order, so that independent rows keep that order. */
    private void visit(BoundRow row, List<BoundRow> path, List<BoundRow> ordered) {
        if (row.active) {
            List<BoundRow> cycle = path.subList(path.indexOf(row), path.size());
            StringBuilder names = new StringBuilder();
            cycle.forEach(one -> names.append(one.row.result()).append(" -> "));
            names.append(row.row.result());
            BoundRow first = cycle.stream().min(Comparator.comparingInt(one -> one.row.line())).orElseThrow();
            mistake(first.row, "a cycle, each value waits for the next: " + names);
            return;
        }
        if (row.visited) {
            return;
        }
        row.visited = true;
        row.active = true;
        path.add(row);
        for (BoundRow needed : row.needs) {
            visit(needed, path, ordered);
        }
        path.remove(path.size() - 1);
        row.active = false;
        ordered.add(row);
    }

    private static void markBeforeStep(BoundRow row) {
        if (!row.beforeStep) {
            row.beforeStep = true;
            row.needs.forEach(Binder::markBeforeStep);
        }
    }

    private void mistake(Row row, String what) {
        mistakes.add(new Mistake(file, row.line(), what));
    }

    /** A mistake at a place of the row's expression. */
    void mistake(Row row, int offset, String what) {
        mistakes.add(new Mistake(file, row.line(), row.column() + offset, what));
    }
}
