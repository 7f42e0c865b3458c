package tickbus.petri.sfc;

import java.util.List;
import java.util.Locale;
import java.util.Optional;
import tickbus.petri.net.Effects;
import tickbus.petri.net.Marking;
import tickbus.petri.run.Coordinator;
import tickbus.petri.run.CoordinatorBuilder;
import tickbus.petri.run.Stop;

/**
 * Runs a chart as a PLC does. A scan tests the conditions of the transitions behind the active steps, fires those that hold
 * once, and then runs the actions. An initial step is active before the first scan already, so its P and P1 do not run
 * there. A step that is left and entered in one scan stays active for its actions; its time begins again. Not thread-safe.
 */
public final class SfcController {
    private final Sfc chart;
    private final State state;
    private final Coordinator coordinator;
    private final boolean[] before;
    private final Actions actions;
    private long last;

    SfcController(Sfc chart) {
        this.chart = chart;
        int steps = chart.net().places().size();
        state = new State(chart.variables, steps);
        before = new boolean[steps];
        actions = new Actions(chart, state, before);
        for (int p = 0; p < steps; p++) {
            state.active[p] = chart.net().place(p).initial() > 0;
        }
        CoordinatorBuilder builder = Coordinator.of(chart.net());
        for (int t = 0; t < chart.conditions.size(); t++) {
            Value condition = chart.conditions.get(t);
            // An edge counts for the transitions that were enabled when the scan began, as every condition of a chart does.
            builder.whenEdge(chart.net().transition(t).name(), in -> condition.holds(state));
        }
        coordinator = builder.limit(Math.max(1, chart.conditions.size() + 1)).listener((scan, nanos, t, choices) -> entered(t)).build();
    }

    private void entered(int t) {
        Effects effects = chart.net().effects();
        for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
            if (effects.puts(i) > 0) {
                state.nanos[effects.changePlace(i)] = 0;
            }
        }
    }

    /** One scan at the time {@code nanos}, on any clock that does not go back; returns how many transitions fired. */
    public int scan(long nanos) {
        long elapsed = coordinator.scans() == 0 ? 0 : nanos - last;
        for (int p = 0; p < before.length; p++) {
            before[p] = state.active[p];
            state.nanos[p] += state.active[p] ? Math.max(0, elapsed) : 0;
        }
        int fired = coordinator.scan(nanos);
        if (coordinator.stop().isPresent()) {
            return 0;
        }
        last = nanos;
        for (int p = 0; p < before.length; p++) {
            state.active[p] = coordinator.tokens(p) > 0;
        }
        actions.run(elapsed);
        return fired;
    }

    /** Sets a variable: 0 or 1, a whole number, or nanoseconds. An {@link IllegalArgumentException} if there is none of this name. */
    public void set(String variable, long value) {
        int index = index(variable);
        state.values[index] = chart.variables.get(index).wrapped(value);
    }

    /** The value of a variable. An {@link IllegalArgumentException} if there is none of this name. */
    public long get(String variable) {
        return state.values[index(variable)];
    }

    private int index(String name) {
        List<String> names = chart.variables.stream().map(one -> one.name().toUpperCase(Locale.ROOT)).toList();
        int index = names.indexOf(name.toUpperCase(Locale.ROOT));
        if (index < 0) {
            throw new IllegalArgumentException("there is no variable '" + name + "'; there are "
                + chart.variables.stream().map(Variable::name).toList());
        }
        return index;
    }

    /** The active steps. */
    public Marking marking() {
        return coordinator.marking();
    }

    /** Why the chart stopped, such as a clock that went back; empty while it runs. */
    public Optional<Stop> stop() {
        return coordinator.stop();
    }

    /** The running net, for {@link tickbus.petri.run.NetWatch} and a page. */
    public Coordinator coordinator() {
        return coordinator;
    }
}
