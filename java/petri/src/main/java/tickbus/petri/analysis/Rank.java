package tickbus.petri.analysis;

import java.util.Arrays;
import tickbus.petri.net.Effects;
import tickbus.petri.net.PetriNet;

/**
 * The exact rank of the incidence matrix. The rank modulo a prime is at most the rank over the integers, and equal to it
 * unless the prime divides every minor of that size. So it is computed modulo several primes, until their product exceeds
 * the greatest possible value of a larger minor (Hadamard).
 */
final class Rank {
    /** Entries in memory, and steps of elimination, of all primes together. */
    private static final long MOST_ENTRIES = 50_000_000;
    private static final long MOST_STEPS = 5_000_000_000L;

    private final PetriNet net;
    private final int transitions;
    private final int places;
    private long steps;
    /** The last column where the current row can be other than 0. */
    private int last;
    private long prime = Integer.MAX_VALUE;

    Rank(PetriNet net) {
        this.net = net;
        transitions = net.transitions().size();
        places = net.places().size();
    }

    int compute() {
        int least = 0;
        int most = Math.min(transitions, places);
        double proven = 0;
        double[] logs = logarithms();
        while (true) {
            least = Math.max(least, modulo());
            proven += Math.log(prime);
            // A minor of one more row is a determinant below the product of its rows' lengths.
            double bound = 0;
            for (int i = 0; i <= least && i < logs.length; i++) {
                bound += logs[i];
            }
            if (least == most || proven > bound + 1) {
                return least;
            }
            do {
                prime -= 2;
            } while (!isPrime(prime));
        }
    }

    /** The logarithm of each transition's length as a vector, at least 0, the greatest first. */
    private double[] logarithms() {
        Effects effects = net.effects();
        double[] logs = new double[transitions];
        for (int t = 0; t < transitions; t++) {
            double square = 0;
            for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
                double gain = (double) effects.puts(i) - effects.takes(i);
                square += gain * gain;
            }
            logs[transitions - 1 - t] = square == 0 ? 0 : Math.log(square) / 2;
        }
        Arrays.sort(logs);
        for (int i = 0; i < transitions / 2; i++) {
            double swapped = logs[i];
            logs[i] = logs[transitions - 1 - i];
            logs[transitions - 1 - i] = swapped;
        }
        return logs;
    }

    private static boolean isPrime(long odd) {
        for (long divisor = 3; divisor * divisor <= odd; divisor += 2) {
            if (odd % divisor == 0) {
                return false;
            }
        }
        return true;
    }

    /** Takes the transitions as rows one after the other; each row that is not 0 in the end has its own first place. */
    private int modulo() {
        Effects effects = net.effects();
        int[][] at = new int[places][];
        int[][] value = new int[places][];
        long[] row = new long[places];
        long entries = 0;
        int rank = 0;
        for (int t = 0; t < transitions; t++) {
            int first = places;
            last = -1;
            for (int i = effects.firstChange(t); i < effects.firstChange(t + 1); i++) {
                int p = effects.changePlace(i);
                row[p] = Math.floorMod((long) effects.puts(i) - effects.takes(i), prime);
                first = Math.min(first, p);
                last = Math.max(last, p);
            }
            int p = first;
            while (p <= last && (row[p] == 0 || at[p] != null)) {
                if (row[p] != 0) {
                    subtract(row, at[p], value[p]);
                }
                p++;
            }
            steps += Math.max(0, p - first);
            if (p <= last) {
                entries += keep(row, p, at, value);
                rank++;
            }
            if (entries > MOST_ENTRIES || steps > MOST_STEPS) {
                throw new GaveUpException("net " + net.name() + ": rank: gave up at " + rank + ", as the elimination has "
                    + entries + " entries and took " + steps + " steps");
            }
        }
        return rank;
    }

    private void subtract(long[] row, int[] at, int[] value) {
        long factor = prime - row[at[0]];
        for (int i = 0; i < at.length; i++) {
            row[at[i]] = (row[at[i]] + factor * value[i]) % prime;
        }
        last = Math.max(last, at[at.length - 1]);
        steps += at.length;
    }

    /** Keeps a row, with a 1 at its first place, and clears it. */
    private int keep(long[] row, int p, int[][] at, int[][] value) {
        int count = 0;
        for (int q = p; q <= last; q++) {
            count += row[q] == 0 ? 0 : 1;
        }
        int[] where = new int[count];
        int[] what = new int[count];
        long inverse = power(row[p], prime - 2);
        int next = 0;
        for (int q = p; q <= last; q++) {
            if (row[q] != 0) {
                where[next] = q;
                what[next++] = (int) (row[q] * inverse % prime);
                row[q] = 0;
            }
        }
        at[p] = where;
        value[p] = what;
        steps += last - p;
        return count;
    }

    private long power(long of, long exponent) {
        long result = 1;
        long square = of;
        for (long left = exponent; left > 0; left /= 2) {
            result = left % 2 == 1 ? result * square % prime : result;
            square = square * square % prime;
        }
        return result;
    }
}
