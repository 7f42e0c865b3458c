/**
 * The reference simulator: drivers from a folder, a machine, and a control table between them.
 *
 * <p>The simulator replaces the simulation program of the 2003 thesis, without its graphics: a {@code DeviceDriver} folder
 * that is scanned at start, a list of hardware components, a control table, a step size, and the tick modes «best effort»
 * and «real-time». It does not depend on any fieldbus: of a driver it only uses the package {@code controlinterface}.
 */
package tickbus.simulator;
