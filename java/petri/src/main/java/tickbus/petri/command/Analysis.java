package tickbus.petri.command;

import java.io.PrintStream;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.BitSet;
import java.util.List;
import java.util.Locale;
import java.util.TreeMap;
import java.util.function.IntFunction;
import java.util.function.Supplier;
import java.util.stream.Collectors;
import java.util.stream.IntStream;
import tickbus.petri.analysis.Conflicts;
import tickbus.petri.analysis.Coverability;
import tickbus.petri.analysis.Exploration;
import tickbus.petri.analysis.GaveUpException;
import tickbus.petri.analysis.Reachability;
import tickbus.petri.analysis.Semiflows;
import tickbus.petri.analysis.Siphons;
import tickbus.petri.analysis.Verdict;
import tickbus.petri.net.Marking;
import tickbus.petri.net.PetriNet;

/** The provable properties of a net, as text. */
final class Analysis {
    private static final List<String> PROPERTIES = List.of("bounded", "safe", "live", "deadlock-free", "reversible");
    private static final int MOST_ROWS = 10_000;
    private static final long MOST_STEPS = 1_000_000;
    private static final int MOST_COVERED = 20_000;
    /** The most entries of a kind that are listed; more are only counted. */
    private static final int MOST_LISTED = 50;
    private static final int LONGEST_PATH = 60;
    private static final int MOST_NAMES = 40;

    private final PetriNet net;
    private final int limit;
    private final PrintStream out;

    Analysis(PetriNet net, int limit, PrintStream out) {
        this.net = net;
        this.limit = limit;
        this.out = out;
    }

    /** The properties in a list with commas. */
    static List<String> required(String list) {
        List<String> all = Arrays.stream(list.split(",")).map(String::strip).filter(one -> !one.isEmpty()).toList();
        for (String one : all) {
            if (!PROPERTIES.contains(one)) {
                throw new UsageException("--require " + one + ": expected some of " + String.join(",", PROPERTIES));
            }
        }
        return all;
    }

    /** Prints all properties; returns the required ones that are not proven. */
    List<String> run(List<String> required) {
        line("net", net.name() + ": " + count(net.places().size(), "place") + ", " + count(net.transitions().size(), "transition")
            + ", " + count(net.arcs().size(), "arc"));
        Reachability graph = Reachability.explore(net, limit);
        line("markings", graph.isComplete() ? graph.size() + ", with " + count(graph.edges(), "firing")
            : "gave up at " + graph.size() + ": " + graph.gaveUpBecause().orElseThrow());
        Verdict bounded = graph.isBounded();
        if (bounded == Verdict.YES) {
            line("bounded", "yes; most tokens: " + bounds(graph::bound));
        } else {
            bounded = coverability();
        }
        line("safe", answer(graph.isSafe()));
        Reachability dead = graph.isDeadlockFree() == Verdict.UNKNOWN
            ? Exploration.of(net).markings(limit).memory(Runtime.getRuntime().maxMemory() / 8).withoutFirings().onlyForDeadlocks()
                .run() : graph;
        line("deadlock", dead == graph ? deadlock(dead, "the nearest")
            : deadlock(dead, "one") + " (stubborn sets: " + count(dead.size(), "marking") + ")");
        line("live", answer(graph.isLive()) + transitions(graph, "not live", graph::isLive));
        line("can fire", transitions(graph, "never", graph::canFire).isEmpty() ? graph.isComplete() ? "all" : "all, or unknown"
            : transitions(graph, "never", graph::canFire).substring(2));
        line("reversible", answer(graph.isReversible()) + (graph.isComplete() ? "; " + count(graph.homeStates().cardinality(),
            "home state") : ""));
        try {
            line("rank", Integer.toString(Semiflows.rank(net)));
        } catch (GaveUpException e) {
            line("rank", e.getMessage());
        }
        list("P-semiflows", () -> Semiflows.places(net, MOST_ROWS).stream().map(this::placeFlow).toList());
        list("T-semiflows", () -> Semiflows.transitions(net, MOST_ROWS).stream()
            .map(flow -> sum(flow, t -> net.transition(t).name())).toList());
        list("siphons", () -> sets(Siphons.siphons(net, MOST_STEPS)));
        list("traps", () -> sets(Siphons.traps(net, MOST_STEPS)));
        list("conflicts", () -> Conflicts.structural(net).stream().map(pair -> net.transition(pair.first()).name() + " and "
            + net.transition(pair.second()).name() + ", about " + net.place(pair.place()).name()).toList());
        Verdict boundedness = bounded;
        return required.stream().filter(one -> Verdict.YES != switch (one) {
            case "bounded" -> boundedness;
            case "safe" -> graph.isSafe();
            case "live" -> graph.isLive();
            case "deadlock-free" -> dead.isDeadlockFree();
            default -> graph.isReversible();
        }).toList();
    }

