package tickbus.petri.draw;

import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.Comparator;
import java.util.Deque;
import java.util.List;
import java.util.stream.IntStream;
import tickbus.petri.net.Arc;

/**
 * Draws a net in layers from top to bottom (after Sugiyama, Tagawa and Toda), each connected part separately. The marked
 * places come first: arcs back to them run upwards. An arc over several layers gets a bend in each, which is laid out like a
 * node. Nothing is random, so the same net always looks the same.
 */
final class Layers {
    private static final double STEP = 62;
    private static final double GAP = 18;
    /** Half of the height of a straight piece at a bend. */
    private static final double STRAIGHT = 14;
    /** The width up to which parts of the net are put side by side. */
    private static final double PAGE = 1100;
    /** The limit of bends, beyond which the layout would take too long: then arcs can cross nodes. */
    private static final int MOST_BENDS = 20_000;
    private static final int SWEEPS = 24;

    private final Layout layout;
    private final int places;
    private final int nodes;
    /** Of each arc, after reversal: the node above and the one below. */
    private final int[] above;
    private final int[] below;
    /** The arc of each bend. */
    private int[] bendOf;
    /** With bends after the nodes. */
    private int[] layer;
    private double[] x;
    private double[] left;
    private double[] right;
    /** Of each arc: the nodes and bends that it runs through, from above. */
    private final int[][] chains;
    private final List<List<Integer>> up = new ArrayList<>();
    private final List<List<Integer>> down = new ArrayList<>();

    Layers(Layout layout) {
        this.layout = layout;
        places = layout.net.places().size();
        nodes = layout.x.length;
        int arcs = layout.net.arcs().size();
        above = new int[arcs];
        below = new int[arcs];
        chains = new int[arcs][];
    }

    void draw() {
        // An unused drawing of the file can have left a width.
        layout.width = 0;
        direct();
        assignLayers();
        int[] part = parts();
        makeBends();
        double shelf = Layout.MARGIN;
        double used = Layout.MARGIN;
        double deepest = 0;
        int count = Arrays.stream(part).max().orElse(-1) + 1;
        List<List<List<Integer>>> ordered = new ArrayList<>();
        for (int i = 0; i < count; i++) {
            ordered.add(new ArrayList<>());
        }
        for (int v = 0; v < layer.length; v++) {
            int of = part[v < nodes ? v : above[bendOf[v - nodes]]];
            List<List<Integer>> rows = ordered.get(of);
            while (rows.size() <= layer[v]) {
                rows.add(new ArrayList<>());
            }
            rows.get(layer[v]).add(v);
        }
        double[] y = new double[layer.length];
        for (List<List<Integer>> rows : ordered) {
            rows.removeIf(List::isEmpty);
            new Order(rows, layer.length, up, down).improve(SWEEPS);
            align(rows);
            double low = Double.MAX_VALUE;
            double high = -Double.MAX_VALUE;
            for (List<Integer> row : rows) {
                for (int v : row) {
                    low = Math.min(low, x[v] - left[v]);
                    high = Math.max(high, x[v] + right[v]);
                }
            }
            if (used > Layout.MARGIN && used + high - low > PAGE) {
                shelf += deepest + STEP / 2;
                used = Layout.MARGIN;
                deepest = 0;
            }
            for (int r = 0; r < rows.size(); r++) {
                for (int v : rows.get(r)) {
                    x[v] += used - low;
                    y[v] = shelf + Layout.RADIUS + r * STEP;
                }
            }
            used += high - low + 2 * GAP;
            deepest = Math.max(deepest, (rows.size() - 1) * STEP + 2 * Layout.RADIUS);
            layout.width = Math.max(layout.width, used - 2 * GAP + Layout.MARGIN);
        }
        layout.width = Math.max(layout.width, 2 * Layout.MARGIN);
        layout.height = shelf + deepest + Layout.MARGIN;
        System.arraycopy(x, 0, layout.x, 0, nodes);
        System.arraycopy(y, 0, layout.y, 0, nodes);
        routes(y);
    }

