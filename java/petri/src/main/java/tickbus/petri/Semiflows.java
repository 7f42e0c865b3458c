package tickbus.petri;

import java.math.BigInteger;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.BitSet;
import java.util.List;

/**
 * Minimal semiflows by Farkas' algorithm, and the rank of the incidence matrix.
 *
 * <p>A P-semiflow weights the places so that the weighted sum of tokens never changes; a T-semiflow counts firings that
 * together change nothing. Minimal ones have no other one's support within theirs, and no common divisor. Test and
 * inhibitor arcs do not matter to either.
 */
public final class Semiflows {
    private Semiflows() {
    }

    /** The minimal P-semiflows, a weight for each place; a {@link GaveUpException} at more than {@code limit} rows. */
    public static List<int[]> places(PetriNet net, int limit) {
        return farkas(net, "P-semiflows", net.incidence(), net.transitions().size(), limit);
    }

    /** The minimal T-semiflows, a count for each transition; a {@link GaveUpException} at more than {@code limit} rows. */
    public static List<int[]> transitions(PetriNet net, int limit) {
        int[][] incidence = net.incidence();
        int[][] transposed = new int[net.transitions().size()][net.places().size()];
        for (int p = 0; p < incidence.length; p++) {
            for (int t = 0; t < transposed.length; t++) {
                transposed[t][p] = incidence[p][t];
            }
        }
        return farkas(net, "T-semiflows", transposed, net.places().size(), limit);
    }

    /** What remains to become 0, and the combination of rows that gives it. */
    private static final class Row {
        final long[] rest;
        final long[] weights;
        final BitSet support = new BitSet();

        Row(long[] rest, long[] weights) {
            this.rest = rest;
            this.weights = weights;
            for (int i = 0; i < weights.length; i++) {
                support.set(i, weights[i] != 0);
            }
        }

        boolean supports(Row other) {
            BitSet more = (BitSet) support.clone();
            more.andNot(other.support);
            return more.isEmpty();
        }
    }

    private static List<int[]> farkas(PetriNet net, String what, int[][] matrix, int columns, int limit) {
        List<Row> rows = new ArrayList<>();
        for (int i = 0; i < matrix.length; i++) {
            long[] weights = new long[matrix.length];
            weights[i] = 1;
            rows.add(new Row(Arrays.stream(matrix[i]).asLongStream().toArray(), weights));
        }
        BitSet left = new BitSet();
        left.set(0, columns);
        while (!left.isEmpty()) {
            int column = cheapest(rows, left);
            left.clear(column);
            try {
                rows = eliminate(rows, column, limit);
            } catch (ArithmeticException overflow) {
                throw new GaveUpException("net " + net.name() + ": " + what + ": gave up, as a weight is greater than "
                    + Long.MAX_VALUE);
            }
            if (rows == null) {
                throw new GaveUpException("net " + net.name() + ": " + what + ": gave up at " + limit + " rows, with "
                    + (left.cardinality() + 1) + " of " + columns + " columns left");
            }
        }
        List<int[]> flows = new ArrayList<>();
        for (Row row : rows) {
            try {
                flows.add(Arrays.stream(row.weights).mapToInt(Math::toIntExact).toArray());
            } catch (ArithmeticException overflow) {
                throw new GaveUpException("net " + net.name() + ": " + what + ": gave up, as a weight is greater than "
                    + Integer.MAX_VALUE);
            }
        }
        flows.sort((a, b) -> Arrays.compare(b, a));
        return flows;
    }

    /** The column that makes the fewest new rows. */
    private static int cheapest(List<Row> rows, BitSet left) {
        int best = -1;
        long least = Long.MAX_VALUE;
        for (int column = left.nextSetBit(0); column >= 0; column = left.nextSetBit(column + 1)) {
            long positive = 0;
            long negative = 0;
            for (Row row : rows) {
                positive += row.rest[column] > 0 ? 1 : 0;
                negative += row.rest[column] < 0 ? 1 : 0;
            }
            long made = positive * negative - positive - negative;
            if (made < least) {
                least = made;
                best = column;
            }
        }
        return best;
    }

    /** The rows that are 0 in the column, with all positive combinations that become so; null above the limit. */
    private static List<Row> eliminate(List<Row> rows, int column, int limit) {
        List<Row> kept = new ArrayList<>();
        for (Row row : rows) {
            if (row.rest[column] == 0) {
                kept.add(row);
            }
        }
        for (Row plus : rows) {
            for (Row minus : plus.rest[column] > 0 ? rows : List.<Row>of()) {
                if (minus.rest[column] >= 0) {
                    continue;
                }
                Row sum = sum(plus, minus, column);
                if (kept.stream().noneMatch(row -> row.supports(sum))) {
                    kept.removeIf(row -> sum.supports(row));
                    kept.add(sum);
                    if (kept.size() > limit) {
                        return null;
                    }
                }
            }
        }
        return kept;
    }

    private static Row sum(Row plus, Row minus, int column) {
        long a = Math.negateExact(minus.rest[column]);
        long b = plus.rest[column];
        long divisor = gcd(a, b);
        long[] rest = combine(plus.rest, a / divisor, minus.rest, b / divisor);
        long[] weights = combine(plus.weights, a / divisor, minus.weights, b / divisor);
        long common = 0;
        for (long value : weights) {
            common = gcd(common, value);
        }
        for (long value : rest) {
            common = gcd(common, Math.abs(value));
        }
        for (int i = 0; i < weights.length; i++) {
            weights[i] /= common;
        }
        for (int i = 0; i < rest.length; i++) {
            rest[i] /= common;
        }
        return new Row(rest, weights);
    }

    private static long[] combine(long[] x, long a, long[] y, long b) {
        long[] sum = new long[x.length];
        for (int i = 0; i < x.length; i++) {
            sum[i] = Math.addExact(Math.multiplyExact(x[i], a), Math.multiplyExact(y[i], b));
        }
        return sum;
    }

    private static long gcd(long a, long b) {
        return b == 0 ? a : gcd(b, a % b);
    }

    /** The rank of the incidence matrix. */
    public static int rank(PetriNet net) {
        BigInteger[][] m = Arrays.stream(net.incidence())
            .map(row -> Arrays.stream(row).mapToObj(BigInteger::valueOf).toArray(BigInteger[]::new))
            .toArray(BigInteger[][]::new);
        int columns = net.transitions().size();
        int rank = 0;
        BigInteger last = BigInteger.ONE;
        for (int column = 0; column < columns && rank < m.length; column++) {
            int pivot = rank;
            while (pivot < m.length && m[pivot][column].signum() == 0) {
                pivot++;
            }
            if (pivot == m.length) {
                continue;
            }
            BigInteger[] swapped = m[rank];
            m[rank] = m[pivot];
            m[pivot] = swapped;
            // Bareiss: every division is exact.
            for (int row = rank + 1; row < m.length; row++) {
                for (int c = columns - 1; c >= column; c--) {
                    m[row][c] = m[row][c].multiply(m[rank][column]).subtract(m[row][column].multiply(m[rank][c])).divide(last);
                }
            }
            last = m[rank][column];
            rank++;
        }
        return rank;
    }
}
