package tickbus.bench;

import java.util.Arrays;
import java.util.List;
import java.util.Locale;
import tickbus.NativeBaseline;
import tickbus.Tickbus;

/**
 * Figures to be compared with each other, measured by turns in one process, a quarter of a millisecond each. A processor's
 * speed and its other load change from second to second, so the compared figures must be measured close together. Two forks
 * of JMH, half a minute apart, are not.
 *
 * <p>The drivers stay open all the time, so the bus threads of the free bus also run during the turns of the empty call. The
 * output has the median of each figure, and the median of its ratios to the first figure of the same round, in the format of
 * {@code tools/bench-table}.
 */
public final class ByTurns {
    private static final int ROUNDS = 1_000;
    /** Short compared with the system's time slice, so that most turns are not interrupted. */
    private static final long TURN_NANOS = 250_000;
    /** The fewest calls of a turn, for slow calls. */
    private static final int FEWEST = 24;
    /** Short calls before the measurement: the compiler counts a method's calls, and needs time to compile it. */
    private static final int SHORT_CALLS = 5_000;
    private static final int SHORT = 20;
    private static final int WARM_UP_ROUNDS = 50;
    /** The part of a turn that precedes it and does not count: the previous turn's data are still in the caches. */
    private static final int LEAD = 8;

    /** Takes the results, so that the compiler cannot drop their computation. */
    private static volatile double sink;

    private ByTurns() {
    }

    /** A measured operation: makes a number of calls one after the other. */
    private interface Calls {
        double make(int count);
    }

    /** One of the operations that take turns. */
    private static final class Turn {
        private final String name;
        private final Calls calls;
        private final double[] nanos = new double[ROUNDS];
        private int count = FEWEST;

        Turn(String name, Calls calls) {
            this.name = name;
            this.calls = calls;
        }

        /** Calls until the code is compiled, and determines the number of calls per turn. */
        void prepare() {
            for (int i = 0; i < SHORT_CALLS; i++) {
                sink = calls.make(SHORT);
            }
            for (double span = nanos(); span < TURN_NANOS; span = nanos()) {
                count = (int) Math.ceil(count * Math.min(10, 1.1 * TURN_NANOS / span));
            }
        }

        /** The time of one turn. */
        private double nanos() {
            sink = calls.make(Math.max(1, count / LEAD));
            long before = System.nanoTime();
            sink = calls.make(count);
            return System.nanoTime() - before;
        }

        void measure(int round) {
            nanos[round] = nanos() / count;
        }

        double median() {
            return ByTurns.median(nanos);
        }

        double medianAgainst(Turn other) {
            double[] ratios = new double[ROUNDS];
            Arrays.setAll(ratios, round -> nanos[round] / other.nanos[round]);
            return ByTurns.median(ratios);
        }
    }

    /** A tick with REAL signals: sets all by an array and gets all by an array, with a fresh frame. */
    private static final class Reals implements AutoCloseable {
        private final double[] values;
        private final double[] inputs;
        private final Tickbus bus;
        private long now;

        Reals(int eachWay) {
            values = new double[eachWay];
            inputs = new double[eachWay];
            bus = Tickbus.open(BenchCfg.reals("stepped", eachWay));
        }

        double tick() {
            now += BenchCfg.TICK_NANOS;
            values[(int) (now / BenchCfg.TICK_NANOS % values.length)] = now;
            bus.setAll(values);
            bus.exchange(now);
            bus.getAll(inputs);
            return inputs[0];
        }

        @Override
        public void close() {
            bus.close();
        }
    }

    /**
     * Measures, and prints.
     *
     * @param arguments none
     */
    public static void main(String[] arguments) {
        NativeBaseline.load();
        bits();
        reals();
    }

    private static void bits() {
        RigTickBench.Free driver = new RigTickBench.Free();
        driver.open();
        List<Turn> turns = List.of(
            new Turn("tick.empty", count -> {
                double sum = 0;
                for (int i = 0; i < count; i++) {
                    sum += NativeBaseline.call();
                }
                return sum;
            }),
            new Turn("tick.exchange", count -> {
                double sum = 0;
                for (int i = 0; i < count; i++) {
                    sum += driver.exchange();
                }
                return sum;
            }),
            new Turn("tick.halves", count -> {
                double sum = 0;
                for (int i = 0; i < count; i++) {
                    sum += driver.receiveAndSend();
                }
                return sum;
            }),
            new Turn("tick.arrays", count -> {
                double sum = 0;
                for (int i = 0; i < count; i++) {
                    sum += driver.tickByArray();
                }
                return sum;
            }),
            new Turn("tick.signals", count -> {
                double sum = 0;
                for (int i = 0; i < count; i++) {
                    sum += driver.tick();
                }
                return sum;
            }));
        measure(turns);
        Turn empty = turns.get(0);
        for (Turn turn : turns) {
            print(turn.name, turn.median());
            print(turn.name + ".ratio", turn.medianAgainst(empty));
        }
        driver.close();
    }

    private static void reals() {
        try (Reals ten = new Reals(10); Reals hundred = new Reals(100); Reals thousand = new Reals(1_000);
            Reals tenThousand = new Reals(10_000)) {
            List<Turn> turns = List.of(ticks(ten), ticks(hundred), ticks(thousand), ticks(tenThousand));
            measure(turns);
            turns.forEach(turn -> print(turn.name, turn.median()));
        }
    }

    private static Turn ticks(Reals reals) {
        return new Turn("tick.reals/" + reals.values.length, count -> {
            double sum = 0;
            for (int i = 0; i < count; i++) {
                sum += reals.tick();
            }
            return sum;
        });
    }

    /** Measures by turns; each round begins with another operation. */
    private static void measure(List<Turn> turns) {
        turns.forEach(Turn::prepare);
        for (int round = -WARM_UP_ROUNDS; round < ROUNDS; round++) {
            for (int i = 0; i < turns.size(); i++) {
                turns.get(Math.floorMod(round + i, turns.size())).measure(Math.max(0, round));
            }
        }
    }

    private static double median(double[] values) {
        double[] sorted = values.clone();
        Arrays.sort(sorted);
        return (sorted[(sorted.length - 1) / 2] + sorted[sorted.length / 2]) / 2;
    }

    private static void print(String name, double value) {
        System.out.printf(Locale.ROOT, "rust %s %.3f%n", name, value);
    }
}
