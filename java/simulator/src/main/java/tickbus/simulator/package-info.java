/**
 * The reference simulator: drivers from a folder, a machine, and a control table between them.
 *
 * <p>It stands where the simulation program of the 2003 thesis stood, without its graphics: a
 * {@code DeviceDriver} folder that is scanned at start, a list of hardware components, a control table, a
 * step size, and the tick modes «best effort» and «real-time». It knows no fieldbus: all it sees of a
 * driver is the package {@code controlinterface}.
 */
package tickbus.simulator;
