/**
 * The machines for the reference simulator, and their demos. The product does not use them.
 *
 * <p>This package has only the simulator's command line with all machines. Each machine has a package, with its demo:
 *
 * <ul>
 * <li>{@code rig}: the test rig, two lifts that turn bottles over;
 * <li>{@code peeler}: the peeling line, with two PLCs;
 * <li>{@code cell}: the manufacturing cell, which Petri nets control;
 * <li>{@code board}: the testing board of the virtual laboratory.
 * </ul>
 *
 * <p>All demos use {@code demo}; rig and peeler share {@code motion}.
 */
package tickbus.machines;
