package tickbus.petri.sfc;

import java.math.BigDecimal;
import java.util.List;
import tickbus.petri.net.Transition;

/** Writes a chart as IEC 61131-3 text. */
final class SfcWriter {
    /** A program must have a variable. */
    static final Variable NONE = new Variable("unused", "BOOL", "", false, 0);

    private final Sfc chart;
    private final ChartShape shape;
    private final StringBuilder out = new StringBuilder();

    SfcWriter(Sfc chart) {
        this.chart = chart;
        shape = new ChartShape(chart);
    }

    String text() {
        String kind = chart.source.kind();
        String name = chart.net().name();
        out.append(kind).append(' ').append(name).append('\n');
        variables();
        for (int step = 0; step < chart.net().places().size(); step++) {
            step(step);
        }
        for (int action = 0; action < chart.actions.size(); action++) {
            if (chart.actions.get(action).body() != null) {
                out.append("  ACTION ").append(chart.source.names().get(action)).append(":\n    ")
                    .append(chart.source.bodies().get(action).replace("\n", "\n    ")).append("\n  END_ACTION\n");
            }
        }
        chart.net().transitions().forEach(this::transition);
        out.append("END_").append(kind).append('\n');
        if (kind.equals("PROGRAM")) {
            out.append("""

                CONFIGURATION config
                  RESOURCE resource1 ON PLC
                    TASK task0(INTERVAL := T#20ms, PRIORITY := 0);
                    PROGRAM instance0 WITH task0 : %s;
                  END_RESOURCE
                END_CONFIGURATION
                """.formatted(name));
        }
        return out.toString();
    }

    private void variables() {
        String open = "";
        for (int i = 0; i < chart.variables.size(); i++) {
            Variable one = chart.variables.get(i);
            String block = chart.source.blocks().get(i);
            if (!block.equals(open)) {
                out.append(open.isEmpty() ? "" : "  END_VAR\n").append("  ").append(block).append('\n');
                open = block;
            }
            out.append("    ").append(one.name()).append(one.location().isEmpty() ? "" : " AT " + one.location()).append(" : ")
                .append(one.type()).append(one.initial() == 0 ? "" : " := " + initial(one)).append(";\n");
        }
        if (open.isEmpty()) {
            out.append("  VAR\n    ").append(NONE.name()).append(" : ").append(NONE.type()).append(";\n");
        }
        out.append("  END_VAR\n");
    }

    /** The initial value of a variable, as a literal. */
    static String initial(Variable of) {
        return switch (of.kind()) {
            case BOOL -> of.initial() == 0 ? "FALSE" : "TRUE";
            case TIME -> time(of.initial());
            case NUMBER -> Long.toString(of.initial());
        };
    }

    /** A time as a literal. */
    static String time(long nanos) {
        return "T#" + new BigDecimal(nanos).movePointLeft(6).stripTrailingZeros().toPlainString() + "ms";
    }

    private void step(int step) {
        boolean isInitial = chart.net().place(step).initial() > 0;
        out.append(isInitial ? "  INITIAL_STEP " : "  STEP ").append(chart.net().place(step).name()).append(":\n");
        for (Association one : shape.associations(step)) {
            out.append("    ").append(chart.source.names().get(one.action())).append('(').append(one.qualifier())
                .append(one.qualifier().isTimed() ? ", " + time(one.nanos()) : "").append(");\n");
        }
        out.append("  END_STEP\n");
    }

    private void transition(Transition of) {
        int priority = shape.priority(of.index());
        out.append("  TRANSITION ").append(of.name().matches("[A-Za-z_][A-Za-z0-9_]*") ? of.name() + " " : "")
            .append(priority == 0 ? "" : "(PRIORITY := " + priority + ") ").append("FROM ")
            .append(list(shape.before(of.index()))).append(" TO ").append(list(shape.behind(of.index())))
            .append(" := ").append(chart.source.conditions().get(of.index())).append("; END_TRANSITION\n");
    }

    private String list(List<Integer> steps) {
        String names = String.join(", ", steps.stream().map(step -> chart.net().place(step).name()).toList());
        return steps.size() == 1 ? names : "(" + names + ")";
    }
}
