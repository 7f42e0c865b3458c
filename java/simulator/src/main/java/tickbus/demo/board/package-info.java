/**
 * The testing board of the virtual laboratory: switches, lamps and two tanks. The machine has no knowledge of buses; the
 * control table lab.table connects it.
 */
package tickbus.demo.board;
