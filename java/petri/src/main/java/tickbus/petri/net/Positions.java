package tickbus.petri.net;

import java.util.Arrays;
import java.util.Map;

/** The positions in the file that a net was read from, in the unit of the file; y grows downwards. Only drawings use them. */
public final class Positions {
    private final double[][] nodes;
    private final Map<Arc, double[][]> bends;

    /** Takes x and y of each place, then of each transition, and of each bend of the arcs that have any. */
    Positions(double[][] nodes, Map<Arc, double[][]> bends) {
        this.nodes = nodes;
        this.bends = bends;
    }

    /** The horizontal position of a place, or, behind the places, of a transition. */
    public double x(int node) {
        return nodes[node][0];
    }

    /** The vertical position of a place, or, behind the places, of a transition. */
    public double y(int node) {
        return nodes[node][1];
    }

    /** The bends of an arc, x and y of each, in the order from its source to its target; a copy. */
    public double[][] bends(Arc arc) {
        return Arrays.stream(bends.getOrDefault(arc, new double[0][])).map(double[]::clone).toArray(double[][]::new);
    }
}
