package tickbus.petri.analysis;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.math.BigInteger;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Arrays;
import java.util.List;
import java.util.concurrent.TimeUnit;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Draws;

/** The memory that analyses of large nets need, and where they give up. */
class LargeNetsTest {
    @TempDir
    Path folder;

    static PetriNet ring(int size) {
        NetBuilder net = PetriNet.named("ring");
        for (int i = 0; i < size; i++) {
            net.place("p" + i, i == 0 ? 1 : 0);
        }
        for (int i = 0; i < size; i++) {
            net.transition("t" + i).input("p" + i).output("p" + (i + 1) % size);
        }
        return net.build();
    }

    /** Runs in a JVM with 128 MB, where a matrix of places and transitions would take 576 MB. */
    public static void main(String[] args) {
        PetriNet ring = ring(12_000);
        System.out.println("coverability " + Coverability.explore(ring, 100).size());
        System.out.println("rank " + Semiflows.rank(ring));
        System.out.println("siphons " + gaveUp(() -> Siphons.siphons(ring, 1000)));
        System.out.println("traps " + gaveUp(() -> Siphons.traps(ring, 1000)));
        System.out.println("P-semiflows " + gaveUp(() -> Semiflows.places(ring, 100)));
        markings(big());
        covered(big());
    }

    private static PetriNet big() {
        NetBuilder big = PetriNet.named("big");
        for (int i = 0; i < 30; i++) {
            big.place("a" + i, 1).place("b" + i);
        }
        for (int i = 0; i < 30; i++) {
            big.transition("x" + i).input("a" + i).output("b" + i).transition("y" + i).input("b" + i).output("a" + i);
        }
        return big.build();
    }

    private static void markings(PetriNet big) {
        Reachability graph = Reachability.explore(big, Integer.MAX_VALUE);
        System.out.println("markings " + (graph.size() > 10_000) + " " + graph.isComplete() + " " + graph.isBounded());
    }

    private static void covered(PetriNet big) {
        Coverability covered = Coverability.explore(big, Integer.MAX_VALUE);
        System.out.println("covered " + (covered.size() > 10_000) + " " + covered.isComplete());
    }

    private static String gaveUp(Runnable analysis) {
        try {
            analysis.run();
            return "came to the end";
        } catch (GaveUpException e) {
            return e.getMessage();
        }
    }

    @Test
    void whatDoesNotFitIntoTheHeapIsGivenUpAndTheRestIsAnswered() throws IOException, InterruptedException {
        Path out = folder.resolve("out");
        Process small = new ProcessBuilder(Path.of(System.getProperty("java.home"), "bin", "java").toString(), "-Xmx128m",
            "-XX:+UseSerialGC", "-cp", System.getProperty("java.class.path"), LargeNetsTest.class.getName())
            .redirectErrorStream(true).redirectOutput(out.toFile()).start();
        boolean ended = small.waitFor(300, TimeUnit.SECONDS);
        small.destroyForcibly();
        assertTrue(ended, () -> "not within 300 s: " + text(out));
        assertEquals(List.of("coverability 100", "rank 11999", "siphons net ring: siphons: gave up at 1000 steps, with 0 found",
            "traps net ring: traps: gave up at 1000 steps, with 0 found",
            "P-semiflows net ring: P-semiflows: gave up at 100 rows, with 12000 of 12000 columns left",
            "markings true false UNKNOWN", "covered true false"), text(out).lines().toList());
    }

    private static String text(Path file) {
        try {
            return Files.readString(file, StandardCharsets.UTF_8);
        } catch (IOException e) {
            return e.toString();
        }
    }

    @Test
    void aRingOfThousandsIsProvenWhole() {
        PetriNet ring = ring(2_000);
        assertEquals(1, Semiflows.places(ring, 10_000).size());
        assertEquals(1, Semiflows.transitions(ring, 10_000).size());
        assertEquals(1, Siphons.siphons(ring, 5_000_000).size());
        assertEquals(1999, Semiflows.rank(ring));
    }

    /** Bareiss, in numbers of any size. */
    private static int exactRank(int[][] matrix, int columns) {
        BigInteger[][] m = Arrays.stream(matrix)
            .map(row -> Arrays.stream(row).mapToObj(BigInteger::valueOf).toArray(BigInteger[]::new)).toArray(BigInteger[][]::new);
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

    @Test
    void theRankIsThatOfAnExactElimination() {
        Draws random = new Draws(5);
        boolean[] deficient = new boolean[2];
        for (int round = 0; round < 500; round++) {
            int places = 1 + random.below(7);
            int transitions = 1 + random.below(7);
            int[][] incidence = new int[places][transitions];
            for (int[] row : incidence) {
                for (int t = 0; t < transitions; t++) {
                    row[t] = random.below(2) == 0 ? 0 : random.below(7) - 3;
                }
            }
            int exact = exactRank(incidence, transitions);
            deficient[exact < Math.min(places, transitions) ? 1 : 0] = true;
            assertEquals(exact, Semiflows.rank(PetriNet.fromIncidence("m", incidence, new int[places])), Arrays.deepToString(incidence));
        }
        assertTrue(deficient[0] && deficient[1]);
    }

    /** The first prime divides the whole matrix: the next ones find the rank. */
    @Test
    void aPrimeThatDividesAllIsNotTaken() {
        int prime = Integer.MAX_VALUE;
        assertEquals(1, Semiflows.rank(PetriNet.fromIncidence("m", new int[][] {{-prime, prime}, {prime, -prime}}, new int[2])));
        assertEquals(2, Semiflows.rank(PetriNet.fromIncidence("m", new int[][] {{prime, 0}, {0, -prime}}, new int[2])));
    }
}
