package tickbus.petri;

import java.util.Map;

/**
 * Where the file that a net was read from draws it. Only drawings use it.
 *
 * @param nodes x and y of each place, then of each transition, in the unit of the file; y grows downwards
 * @param bends x and y of each bend of an arc, in the order from its source to its target; arcs without are not in it
 */
record Positions(double[][] nodes, Map<Arc, double[][]> bends) {
}
