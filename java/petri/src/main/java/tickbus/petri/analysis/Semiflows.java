package tickbus.petri.analysis;

import java.util.ArrayList;
import java.util.Arrays;
import java.util.BitSet;
import java.util.List;
import java.util.TreeMap;
import tickbus.petri.net.Effects;
import tickbus.petri.net.PetriNet;

/**
 * Minimal semiflows by Farkas' algorithm, and the rank of the incidence matrix.
 *
 * <p>A P-semiflow weights the places so that the weighted sum of tokens never changes; a T-semiflow counts firings that
 * together change nothing. The support of a minimal semiflow contains no other one's support, and its weights have no common
 * divisor. Test and inhibitor arcs do not matter to either.
 */
public final class Semiflows {
    private static final long BYTES_PER_ENTRY = 12;
    /** Comparisons of rows with others: some seconds. */
    private static final long MOST_COMPARISONS = 500_000_000;

    private Semiflows() {
    }

    /** The minimal P-semiflows, a weight per place; throws a {@link GaveUpException} at more than {@code limit} rows. */
    public static List<int[]> places(PetriNet net, int limit) {
        return farkas(net, "P-semiflows", true, limit);
    }

    /** The minimal T-semiflows, a count per transition; throws a {@link GaveUpException} at more than {@code limit} rows. */
    public static List<int[]> transitions(PetriNet net, int limit) {
        return farkas(net, "T-semiflows", false, limit);
    }

    /** Some columns of a row, in ascending order, and their values. */
    private record Sparse(int[] at, long[] value) {
        long get(int column) {
            int found = Arrays.binarySearch(at, column);
            return found < 0 ? 0 : value[found];
        }

        /** {@code a} times this plus {@code b} times the other one. */
        Sparse combined(long a, Sparse other, long b) {
            int[] where = new int[at.length + other.at.length];
            long[] what = new long[where.length];
            int size = 0;
            int i = 0;
            int j = 0;
            while (i < at.length || j < other.at.length) {
                int here = i < at.length ? at[i] : Integer.MAX_VALUE;
                int there = j < other.at.length ? other.at[j] : Integer.MAX_VALUE;
                long sum = here <= there ? Math.multiplyExact(value[i++], a) : 0;
                if (there <= here) {
                    sum = Math.addExact(sum, Math.multiplyExact(other.value[j++], b));
                }
                if (sum != 0) {
                    where[size] = Math.min(here, there);
                    what[size++] = sum;
                }
            }
            return new Sparse(Arrays.copyOf(where, size), Arrays.copyOf(what, size));
        }

        void divide(long by) {
            for (int i = 0; i < value.length; i++) {
                value[i] /= by;
            }
        }
    }

    /** The rest that must become 0, and the combination of rows that gives it. */
    private record Row(Sparse rest, Sparse weights) {
        /** True if every weight here is also in the other row. */
        boolean supports(Row other) {
            int j = 0;
            for (int one : weights.at) {
                while (j < other.weights.at.length && other.weights.at[j] < one) {
                    j++;
                }
                if (j == other.weights.at.length || other.weights.at[j] != one) {
                    return false;
                }
            }
            return true;
        }
    }

    /** The number of rows above and below 0 in each column, and the size and the work of the elimination. */
    private static final class Columns {
        final int[] above;
        final int[] below;
        long entries;
        long comparisons;

        Columns(int columns) {
            above = new int[columns];
            below = new int[columns];
        }

        void count(Row row, int by) {
            entries += (long) by * (row.rest.at.length + row.weights.at.length);
            for (int i = 0; i < row.rest.at.length; i++) {
                (row.rest.value[i] > 0 ? above : below)[row.rest.at[i]] += by;
            }
        }

        /** The column that makes the fewest new rows. */
        int cheapest(BitSet left) {
            int best = -1;
            long least = Long.MAX_VALUE;
            for (int column = left.nextSetBit(0); column >= 0; column = left.nextSetBit(column + 1)) {
                long made = (long) above[column] * below[column] - above[column] - below[column];
                if (made < least) {
                    least = made;
                    best = column;
                }
            }
            return best;
        }
    }

