/**
 * The manufacturing cell: stations 1, 3 and 4 and the transport of a cell that makes pneumatic cylinders, with pallets that
 * carry code carriers; and the demo in which Petri nets control it. docs/cell.md describes both.
 */
package tickbus.machines.cell;
