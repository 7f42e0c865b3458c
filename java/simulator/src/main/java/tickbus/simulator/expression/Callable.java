package tickbus.simulator.expression;

import java.util.List;

/**
 * A function or block that expressions can call.
 *
 * @param name in capitals
 * @param parameters their names; the last one can be given several times if {@code open}
 * @param open true if further arguments can follow
 * @param outputs of a block, the first one being its value; empty for a function
 * @param meaning for people
 * @param maker makes the node
 */
record Callable(String name, List<String> parameters, boolean open, List<String> outputs, String meaning, Maker maker) {
    /** Makes the node of a call. */
    @FunctionalInterface
    interface Maker {
        Node make(Typing typing, Call call);
    }

    /** Such as {@code SEL(G, IN0, IN1)}. */
    String shape() {
        return name + "(" + String.join(", ", parameters) + (open ? ", …)" : ")");
    }
}
