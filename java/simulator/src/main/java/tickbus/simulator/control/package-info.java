/**
 * The control table: the source and destination of every value, and its transfer function.
 *
 * <p>See {@link tickbus.simulator.control.ControlTable} for the file format and
 * {@link tickbus.simulator.control.TransferFunctions} for the functions.
 */
package tickbus.simulator.control;