    /** With too many markings, the coverability graph can still show whether there are finitely many. */
    private Verdict coverability() {
        try {
            Coverability graph = Coverability.explore(net, Math.min(limit, MOST_COVERED));
            Verdict bounded = graph.isBounded();
            List<String> grow = net.places().stream().filter(place -> graph.bound(place.index()) == Coverability.OMEGA)
                .map(place -> place.name()).toList();
            line("bounded", answer(bounded) + (grow.isEmpty() ? "" : "; without bound: " + names(grow)));
            return bounded;
        } catch (UnsupportedOperationException | GaveUpException e) {
            line("bounded", "unknown: " + e.getMessage());
            return Verdict.UNKNOWN;
        }
    }

    private static String deadlock(Reachability graph, String which) {
        return graph.deadlock().map(found -> {
            List<String> path = found.firings();
            String first = String.join(", ", path.subList(0, Math.min(LONGEST_PATH, path.size())));
            return graph.deadlocks().size() + " found; " + which + " is " + found.marking() + (path.isEmpty() ? ", the initial marking"
                : " after " + count(path.size(), "firing") + ": " + first + (path.size() > LONGEST_PATH ? ", …" : ""));
        }).orElse(graph.isComplete() ? "none" : "none found so far");
    }

    private String transitions(Reachability graph, String what, IntFunction<Verdict> of) {
        List<String> found = net.transitions().stream().filter(one -> of.apply(one.index()) == Verdict.NO)
            .map(one -> one.name()).toList();
        return found.isEmpty() || !graph.isComplete() ? "" : "; " + what + ": " + names(found);
    }

    private String bounds(IntFunction<Integer> of) {
        TreeMap<Integer, List<String>> byBound = new TreeMap<>();
        net.places().forEach(place -> byBound.computeIfAbsent(of.apply(place.index()), key -> new ArrayList<>()).add(place.name()));
        return byBound.isEmpty() ? "there is no place" : byBound.entrySet().stream()
            .map(entry -> entry.getKey() + " in " + names(entry.getValue())).collect(Collectors.joining("; "));
    }

    private String placeFlow(int[] flow) {
        Marking initial = net.initialMarking();
        long total = IntStream.range(0, flow.length).mapToLong(p -> (long) flow[p] * initial.get(p)).sum();
        return sum(flow, p -> net.place(p).name()) + " = " + total;
    }

    private static String sum(int[] flow, IntFunction<String> name) {
        return IntStream.range(0, flow.length).filter(i -> flow[i] != 0)
            .mapToObj(i -> (flow[i] == 1 ? "" : flow[i] + " × ") + name.apply(i)).collect(Collectors.joining(" + "));
    }

    private List<String> sets(List<BitSet> sets) {
        return sets.stream().map(set -> set.stream().mapToObj(p -> net.place(p).name()).collect(Collectors.joining(", ", "{", "}")))
            .toList();
    }

    private void list(String what, Supplier<List<String>> of) {
        try {
            List<String> all = of.get();
            line(what, all.isEmpty() ? "none" : Integer.toString(all.size()));
            all.stream().limit(MOST_LISTED).forEach(one -> out.println("    " + one));
            if (all.size() > MOST_LISTED) {
                out.println("    … and " + (all.size() - MOST_LISTED) + " more");
            }
        } catch (GaveUpException e) {
            line(what, e.getMessage());
        }
    }

    private void line(String what, String text) {
        out.printf("%-12s %s%n", what, text);
    }

    private static String names(List<String> all) {
        return String.join(", ", all.subList(0, Math.min(MOST_NAMES, all.size())))
            + (all.size() > MOST_NAMES ? " and " + (all.size() - MOST_NAMES) + " more" : "");
    }

    private static String answer(Verdict verdict) {
        return verdict.name().toLowerCase(Locale.ROOT);
    }

    private static String count(long number, String what) {
        return number + " " + what + (number == 1 ? "" : "s");
    }
}
