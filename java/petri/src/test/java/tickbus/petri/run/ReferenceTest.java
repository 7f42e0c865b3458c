package tickbus.petri.run;

import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.junit.jupiter.api.Assertions.fail;

import java.io.IOException;
import java.io.InputStream;
import java.nio.charset.StandardCharsets;
import java.util.ArrayList;
import java.util.List;
import java.util.Objects;
import org.junit.jupiter.api.Test;
import tickbus.petri.draw.Dot;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.PlaceStep;
import tickbus.petri.net.TransitionStep;

/**
 * Compares the coordinator with the rules of docs/petri.md, which {@link Reference} implements: random nets with all
 * attributes, random inputs, at random times. A seed that fails goes to {@code reference-seeds.txt}. For longer runs: {@code
 * TICKBUS_WORLDS_SECONDS=600 mvn -f java -pl petri test -Dtest=ReferenceTest}; for one seed: {@code TICKBUS_SEED=4711}.
 */
class ReferenceTest {
    private static final int SCANS = 30;

    /** Features of a net; the bits of the number behind a seed's number. */
    private enum Feature {
        WEIGHTS, INHIBITORS, TESTS, CAPACITIES, PRIORITIES, TIMED_TRANSITIONS, TIMED_PLACES, CONDITIONS, EDGES, LATE_SCANS, TOKENS
    }

    private static final int ALL = (1 << Feature.values().length) - 1;

    /** A run, which these values determine completely. */
    private record Seed(long number, int features, int scans) {
        static Seed of(String text) {
            String[] parts = text.split(":");
            return parts.length == 1 ? new Seed(Long.parseLong(parts[0]), ALL, SCANS)
                : new Seed(Long.parseLong(parts[0]), Integer.parseInt(parts[1], 16), Integer.parseInt(parts[2]));
        }

        @Override
        public String toString() {
            return number + ":" + Integer.toHexString(features) + ":" + scans;
        }

        /** Shrinks to the fewest features and scans that still fail. */
        Seed shrunk() {
            Seed smallest = this;
            for (int bit = 0; bit < Feature.values().length; bit++) {
                Seed fewer = new Seed(number, smallest.features & ~(1 << bit), scans);
                smallest = difference(fewer) == null ? smallest : fewer;
            }
            while (smallest.scans > 1 && difference(new Seed(number, smallest.features, smallest.scans - 1)) != null) {
                smallest = new Seed(number, smallest.features, smallest.scans - 1);
            }
            return smallest;
        }
    }

    @Test
    void whatDifferedOnceAgrees() throws IOException {
        int count = 0;
        try (InputStream corpus = Objects.requireNonNull(getClass().getResourceAsStream("/reference-seeds.txt"))) {
            for (String line : new String(corpus.readAllBytes(), StandardCharsets.UTF_8).split("\n")) {
                if (!line.isBlank() && !line.startsWith("#")) {
                    agrees(Seed.of(line));
                    count++;
                }
            }
        }
        assertTrue(count > 0, "the corpus is empty");
    }

    @Test
    void randomNetsFireByTheRules() {
        String one = System.getenv("TICKBUS_SEED");
        if (one != null) {
            agrees(Seed.of(one));
            return;
        }
        String seconds = Objects.requireNonNullElse(System.getenv("TICKBUS_WORLDS_SECONDS"), "3");
        // Different in each run, and printed.
        long first = ProcessHandle.current().pid() << 32;
        System.out.println("nets from " + first + " on");
        long end = System.nanoTime() + Long.parseLong(seconds) * 1_000_000_000L;
        long number = first;
        while (System.nanoTime() < end) {
            agrees(new Seed(number++, ALL, SCANS));
        }
        System.out.println(number - first + " nets");
        assertTrue(number > first, "no net was drawn");
    }

    private static void agrees(Seed seed) {
        String difference = difference(seed);
        if (difference != null) {
            Seed small = seed.shrunk();
            fail(difference(small) + "\nin the net of seed " + seed + "; smaller: TICKBUS_SEED=" + small
                + " mvn -f java -pl petri test -Dtest=ReferenceTest\nOnce mended, add it to reference-seeds.txt.");
        }
    }

    private static boolean has(int features, Feature feature) {
        return (features >> feature.ordinal() & 1) == 1;
    }