    private static List<Row> rows(PetriNet net, boolean ofPlaces) {
        Effects effects = net.effects();
        List<TreeMap<Integer, Long>> gains = new ArrayList<>();
        for (int i = 0; i < (ofPlaces ? net.places() : net.transitions()).size(); i++) {
            gains.add(new TreeMap<>());
        }
        for (int t = 0; t < net.transitions().size(); t++) {
            for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
                int p = effects.changePlace(i);
                long gain = (long) effects.puts(i) - effects.takes(i);
                if (gain != 0) {
                    gains.get(ofPlaces ? p : t).put(ofPlaces ? t : p, gain);
                }
            }
        }
        List<Row> rows = new ArrayList<>();
        for (TreeMap<Integer, Long> one : gains) {
            rows.add(new Row(new Sparse(one.keySet().stream().mapToInt(Integer::intValue).toArray(),
                one.values().stream().mapToLong(Long::longValue).toArray()), new Sparse(new int[] {rows.size()}, new long[] {1})));
        }
        return rows;
    }

    private static List<int[]> farkas(PetriNet net, String what, boolean ofPlaces, int limit) {
        int columns = (ofPlaces ? net.transitions() : net.places()).size();
        List<Row> rows = rows(net, ofPlaces);
        int width = rows.size();
        Columns counts = new Columns(columns);
        rows.forEach(row -> counts.count(row, 1));
        BitSet left = new BitSet();
        left.set(0, columns);
        while (!left.isEmpty()) {
            int column = counts.cheapest(left);
            left.clear(column);
            try {
                rows = eliminate(net, what, rows, column, limit, counts);
            } catch (ArithmeticException overflow) {
                throw new GaveUpException("net " + net.name() + ": " + what + ": gave up, as a weight is greater than "
                    + Long.MAX_VALUE);
            }
            if (rows == null) {
                throw new GaveUpException("net " + net.name() + ": " + what + ": gave up at " + limit + " rows, with "
                    + (left.cardinality() + 1) + " of " + columns + " columns left");
            }
        }
        if (!Memory.has(BYTES_PER_ENTRY * counts.entries + 4L * width * rows.size())) {
            throw new GaveUpException("net " + net.name() + ": " + what + ": gave up at " + rows.size() + " flows of " + width
                + " figures, which do not fit into the memory");
        }
        List<int[]> flows = new ArrayList<>();
        for (Row row : rows) {
            int[] flow = new int[width];
            try {
                for (int i = 0; i < row.weights.at.length; i++) {
                    flow[row.weights.at[i]] = Math.toIntExact(row.weights.value[i]);
                }
            } catch (ArithmeticException overflow) {
                throw new GaveUpException("net " + net.name() + ": " + what + ": gave up, as a weight is greater than "
                    + Integer.MAX_VALUE);
            }
            flows.add(flow);
        }
        flows.sort((a, b) -> Arrays.compare(b, a));
        return flows;
    }

    /** The rows that are 0 in the column, and all positive combinations that become 0 there; null above the limit. */
    private static List<Row> eliminate(PetriNet net, String what, List<Row> rows, int column, int limit, Columns counts) {
        List<Row> kept = new ArrayList<>();
        List<Row> above = new ArrayList<>();
        List<Row> below = new ArrayList<>();
        for (Row row : rows) {
            long value = row.rest.get(column);
            (value == 0 ? kept : value > 0 ? above : below).add(row);
        }
        for (Row plus : above) {
            for (Row minus : below) {
                Row sum = sum(plus, minus, column);
                counts.comparisons += kept.size() + sum.rest.at.length + sum.weights.at.length;
                if (counts.comparisons > MOST_COMPARISONS || !Memory.has(BYTES_PER_ENTRY * counts.entries)) {
                    throw new GaveUpException("net " + net.name() + ": " + what + ": gave up at " + kept.size() + " rows with "
                        + counts.entries + " entries, after " + counts.comparisons + " comparisons");
                }
                if (kept.stream().noneMatch(row -> row.supports(sum))) {
                    kept.removeIf(row -> {
                        boolean larger = sum.supports(row);
                        if (larger) {
                            counts.count(row, -1);
                        }
                        return larger;
                    });
                    counts.count(sum, 1);
                    kept.add(sum);
                    if (kept.size() > limit) {
                        return null;
                    }
                }
            }
        }
        above.forEach(row -> counts.count(row, -1));
        below.forEach(row -> counts.count(row, -1));
        return kept;
    }

    private static Row sum(Row plus, Row minus, int column) {
        long a = Math.negateExact(minus.rest.get(column));
        long b = plus.rest.get(column);
        long divisor = gcd(a, b);
        Sparse rest = plus.rest.combined(a / divisor, minus.rest, b / divisor);
        Sparse weights = plus.weights.combined(a / divisor, minus.weights, b / divisor);
        long common = 0;
        for (long value : weights.value) {
            common = gcd(common, value);
        }
        for (long value : rest.value) {
            common = gcd(common, Math.abs(value));
        }
        weights.divide(common);
        rest.divide(common);
        return new Row(rest, weights);
    }

    private static long gcd(long a, long b) {
        return b == 0 ? a : gcd(b, a % b);
    }

    /** The rank of the incidence matrix; throws a {@link GaveUpException} if that takes too much memory or time. */
    public static int rank(PetriNet net) {
        return new Rank(net).compute();
    }
}
