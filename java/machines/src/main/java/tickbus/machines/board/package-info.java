/**
 * The testing board of the virtual laboratory: switches, lamps and two tanks. The machine has no knowledge of buses; the
 * control table lab.table connects it.
 *
 * <p>The demo of the laboratory, {@link tickbus.machines.board.LabDemo}, has a dispatcher, two controllers and the board.
 */
package tickbus.machines.board;
