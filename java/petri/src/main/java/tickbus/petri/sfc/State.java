package tickbus.petri.sfc;

import java.util.List;

/** The values of a running chart that expressions read. */
final class State {
    /** By variable. */
    final long[] values;
    /** By step: active, and for how long. */
    final boolean[] active;
    final long[] nanos;

    State(List<Variable> variables, int steps) {
        values = variables.stream().mapToLong(Variable::initial).toArray();
        active = new boolean[steps];
        nanos = new long[steps];
    }
}
