package tickbus.petri.draw;

import java.util.Arrays;
import java.util.List;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Positions;

/** The positions of a net's nodes in a drawing, and the routes of the arcs between them, in pixels from the upper left. */
final class Layout {
    /** The radius of a place. */
    static final double RADIUS = 16;
    /** Half of the least width of a transition, and of its height where it is a bar. */
    static final double HALF_BAR = 16;
    static final double HALF_HEIGHT = 5;
    /** Half of a transition that is a square. */
    static final double HALF_SQUARE = 10;
    static final double MARGIN = 12;
    /** The distance of an enabled transition's frame; arcs end there. */
    static final double FRAME = 4;
    /** The most letters in a line of a name: longer lines are shortened, and longer names of two words get two lines. */
    private static final int MOST_LETTERS = 28;
    private static final double WIDE = 75;
    /** The least distance of two nodes in a file's drawing. */
    private static final double NEAREST = 64;

    final PetriNet net;
    /** Of each place, then of each transition: its middle. */
    final double[] x;
    final double[] y;
    /** Of each transition: half of its width and of its height. */
    final double[] halfWidth;
    final double[] halfHeight;
    /** Of each arc: x and y of its points in turn, from the edge of its source to the edge of its target. */
    final double[][] routes;
    /** True if arcs leave and reach all their points vertically; otherwise they are straight between them. */
    boolean curved;
    /** True if names are to the right of their nodes; otherwise below them, right of the middle. */
    boolean namesBeside;
    double width;
    double height;

    private Layout(PetriNet net) {
        this.net = net;
        int nodes = net.places().size() + net.transitions().size();
        x = new double[nodes];
        y = new double[nodes];
        halfWidth = new double[net.transitions().size()];
        halfHeight = new double[net.transitions().size()];
        routes = new double[net.arcs().size()][];
    }

    /** As in the file if it draws the net, otherwise in layers. */
    static Layout of(PetriNet net) {
        Layout layout = new Layout(net);
        if (!net.positions().map(layout::asInFile).orElse(false)) {
            layout.curved = true;
            layout.namesBeside = true;
            new Layers(layout).draw();
        }
        return layout;
    }

    int source(Arc arc) {
        return arc.kind() == ArcKind.OUTPUT ? net.places().size() + arc.transition() : arc.place();
    }

    int target(Arc arc) {
        return arc.kind() == ArcKind.OUTPUT ? arc.place() : net.places().size() + arc.transition();
    }

    boolean isPlace(int node) {
        return node < net.places().size();
    }

    /** The name of a node in the drawing: one line, or two if it is long and has a place to break near the middle. */
    List<String> label(int node) {
        String name = isPlace(node) ? net.place(node).name() : net.transition(node - net.places().size()).name();
        int at = -1;
        for (int i = 1; i < name.length() - 1; i++) {
            if (" ._-/".indexOf(name.charAt(i)) >= 0 && Math.abs(2 * i - name.length()) < Math.abs(2 * at - name.length())) {
                at = i;
            }
        }
        if (width(name) <= WIDE || at < 0) {
            return List.of(shortened(name));
        }
        return List.of(shortened(name.substring(0, at + 1).strip()), shortened(name.substring(at + 1).strip()));
    }

    private static String shortened(String line) {
        int letters = line.codePointCount(0, line.length());
        return letters <= MOST_LETTERS ? line : line.substring(0, line.offsetByCodePoints(0, MOST_LETTERS - 1)) + "…";
    }

    /** The width of a node's name in the drawing. */
    double labelWidth(int node) {
        return label(node).stream().mapToDouble(Layout::width).max().orElse(0);
    }

    /** The approximate width of a text in the drawing: the viewer's program chooses the font. */
    private static double width(String text) {
        return text.codePoints().mapToDouble(c -> c > 0x2E7F ? 13 : Character.isUpperCase(c) ? 8.4 : 6.8).sum();
    }

