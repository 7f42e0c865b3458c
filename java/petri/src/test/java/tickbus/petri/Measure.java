package tickbus.petri;

/**
 * Figures by hand, without a harness: {@code java -cp target/classes:target/test-classes tickbus.petri.Measure}. Each is
 * the best of several rounds.
 */
final class Measure {
    private Measure() {
    }

    public static void main(String[] arguments) {
        scans();
        for (int size : new int[] {10, 100, 1000, 10_000}) {
            ring(size);
        }
        states();
    }

    /** 50 independent machines of two places, whose conditions look at 64 inputs. */
    private static void scans() {
        NetBuilder net = PetriNet.named("100 places");
        for (int i = 0; i < 50; i++) {
            net.place("idle" + i, 1).place("busy" + i);
            net.transition("start" + i).input("idle" + i).output("busy" + i);
            net.transition("end" + i).input("busy" + i).output("idle" + i);
        }
        PetriNet built = net.build();
        String[] names = new String[64];
        java.util.Arrays.setAll(names, i -> "i" + i);
        long[] tick = {0};
        CoordinatorBuilder builder = Coordinator.of(built).inputs(names).reader(values -> {
            tick[0]++;
            for (int i = 0; i < values.length; i++) {
                values[i] = tick[0] + i & 1;
            }
        });
        for (int i = 0; i < 50; i++) {
            int input = i + i % 14;
            builder.when("start" + i, in -> in.isOn(input)).when("end" + i, in -> !in.isOn(input));
        }
        Coordinator coordinator = builder.build();
        long best = 0;
        double scanNanos = Double.MAX_VALUE;
        for (int round = 0; round < 10; round++) {
            long start = System.nanoTime();
            long fired = 0;
            for (int i = 0; i < 50_000; i++) {
                fired += coordinator.scan(tick[0]);
            }
            long took = System.nanoTime() - start;
            best = Math.max(best, fired * 1_000_000_000L / took);
            scanNanos = Math.min(scanNanos, took / 50_000.0);
        }
        System.out.printf("100 places, 64 inputs, 50 firings a scan: %,d firings/s, %.0f ns/scan%n", best, scanNanos);
    }

    private static void ring(int size) {
        PetriNet net = CoordinatorTest.ring(size);
        // A timed first place ends the scan after one lap.
        double best = Double.MAX_VALUE;
        NetBuilder builder = PetriNet.named("lap");
        net.places().forEach(place -> builder.place(place.name(), place.initial()).delay(place.index() == 0 ? 1L : 0L));
        net.transitions().forEach(transition -> builder.transition(transition.name()));
        net.arcs().forEach(arc -> builder.arc(arc.kind(), net.place(arc.place()).name(),
            net.transition(arc.transition()).name(), arc.weight()));
        Coordinator laps = Coordinator.of(builder.build()).limit(Integer.MAX_VALUE).build();
        long now = 0;
        for (int round = 0; round < 10; round++) {
            long start = System.nanoTime();
            long fired = 0;
            while (fired < 1_000_000) {
                fired += laps.scan(now++);
            }
            best = Math.min(best, (System.nanoTime() - start) / (double) fired);
        }
        System.out.printf("ring of %,d transitions, one enabled: %.1f ns/firing%n", size, best);
    }

    /** Six machines of ten states: 1,000,000 markings of 60 places. */
    private static void states() {
        NetBuilder builder = PetriNet.named("million");
        for (int m = 0; m < 6; m++) {
            for (int s = 0; s < 10; s++) {
                builder.place("m" + m + "s" + s, s == 0 ? 1 : 0);
            }
            for (int s = 0; s < 10; s++) {
                builder.transition("t" + m + "s" + s).input("m" + m + "s" + s).output("m" + m + "s" + (s + 1) % 10);
            }
        }
        PetriNet net = builder.build();
        for (int round = 0; round < 3; round++) {
            long start = System.nanoTime();
            Reachability graph = Reachability.explore(net, 2_000_000);
            double seconds = (System.nanoTime() - start) / 1e9;
            System.out.printf("%s: %,.0f states/s, %.1f bytes/state with all firings%n", graph, graph.size() / seconds,
                graph.bytes() / (double) graph.size());
            start = System.nanoTime();
            System.out.printf("  live %s, reversible %s: %.2f s%n", graph.isLive(), graph.isReversible(),
                (System.nanoTime() - start) / 1e9);
        }
    }
}