    /** Reverses arcs so that there are no circles: arcs to marked places, and arcs that close a circle. */
    private void direct() {
        List<Arc> arcs = layout.net.arcs();
        List<List<Integer>> leaving = new ArrayList<>();
        for (int v = 0; v < nodes; v++) {
            leaving.add(new ArrayList<>());
        }
        for (int a = 0; a < chains.length; a++) {
            int from = layout.source(arcs.get(a));
            int to = layout.target(arcs.get(a));
            boolean back = to < places && layout.net.place(to).initial() > 0;
            above[a] = back ? to : from;
            below[a] = back ? from : to;
            leaving.get(above[a]).add(a);
        }
        byte[] state = new byte[nodes];
        int[] next = new int[nodes];
        Deque<Integer> path = new ArrayDeque<>();
        int[] roots = IntStream.range(0, nodes).boxed()
            .sorted(Comparator.comparing((Integer v) -> v >= places || layout.net.place(v).initial() == 0))
            .mapToInt(v -> v).toArray();
        for (int root : roots) {
            if (state[root] != 0) {
                continue;
            }
            path.push(root);
            state[root] = 1;
            while (!path.isEmpty()) {
                int v = path.peek();
                if (next[v] == leaving.get(v).size()) {
                    state[v] = 2;
                    path.pop();
                    continue;
                }
                int a = leaving.get(v).get(next[v]++);
                int w = below[a];
                if (state[w] == 1) {
                    below[a] = v;
                    above[a] = w;
                } else if (state[w] == 0) {
                    state[w] = 1;
                    path.push(w);
                }
            }
        }
    }

    /** Assigns layers by the longest way from above; a node without incoming arcs is just above its nearest successor. */
    private void assignLayers() {
        layer = new int[nodes];
        int[] waits = new int[nodes];
        int[] nearest = new int[nodes];
        Arrays.fill(nearest, Integer.MAX_VALUE);
        List<List<Integer>> leaving = new ArrayList<>();
        for (int v = 0; v < nodes; v++) {
            leaving.add(new ArrayList<>());
        }
        for (int a = 0; a < chains.length; a++) {
            leaving.get(above[a]).add(below[a]);
            waits[below[a]]++;
        }
        boolean[] first = new boolean[nodes];
        Deque<Integer> open = new ArrayDeque<>();
        for (int v = 0; v < nodes; v++) {
            first[v] = waits[v] == 0;
            if (first[v]) {
                open.add(v);
            }
        }
        while (!open.isEmpty()) {
            int v = open.poll();
            for (int w : leaving.get(v)) {
                layer[w] = Math.max(layer[w], layer[v] + 1);
                if (--waits[w] == 0) {
                    open.add(w);
                }
            }
        }
        for (int a = 0; a < chains.length; a++) {
            nearest[above[a]] = Math.min(nearest[above[a]], layer[below[a]] - 1);
        }
        for (int v = 0; v < nodes; v++) {
            if (first[v] && nearest[v] != Integer.MAX_VALUE) {
                layer[v] = nearest[v];
            }
        }
    }

    /** The number of the connected part of each node. */
    private int[] parts() {
        int[] part = new int[nodes];
        Arrays.fill(part, -1);
        List<List<Integer>> beside = new ArrayList<>();
        for (int v = 0; v < nodes; v++) {
            beside.add(new ArrayList<>());
        }
        for (int a = 0; a < chains.length; a++) {
            beside.get(above[a]).add(below[a]);
            beside.get(below[a]).add(above[a]);
        }
        int count = 0;
        for (int root = 0; root < nodes; root++) {
            if (part[root] >= 0) {
                continue;
            }
            Deque<Integer> open = new ArrayDeque<>(List.of(root));
            part[root] = count;
            while (!open.isEmpty()) {
                for (int w : beside.get(open.poll())) {
                    if (part[w] < 0) {
                        part[w] = count;
                        open.add(w);
                    }
                }
            }
            count++;
        }
        return part;
    }

    private void makeBends() {
        long wanted = 0;
        for (int a = 0; a < chains.length; a++) {
            wanted += layer[below[a]] - layer[above[a]] - 1;
        }
        boolean bends = wanted <= MOST_BENDS;
        int total = nodes + (bends ? (int) wanted : 0);
        bendOf = new int[total - nodes];
        layer = Arrays.copyOf(layer, total);
        x = new double[total];
        left = new double[total];
        right = new double[total];
        for (int v = 0; v < total; v++) {
            up.add(new ArrayList<>());
            down.add(new ArrayList<>());
        }
        int next = nodes;
        for (int a = 0; a < chains.length; a++) {
            int length = bends ? layer[below[a]] - layer[above[a]] + 1 : 2;
            int[] chain = new int[length];
            chain[0] = above[a];
            chain[length - 1] = below[a];
            for (int i = 1; i < length - 1; i++) {
                bendOf[next - nodes] = a;
                layer[next] = layer[above[a]] + i;
                chain[i] = next++;
            }
            // Without bends, a long arc does not affect the order of the rows.
            for (int i = 1; i < length && layer[chain[i]] - layer[chain[i - 1]] == 1; i++) {
                down.get(chain[i - 1]).add(chain[i]);
                up.get(chain[i]).add(chain[i - 1]);
            }
            chains[a] = chain;
        }
        int[] tops = new int[nodes];
        int[] bottoms = new int[nodes];
        for (int a = 0; a < chains.length; a++) {
            bottoms[above[a]]++;
            tops[below[a]]++;
        }
        for (int v = 0; v < nodes; v++) {
            double half = Layout.RADIUS;
            if (v >= places) {
                half = Math.max(Layout.HALF_BAR, 5.0 * Math.max(tops[v], bottoms[v]));
                layout.halfWidth[v - places] = half;
                layout.halfHeight[v - places] = Layout.HALF_HEIGHT;
            }
            left[v] = half;
            right[v] = half + 7 + layout.labelWidth(v);
        }
    }