    /** Runs a net, and returns where it first differs from the reference; null if it does not. */
    private static String difference(Seed seed) {
        Draws random = new Draws(seed.number);
        int features = random.below(1 << Feature.values().length) & seed.features;
        PetriNet net = net(random, features);
        int transitions = net.transitions().size();
        int[] input = new int[transitions];
        boolean[] edge = new boolean[transitions];
        double[] values = new double[3];
        CoordinatorBuilder builder = Coordinator.of(net).seed(random.below(1000)).limit(40).inputs("a", "b", "c")
            .reader(into -> System.arraycopy(values, 0, into, 0, 3));
        for (int t = 0; t < transitions; t++) {
            input[t] = random.below(5);
            edge[t] = random.below(2) == 0 && has(features, Feature.EDGES);
            // Above 2: no condition.
            int at = input[t] > 2 || !has(features, Feature.CONDITIONS) ? -1 : input[t];
            input[t] = at;
            Condition condition = at < 0 ? in -> true : in -> in.isOn(at);
            if (edge[t]) {
                builder.whenEdge("t" + t, condition);
            } else if (at >= 0) {
                builder.when("t" + t, condition);
            }
        }
        Reference reference = new Reference(net, edge);
        List<String> wrong = new ArrayList<>();
        Coordinator coordinator = builder.listener((scan, nanos, t, choices) -> {
            List<Integer> candidates = reference.candidates();
            if (wrong.isEmpty() && (!candidates.contains(t) || candidates.size() != choices)) {
                wrong.add("t" + t + " of " + choices + " fired; expected one of " + candidates);
            }
            reference.fire(t);
        }).build();
        long now = 0;
        for (int scan = 1; scan <= seed.scans; scan++) {
            now += random.below(has(features, Feature.LATE_SCANS) ? 60 : 12);
            boolean[] holds = new boolean[transitions];
            for (int i = 0; i < 3; i++) {
                values[i] = random.below(2);
            }
            for (int t = 0; t < transitions; t++) {
                holds[t] = input[t] < 0 || values[input[t]] != 0;
            }
            reference.begin(now, holds);
            int fired = coordinator.scan(now);
            if (wrong.isEmpty() && coordinator.stop().isPresent()) {
                boolean isRight = coordinator.stop().get().cause() == Stop.Cause.LIVELOCK && !reference.candidates().isEmpty();
                return isRight ? null : "scan " + scan + ": " + coordinator.stop().get().message() + "\n" + Dot.write(net, net.initialMarking());
            }
            if (wrong.isEmpty() && !reference.candidates().isEmpty()) {
                wrong.add("nothing fires any more; expected one of " + reference.candidates());
            }
            if (wrong.isEmpty() && coordinator.nextDue() != reference.nextDue()) {
                wrong.add("next due at " + coordinator.nextDue() + "; expected " + reference.nextDue());
            }
            if (wrong.isEmpty() && !coordinator.marking().equals(net.marking(reference.tokens()))) {
                wrong.add(coordinator.marking() + "; expected " + net.marking(reference.tokens()));
            }
            if (!wrong.isEmpty()) {
                return "scan " + scan + " at " + now + ", after " + fired + " firings: " + wrong.get(0) + "\n" + reference + "\n"
                    + Dot.write(net, net.initialMarking());
            }
        }
        return null;
    }

    private static PetriNet net(Draws random, int features) {
        NetBuilder builder = PetriNet.named("random");
        int places = 2 + random.below(5);
        int transitions = 1 + random.below(6);
        for (int p = 0; p < places; p++) {
            PlaceStep place = builder.place("p" + p, random.below(has(features, Feature.TOKENS) ? 4 : 2));
            if (random.below(3) == 0 && has(features, Feature.CAPACITIES)) {
                place.capacity(3 + random.below(2));
            }
            long delay = 10L * (1 + random.below(4));
            if (random.below(3) == 0 && has(features, Feature.TIMED_PLACES)) {
                place.delay(delay);
            }
        }
        for (int t = 0; t < transitions; t++) {
            TransitionStep transition = builder.transition("t" + t);
            int priority = random.below(3);
            if (has(features, Feature.PRIORITIES)) {
                transition.priority(priority);
            }
            long delay = 10L * random.below(4);
            if (random.below(2) == 0 && has(features, Feature.TIMED_TRANSITIONS)) {
                transition.delay(Delay.fixed(delay));
            }
            for (int p = 0; p < places; p++) {
                int kind = random.below(10);
                int drawn = 1 + random.below(5) / 3;
                int weight = has(features, Feature.WEIGHTS) ? drawn : 1;
                if (kind < 2) {
                    transition.input("p" + p, weight);
                }
                if (kind == 1 || kind == 2 || kind == 3) {
                    transition.output("p" + p, has(features, Feature.WEIGHTS) ? 1 + drawn / 2 : 1);
                }
                if (kind == 4 && has(features, Feature.TESTS)) {
                    transition.test("p" + p, weight);
                }
                if (kind == 5 && has(features, Feature.INHIBITORS)) {
                    transition.inhibitor("p" + p, weight + 1);
                }
            }
        }
        return builder.build();
    }
}
