package tickbus.petri;

import java.util.Map;

/**
 * The positions in the file that a net was read from. Only drawings use them.
 *
 * @param nodes x and y of each place, then of each transition, in the unit of the file; y grows downwards
 * @param bends x and y of each bend of an arc, in the order from its source to its target; without arcs that have none
 */
record Positions(double[][] nodes, Map<Arc, double[][]> bends) {
}