    /** Moves each node and bend towards the middle of its neighbours, as far as the order of its row allows. */
    private void align(List<List<Integer>> rows) {
        for (List<Integer> row : rows) {
            double at = 0;
            for (int v : row) {
                x[v] = at + left[v];
                at += left[v] + right[v] + GAP;
            }
        }
        for (int sweep = 0; sweep < 2 * SWEEPS; sweep++) {
            for (int r = 0; r < rows.size(); r++) {
                settle(rows.get(sweep % 2 == 0 ? r : rows.size() - 1 - r));
            }
        }
        straighten(rows);
    }

    private void settle(List<Integer> row) {
        int size = row.size();
        double[] sum = new double[size];
        double[] weight = new double[size];
        double[] offset = new double[size];
        int[] members = new int[size];
        int blocks = 0;
        for (int i = 0; i < size; i++) {
            int v = row.get(i);
            offset[i] = i == 0 ? 0 : offset[i - 1] + right[row.get(i - 1)] + GAP + left[v];
            double mean = 0;
            double all = 0;
            for (List<Integer> side : List.of(up.get(v), down.get(v))) {
                for (int w : side) {
                    // Straight long arcs matter most.
                    double pull = v >= nodes && w >= nodes ? 8 : v >= nodes || w >= nodes ? 2 : 1;
                    mean += pull * x[w];
                    all += pull;
                }
            }
            double wish = (all == 0 ? x[v] : mean / all) - offset[i];
            all = Math.max(all, 0.1);
            // The closest position that keeps the order: neighbours that would collide move together.
            int count = 1;
            double total = wish * all;
            while (blocks > 0 && sum[blocks - 1] / weight[blocks - 1] >= total / all) {
                blocks--;
                total += sum[blocks];
                all += weight[blocks];
                count += members[blocks];
            }
            sum[blocks] = total;
            weight[blocks] = all;
            members[blocks++] = count;
        }
        int i = 0;
        for (int b = 0; b < blocks; b++) {
            for (int m = 0; m < members[b]; m++, i++) {
                x[row.get(i)] = sum[b] / weight[b] + offset[i];
            }
        }
    }

    /** Aligns all bends of an arc vertically where their rows have room. */
    private void straighten(List<List<Integer>> rows) {
        double[] low = new double[layer.length];
        double[] high = new double[layer.length];
        Arrays.fill(low, Double.NaN);
        for (int round = 0; round < 2; round++) {
            for (int a = 0; a < chains.length; a++) {
                int[] chain = chains[a];
                if (chain.length < 4) {
                    continue;
                }
                bounds(rows, low, high);
                if (Double.isNaN(low[chain[1]])) {
                    continue;
                }
                double least = -Double.MAX_VALUE;
                double most = Double.MAX_VALUE;
                double mean = 0;
                for (int i = 1; i < chain.length - 1; i++) {
                    least = Math.max(least, low[chain[i]]);
                    most = Math.min(most, high[chain[i]]);
                    mean += x[chain[i]] / (chain.length - 2);
                }
                if (least <= most) {
                    double at = Math.max(least, Math.min(most, mean));
                    for (int i = 1; i < chain.length - 1; i++) {
                        x[chain[i]] = at;
                    }
                }
            }
        }
    }

    private void bounds(List<List<Integer>> rows, double[] low, double[] high) {
        for (List<Integer> row : rows) {
            for (int i = 0; i < row.size(); i++) {
                int v = row.get(i);
                low[v] = i == 0 ? -Double.MAX_VALUE : x[row.get(i - 1)] + right[row.get(i - 1)] + GAP / 2 + left[v];
                high[v] = i == row.size() - 1 ? Double.MAX_VALUE
                    : x[row.get(i + 1)] - left[row.get(i + 1)] - GAP / 2 - right[v];
            }
        }
    }

