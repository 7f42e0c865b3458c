package tickbus.petri.analysis;

import java.util.HashMap;
import java.util.Map;
import tickbus.petri.net.Effects;
import tickbus.petri.net.PetriNet;

/**
 * Places whose tokens follow from those of other places, in every reachable marking: the firing of a transition changes such a
 * place by a sum of its changes of the others. Found by an elimination that keeps to whole numbers and gives up where these,
 * or the work, grow: a place that is not found costs memory, no more.
 */
final class Implied {
    private static final long MOST_STEPS = 3_000_000;
    private static final int MOST_TERMS = 32;
    private static final int MOST_WEIGHT = 1000;

    /** For each place the others from which it follows; null for a place that does not follow from others. */
    private final int[][] from;
    /** For each place the places that follow from it, and how many tokens one of its tokens makes there. */
    final int[][] to;
    final int[][] weight;

    private Implied(int[][] from, int[][] to, int[][] weight) {
        this.from = from;
        this.to = to;
        this.weight = weight;
    }

    boolean isImplied(int place) {
        return from[place] != null;
    }

    /** Fills in the implied places of a marking whose other places are given. */
    void complete(int[] tokens, int[] initial) {
        for (int p = 0; p < from.length; p++) {
            if (from[p] != null) {
                tokens[p] = initial[p];
            }
        }
        for (int p = 0; p < from.length; p++) {
            for (int i = 0; i < to[p].length; i++) {
                tokens[to[p][i]] += weight[p][i] * (tokens[p] - initial[p]);
            }
        }
    }

    /** A sum of rows of the incidence matrix, and the places of which it is the sum. */
    private record Row(Map<Integer, Integer> gains, Map<Integer, Integer> places) {
    }

    static Implied of(PetriNet net) {
        return new Search(net).run();
    }

    /** Rows are reduced by the earlier ones. Each of these has a column of its own, where it is 1 or -1. */
    private static final class Search {
        private final Row[] rows;
        private final Map<Integer, Integer> pivotOf = new HashMap<>();
        private final Row[] pivots;
        private final int[] column;
        private int count;
        private long steps;

        Search(PetriNet net) {
            rows = new Row[net.places().size()];
            pivots = new Row[rows.length];
            column = new int[rows.length];
            for (int p = 0; p < rows.length; p++) {
                rows[p] = new Row(new HashMap<>(), new HashMap<>(Map.of(p, 1)));
            }
            Effects effects = net.effects();
            for (int t = 0; t < net.transitions().size(); t++) {
                for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
                    int gain = effects.puts(i) - effects.takes(i);
                    if (gain != 0) {
                        rows[effects.changePlace(i)].gains.put(t, gain);
                    }
                }
            }
        }

        Implied run() {
            int[][] from = new int[rows.length][];
            int[] terms = new int[rows.length];
            for (int p = 0; p < rows.length && steps < MOST_STEPS; p++) {
                if (isReduced(rows[p]) && rows[p].gains.isEmpty()) {
                    rows[p].places.remove(p);
                    from[p] = rows[p].places.keySet().stream().mapToInt(Integer::intValue).toArray();
                    for (int q : from[p]) {
                        terms[q]++;
                    }
                }
            }
            int[][] to = new int[rows.length][];
            int[][] weight = new int[rows.length][];
            for (int q = 0; q < rows.length; q++) {
                to[q] = new int[terms[q]];
                weight[q] = new int[terms[q]];
            }
            for (int p = 0; p < rows.length; p++) {
                for (int i = 0; from[p] != null && i < from[p].length; i++) {
                    int q = from[p][i];
                    to[q][--terms[q]] = p;
                    weight[q][terms[q]] = -rows[p].places.get(q);
                }
            }
            return new Implied(from, to, weight);
        }

        /** False if the numbers grew too much. A row that is not 0 in the end becomes a pivot if it can. */
        private boolean isReduced(Row row) {
            if (row.gains.values().stream().anyMatch(gain -> Math.abs((long) gain) > MOST_WEIGHT)) {
                return false;
            }
            while (true) {
                // Earlier pivots bring in columns of later ones, never the other way round.
                int first = Integer.MAX_VALUE;
                for (int c : row.gains.keySet()) {
                    first = Math.min(first, pivotOf.getOrDefault(c, Integer.MAX_VALUE));
                }
                steps += row.gains.size();
                if (first == Integer.MAX_VALUE) {
                    break;
                }
                Row pivot = pivots[first];
                int factor = -row.gains.get(column[first]) * pivot.gains.get(column[first]);
                if (!isAdded(row.gains, pivot.gains, factor) || !isAdded(row.places, pivot.places, factor)
                        || row.places.size() > MOST_TERMS || steps > MOST_STEPS) {
                    return false;
                }
            }
            for (Map.Entry<Integer, Integer> gain : row.gains.entrySet()) {
                if (Math.abs(gain.getValue()) == 1) {
                    pivotOf.put(gain.getKey(), count);
                    column[count] = gain.getKey();
                    pivots[count++] = row;
                    break;
                }
            }
            return true;
        }

        private boolean isAdded(Map<Integer, Integer> to, Map<Integer, Integer> row, int factor) {
            boolean small = true;
            for (Map.Entry<Integer, Integer> one : row.entrySet()) {
                int sum = to.getOrDefault(one.getKey(), 0) + factor * one.getValue();
                small &= Math.abs(sum) <= MOST_WEIGHT;
                if (sum == 0) {
                    to.remove(one.getKey());
                } else {
                    to.put(one.getKey(), sum);
                }
            }
            steps += row.size();
            return small;
        }
    }
}
