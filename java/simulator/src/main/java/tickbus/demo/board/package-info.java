/**
 * The testing board of the virtual laboratory: switches, lamps and two tanks. It knows nothing of buses; the control table
 * lab.table connects it.
 */
package tickbus.demo.board;
