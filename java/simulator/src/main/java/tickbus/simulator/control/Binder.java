package tickbus.simulator.control;

import java.util.ArrayList;
import java.util.Collection;
import java.util.Comparator;
import java.util.HashMap;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import tickbus.simulator.text.NearestName;

/**
 * Binds rows to endpoints and sorts them: resolves names to numbers, puts every row after those whose variables it
 * reads, and separates the rows that the machine's inputs depend on from all others.
 */
final class Binder {
    /** A row whose names are resolved. */
    static final class BoundRow {
        final Row row;
        final TransferFunction function;
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

        BoundRow(Row row, TransferFunction function, int[] from, int variable, int destination) {
            this.row = row;
            this.function = function;
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
            BoundRow one = bind(row);
            if (one != null) {
                bound.add(one);
            }
        }
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
        for (BoundRow row : ordered) {
            if (row.destination >= 0 && endpoints.isMachineInput(row.destination)) {
                markBeforeStep(row);
            }
        }
        for (BoundRow row : ordered) {
            (row.beforeStep ? beforeStep : afterStep).add(row);
        }
        mistakes.sort(Comparator.comparingInt(Mistake::line));
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
        TransferFunction function = null;
        try {
            function = TransferFunctions.read(row.transfer(), from.length, stepNanos);
        } catch (IllegalArgumentException e) {
            mistake(row, e.getMessage());
        }
        int variable = row.variable().isEmpty() ? -1 : variables.get(row.variable());
        BoundRow bound = new BoundRow(row, function, from, variable, destination);
        if (variable >= 0) {
            makers.putIfAbsent(variable, bound);
        }
        return bound;
    }

    private int source(Row row, String name) {
        Integer index = name.indexOf(':') < 0 ? variables.get(name) : endpoints.sources().get(name);
        if (index != null) {
            return index;
        }
        if (endpoints.destinations().containsKey(name)) {
            mistake(row, "\"" + name + "\" can only be written; it is a destination, not a source");
        } else if (name.indexOf(':') < 0) {
            List<String> known = new ArrayList<>(variables.keySet());
            known.addAll(endpoints.sources().keySet());
            String hint = endpoints.sources().containsKey(Endpoints.MACHINE + ":" + name)
                    ? "; did you mean \"" + Endpoints.MACHINE + ":" + name + "\"?"
                    : NearestName.hint(name, known);
            mistake(row, "no row gives variable \"" + name + "\" a value" + hint);
        } else {
            unknown(row, "source", name, endpoints.sources().keySet());
        }
        return -1;
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
            unknown(row, "destination", name, endpoints.destinations().keySet());
        }
        return -1;
    }

    private void unknown(Row row, String kind, String name, Collection<String> known) {
        String owner = name.substring(0, name.indexOf(':') + 1);
        boolean ownerKnown = known.stream().anyMatch(other -> other.startsWith(owner));
        List<String> owners = known.stream().map(other -> other.substring(0, other.indexOf(':') + 1)).distinct()
                .toList();
        String hint = NearestName.hint(name, known);
        if (ownerKnown || owners.isEmpty()) {
            mistake(row, "there is no " + kind + " \"" + name + "\"" + hint);
        } else {
            mistake(row, "there is no " + kind + " \"" + name + "\"; names begin with one of "
                    + String.join(" ", owners) + hint);
        }
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
}