    /** Spreads the ends of the arcs along each node, in the order of their targets, and joins them through the bends. */
    private void routes(double[] y) {
        double[][] route = new double[chains.length][];
        List<List<Integer>> tops = new ArrayList<>();
        List<List<Integer>> bottoms = new ArrayList<>();
        for (int v = 0; v < nodes; v++) {
            tops.add(new ArrayList<>());
            bottoms.add(new ArrayList<>());
        }
        for (int a = 0; a < chains.length; a++) {
            int[] chain = chains[a];
            route[a] = new double[4 * (chain.length - 2) + 4];
            for (int i = 1; i < chain.length - 1; i++) {
                double[] points = route[a];
                points[4 * i - 2] = points[4 * i] = x[chain[i]];
                points[4 * i - 1] = y[chain[i]] - STRAIGHT;
                points[4 * i + 1] = y[chain[i]] + STRAIGHT;
            }
            bottoms.get(chain[0]).add(a);
            tops.get(chain[chain.length - 1]).add(a);
        }
        for (int v = 0; v < nodes; v++) {
            tops.get(v).sort(Comparator.comparingDouble(a -> x[chains[a][chains[a].length - 2]]));
            bottoms.get(v).sort(Comparator.comparingDouble(a -> x[chains[a][1]]));
            attach(route, tops.get(v), v, -1, y[v]);
            attach(route, bottoms.get(v), v, 1, y[v]);
        }
        for (int a = 0; a < chains.length; a++) {
            boolean turned = above[a] != layout.source(layout.net.arcs().get(a));
            layout.routes[a] = turned ? reversed(route[a]) : route[a];
        }
    }

    private void attach(double[][] route, List<Integer> arcs, int node, int side, double y) {
        int count = arcs.size();
        double room = node < places ? 1.4 * Layout.RADIUS : 2 * layout.halfWidth[node - places] - 8;
        double step = count < 2 ? 0 : Math.min(10, room / (count - 1));
        for (int i = 0; i < count; i++) {
            double aside = (i - (count - 1) / 2.0) * step;
            double reach = node < places ? Math.sqrt(Layout.RADIUS * Layout.RADIUS - aside * aside) : Layout.HALF_HEIGHT + Layout.FRAME;
            double[] points = route[arcs.get(i)];
            int at = side > 0 ? 0 : points.length - 2;
            points[at] = x[node] + aside;
            points[at + 1] = y + side * reach;
        }
    }

    private static double[] reversed(double[] points) {
        double[] back = new double[points.length];
        for (int i = 0; i < points.length; i += 2) {
            back[i] = points[points.length - 2 - i];
            back[i + 1] = points[points.length - 1 - i];
        }
        return back;
    }

    /** Orders the nodes within rows so that few arcs cross. */
    private static final class Order {
        private final List<List<Integer>> rows;
        private final int[] position;
        private final List<List<Integer>> up;
        private final List<List<Integer>> down;

        Order(List<List<Integer>> rows, int total, List<List<Integer>> up, List<List<Integer>> down) {
            this.rows = rows;
            this.up = up;
            this.down = down;
            position = new int[total];
        }

        void improve(int sweeps) {
            rows.forEach(this::number);
            long fewest = crossings();
            List<List<Integer>> best = copy();
            for (int sweep = 0; sweep < sweeps && fewest > 0; sweep++) {
                boolean downwards = sweep % 2 == 0;
                for (int r = 1; r < rows.size(); r++) {
                    List<Integer> row = rows.get(downwards ? r : rows.size() - 1 - r);
                    List<List<Integer>> fixed = downwards ? up : down;
                    double[] middle = new double[row.size()];
                    for (int i = 0; i < middle.length; i++) {
                        middle[i] = fixed.get(row.get(i)).stream().mapToInt(w -> position[w]).average().orElse(i);
                    }
                    row.sort(Comparator.comparingDouble(v -> middle[position[v]]));
                    number(row);
                }
                long now = crossings();
                if (now < fewest) {
                    fewest = now;
                    best = copy();
                }
            }
            for (int r = 0; r < rows.size(); r++) {
                rows.set(r, best.get(r));
            }
        }

        private void number(List<Integer> row) {
            for (int i = 0; i < row.size(); i++) {
                position[row.get(i)] = i;
            }
        }

        private List<List<Integer>> copy() {
            List<List<Integer>> copy = new ArrayList<>();
            rows.forEach(row -> copy.add(new ArrayList<>(row)));
            return copy;
        }

        /** Counts, for each end in turn, the earlier ends that are further to the right (a Fenwick tree). */
        private long crossings() {
            long crossings = 0;
            for (int r = 1; r < rows.size(); r++) {
                int[] tree = new int[rows.get(r).size() + 1];
                int seen = 0;
                for (int v : rows.get(r - 1)) {
                    int[] ends = down.get(v).stream().mapToInt(w -> position[w]).sorted().toArray();
                    for (int end : ends) {
                        int before = 0;
                        for (int i = end + 1; i > 0; i -= i & -i) {
                            before += tree[i];
                        }
                        crossings += seen - before;
                    }
                    for (int end : ends) {
                        seen++;
                        for (int i = end + 1; i < tree.length; i += i & -i) {
                            tree[i]++;
                        }
                    }
                }
            }
            return crossings;
        }
    }
}
