package tickbus.simulator;

import java.util.List;

/**
 * A machine model that the simulator steps and a control moves.
 *
 * <p>Variables are doubles; Booleans are 0 and 1. The order of {@link #inputs()} and {@link #outputs()} never changes
 * during a machine's life, so callers look a name up once and use its index from then on.
 */
public interface Machine {
    /**
     * The machine's name, for messages and reports.
     *
     * @return a short name
     */
    String name();

    /**
     * The variables that the control writes, for example {@code im1.index}.
     *
     * @return names in index order
     */
    List<String> inputs();

    /**
     * The variables that the machine shows, for example {@code step1.complete}.
     *
     * @return names in index order
     */
    List<String> outputs();

    /**
     * Sets an input. The machine reads its inputs at the next {@link #step(long)}.
     *
     * @param index position in {@link #inputs()}
     * @param value the new value; a Boolean is true from 0.5
     * @throws IndexOutOfBoundsException if there is no such input
     */
    void input(int index, double value);

    /**
     * Reads an output with its value at the end of the last {@link #step(long)}.
     *
     * @param index position in {@link #outputs()}
     * @return the value; 0 or 1 for a Boolean
     * @throws IndexOutOfBoundsException if there is no such output
     */
    double output(int index);

    /**
     * Further variables of the model, for observers; a control table reads them as {@code model:<name>}.
     *
     * @return always the same, in the order of a list for people; empty for a machine without any
     */
    default List<ModelVariable> variables() {
        return List.of();
    }

    /**
     * The faults that the machine can have, by name.
     *
     * @return always the same; empty for a machine without faults
     */
    default List<ModelFault> modelFaults() {
        return List.of();
    }

    /**
     * A fault begins, changes its value, or ends. Called before a {@link #step(long)}, on the same thread.
     *
     * @param name one of the names in {@link #modelFaults()}
     * @param value the fault's value; 0 ends it
     * @throws IllegalArgumentException if the machine has no such fault
     */
    default void fault(String name, double value) {
        throw new IllegalArgumentException("the machine " + name() + " has no fault \"" + name + "\"");
    }

    /**
     * Advances the machine. The same inputs at the same steps give the same motion, bit for bit.
     *
     * @param nanos the time step, in nanoseconds of simulation time; not negative
     * @throws IllegalArgumentException if {@code nanos} is negative
     */
    void step(long nanos);
}
