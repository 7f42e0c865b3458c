package tickbus.bench;

import java.util.concurrent.TimeUnit;
import org.openjdk.jmh.annotations.Benchmark;
import org.openjdk.jmh.annotations.BenchmarkMode;
import org.openjdk.jmh.annotations.Fork;
import org.openjdk.jmh.annotations.Measurement;
import org.openjdk.jmh.annotations.Mode;
import org.openjdk.jmh.annotations.OperationsPerInvocation;
import org.openjdk.jmh.annotations.OutputTimeUnit;
import org.openjdk.jmh.annotations.Param;
import org.openjdk.jmh.annotations.Scope;
import org.openjdk.jmh.annotations.Setup;
import org.openjdk.jmh.annotations.State;
import org.openjdk.jmh.annotations.TearDown;
import org.openjdk.jmh.annotations.Warmup;
import tickbus.petri.analysis.Reachability;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Coordinator;
import tickbus.petri.run.CoordinatorBuilder;

/** The cost of a firing of a Petri net, and of a marking of its reachability graph. */
@BenchmarkMode(Mode.AverageTime)
@OutputTimeUnit(TimeUnit.NANOSECONDS)
@Fork(3)
@Warmup(iterations = 5, time = 1)
@Measurement(iterations = 5, time = 1)
public class PetriBench {
    private static final int MACHINES = 50;
    private static final int INPUTS = 64;
    private static final int FIRINGS = 10_000;
    private static final int MARKINGS = 1_000_000;

    /** Made by JMH. */
    public PetriBench() {
    }

    /** 50 machines of two places each, whose conditions look at 64 inputs that change in every scan. */
    @State(Scope.Thread)
    public static class Machines {
        private Coordinator coordinator;
        private long scan;

        /** Made by JMH. */
        public Machines() {
        }

        /** Builds the net. */
        @Setup
        public void build() {
            NetBuilder net = PetriNet.named("machines");
            for (int i = 0; i < MACHINES; i++) {
                net.place("idle" + i, 1).place("busy" + i);
                net.transition("start" + i).input("idle" + i).output("busy" + i);
                net.transition("end" + i).input("busy" + i).output("idle" + i);
            }
            String[] names = new String[INPUTS];
            java.util.Arrays.setAll(names, i -> "i" + i);
            CoordinatorBuilder builder = Coordinator.of(net.build()).inputs(names).reader(values -> {
                for (int i = 0; i < values.length; i++) {
                    values[i] = scan + i & 1;
                }
            });
            for (int i = 0; i < MACHINES; i++) {
                int input = i + i % (INPUTS - MACHINES);
                builder.when("start" + i, in -> in.isOn(input)).when("end" + i, in -> !in.isOn(input));
            }
            coordinator = builder.build();
            // From here on each machine fires in every scan.
            coordinator.scan(scan++);
        }
    }

    /** A ring with one token, of which one transition at a time is enabled. */
    @State(Scope.Thread)
    public static class Ring {
        /** Transitions. */
        @Param({"10", "100", "1000", "10000"})
        public int transitions;

        private Coordinator coordinator;
        private long now;

        /** Made by JMH. */
        public Ring() {
        }

        /** Builds the net; the delay of its first place ends a scan after one lap. */
        @Setup
        public void build() {
            NetBuilder net = PetriNet.named("ring");
            for (int i = 0; i < transitions; i++) {
                net.place("p" + i, i == 0 ? 1 : 0).delay(i == 0 ? 1 : 0);
            }
            for (int i = 0; i < transitions; i++) {
                net.transition("t" + i).input("p" + i).output("p" + (i + 1) % transitions);
            }
            coordinator = Coordinator.of(net.build()).limit(Integer.MAX_VALUE).build();
            coordinator.scan(now++);
        }
    }

    /** The memory of a reachability graph, printed in the form of the Rust benchmarks. */
    @State(Scope.Thread)
    public static class Memory {
        private long bytes;

        /** Made by JMH. */
        public Memory() {
        }

        /** Prints the memory. */
        @TearDown
        public void tell() {
            System.out.println();
            System.out.println("rust petri.bytes_per_marking " + bytes / MARKINGS);
        }
    }

    /**
     * A firing in a net of 100 places with 64 bound signals.
     *
     * @param machines the net
     * @return transitions that fired
     */
    @Benchmark
    @OperationsPerInvocation(MACHINES)
    public int firing(Machines machines) {
        int fired = machines.coordinator.scan(machines.scan++);
        if (fired != MACHINES) {
            throw new IllegalStateException(fired + " transitions fired instead of " + MACHINES);
        }
        return fired;
    }

    /**
     * A firing in nets of different sizes.
     *
     * @param ring the net
     * @return transitions that fired
     */
    @Benchmark
    @OperationsPerInvocation(FIRINGS)
    public int ring(Ring ring) {
        int fired = 0;
        while (fired < FIRINGS) {
            fired += ring.coordinator.scan(ring.now++);
        }
        return fired;
    }

    /**
     * The reachability graph of six machines of ten places: 1,000,000 markings.
     *
     * @param memory gets its size
     * @return the graph
     */
    @Benchmark
    @Fork(1)
    @Warmup(iterations = 1, time = 1)
    @Measurement(iterations = 3, time = 1)
    @OperationsPerInvocation(MARKINGS)
    public Reachability marking(Memory memory) {
        NetBuilder net = PetriNet.named("million");
        for (int machine = 0; machine < 6; machine++) {
            for (int i = 0; i < 10; i++) {
                net.place("m" + machine + "p" + i, i == 0 ? 1 : 0);
            }
            for (int i = 0; i < 10; i++) {
                net.transition("m" + machine + "t" + i).input("m" + machine + "p" + i)
                    .output("m" + machine + "p" + (i + 1) % 10);
            }
        }
        Reachability graph = Reachability.explore(net.build(), 2 * MARKINGS);
        memory.bytes = graph.bytes();
        return graph;
    }
}