    /** True if the file's positions are usable: no nodes on top of each other, and none far away. */
    private boolean asInFile(Positions file) {
        double[][] nodes = new double[x.length][];
        Arrays.setAll(nodes, v -> new double[] {file.x(v), file.y(v)});
        double nearest = Double.MAX_VALUE;
        for (int a = 0; a < nodes.length; a++) {
            for (int b = a + 1; b < nodes.length; b++) {
                nearest = Math.min(nearest, Math.hypot(nodes[a][0] - nodes[b][0], nodes[a][1] - nodes[b][1]));
            }
        }
        double scale = nodes.length < 2 ? 1 : NEAREST / nearest;
        double[] low = {Double.MAX_VALUE, Double.MAX_VALUE};
        double[] high = {-Double.MAX_VALUE, -Double.MAX_VALUE};
        for (int v = 0; v < nodes.length; v++) {
            include(low, high, scale * nodes[v][0] - RADIUS, scale * nodes[v][1] - RADIUS);
            include(low, high, scale * nodes[v][0] + Math.max(RADIUS, 5 + labelWidth(v)), scale * nodes[v][1] + RADIUS + 31);
        }
        for (Arc arc : net.arcs()) {
            for (double[] bend : file.bends(arc)) {
                include(low, high, scale * bend[0], scale * bend[1]);
            }
        }
        width = high[0] - low[0] + 2 * MARGIN;
        height = high[1] - low[1] + 2 * MARGIN;
        double most = 400.0 * (nodes.length + 1);
        if (!(scale <= 1e6 && width <= most && height <= most)) {
            return false;
        }
        double left = MARGIN - low[0];
        double top = MARGIN - low[1];
        for (int v = 0; v < nodes.length; v++) {
            x[v] = scale * nodes[v][0] + left;
            y[v] = scale * nodes[v][1] + top;
        }
        Arrays.fill(halfWidth, HALF_SQUARE);
        Arrays.fill(halfHeight, HALF_SQUARE);
        List<Arc> arcs = net.arcs();
        for (int a = 0; a < arcs.size(); a++) {
            double[][] bends = file.bends(arcs.get(a));
            double[] route = new double[2 * bends.length + 4];
            for (int i = 0; i < bends.length; i++) {
                route[2 * i + 2] = scale * bends[i][0] + left;
                route[2 * i + 3] = scale * bends[i][1] + top;
            }
            routes[a] = bends.length == 0 && hasTwin(arcs.get(a)) ? aside(arcs.get(a)) : route;
            attach(routes[a], source(arcs.get(a)), target(arcs.get(a)));
        }
        return true;
    }

    private static void include(double[] low, double[] high, double atX, double atY) {
        low[0] = Math.min(low[0], atX);
        low[1] = Math.min(low[1], atY);
        high[0] = Math.max(high[0], atX);
        high[1] = Math.max(high[1], atY);
    }

    /** True if another arc connects the same nodes. */
    private boolean hasTwin(Arc arc) {
        return net.arcs().stream().anyMatch(other -> other != arc && other.place() == arc.place()
            && other.transition() == arc.transition());
    }

    /** A route with a bend to the right of its direction, so that the arcs of both directions do not overlap. */
    private double[] aside(Arc arc) {
        int from = source(arc);
        int to = target(arc);
        double dx = x[to] - x[from];
        double dy = y[to] - y[from];
        double length = Math.hypot(dx, dy);
        double by = arc.kind() == ArcKind.TEST ? 30 : arc.kind() == ArcKind.INHIBITOR ? 44 : 16;
        return new double[] {0, 0, x[from] + dx / 2 - dy / length * by, y[from] + dy / 2 + dx / length * by, 0, 0};
    }

    /** Puts the ends of a route on the edges of its nodes, each towards the next point. */
    private void attach(double[] route, int from, int to) {
        int last = route.length - 2;
        edge(route, 0, from, last == 2 ? x[to] : route[2], last == 2 ? y[to] : route[3]);
        edge(route, last, to, last == 2 ? x[from] : route[last - 2], last == 2 ? y[from] : route[last - 1]);
    }

    private void edge(double[] route, int at, int node, double towardsX, double towardsY) {
        double dx = towardsX - x[node];
        double dy = towardsY - y[node];
        double reach = isPlace(node) ? RADIUS / Math.max(1e-9, Math.hypot(dx, dy))
            : (HALF_SQUARE + FRAME) / Math.max(1e-9, Math.max(Math.abs(dx), Math.abs(dy)));
        route[at] = x[node] + dx * reach;
        route[at + 1] = y[node] + dy * reach;
    }
}
