package tickbus.simulator.expression;

import java.util.List;

/**
 * A call of a function or a block, as written.
 *
 * @param name in capitals
 * @param offset place of the name
 * @param arguments in the order of the parameters
 * @param output name of a block's output in capitals; null for a block's first one, and for a function
 * @param stepNanos time between two ticks
 */
record Call(String name, int offset, List<Node> arguments, String output, long stepNanos) {
    Node argument(int index) {
        return arguments.get(index);
    }
}
