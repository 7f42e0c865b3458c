package tickbus.petri.analysis;

import java.util.Arrays;

/** The strongly connected components of a graph whose edges are in one array (Tarjan, without recursion). */
final class Components {
    /** The component of each node. */
    final int[] of;
    /** For each component, true if no edge leaves it. */
    final boolean[] terminal;
    final int count;

    /** Edges {@code first.get(v)} to {@code first.get(v + 1)} lead from v. */
    Components(int nodes, Ints first, Ints target) {
        of = new int[nodes];
        Arrays.fill(of, -1);
        int[] order = new int[nodes];
        int[] low = new int[nodes];
        int[] edge = new int[nodes];
        Ints open = new Ints();
        Ints path = new Ints();
        int visited = 0;
        int components = 0;
        for (int root = 0; root < nodes; root++) {
            if (order[root] != 0) {
                continue;
            }
            path.add(root);
            while (path.size() > 0) {
                int v = path.get(path.size() - 1);
                if (order[v] == 0) {
                    order[v] = low[v] = ++visited;
                    edge[v] = first.get(v);
                    open.add(v);
                }
                if (edge[v] < first.get(v + 1)) {
                    int w = target.get(edge[v]++);
                    if (order[w] == 0) {
                        path.add(w);
                    } else if (of[w] < 0) {
                        low[v] = Math.min(low[v], order[w]);
                    }
                    continue;
                }
                path.pop();
                if (path.size() > 0) {
                    int parent = path.get(path.size() - 1);
                    low[parent] = Math.min(low[parent], low[v]);
                }
                if (low[v] == order[v]) {
                    int w;
                    do {
                        w = open.pop();
                        of[w] = components;
                    } while (w != v);
                    components++;
                }
            }
        }
        count = components;
        terminal = new boolean[components];
        Arrays.fill(terminal, true);
        for (int v = 0; v < nodes; v++) {
            for (int e = first.get(v); e < first.get(v + 1); e++) {
                if (of[target.get(e)] != of[v]) {
                    terminal[of[v]] = false;
                }
            }
        }
    }
}
