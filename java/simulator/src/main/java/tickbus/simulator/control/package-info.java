/**
 * The control table: which value goes where, and what happens to it on its way.
 *
 * <p>See {@link tickbus.simulator.control.ControlTable} for the file format and
 * {@link tickbus.simulator.control.TransferFunctions} for the functions.
 */
package tickbus.simulator.control;
