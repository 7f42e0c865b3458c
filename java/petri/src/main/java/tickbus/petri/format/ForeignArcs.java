package tickbus.petri.format;

import java.util.ArrayList;
import java.util.HashSet;
import java.util.List;
import java.util.Map;
import java.util.Set;
import java.util.TreeMap;
import java.util.function.Predicate;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;

/** A net's arcs and names as another tool can hold them, with the same markings and firings. */
final class ForeignArcs {
    /** The arcs of a tool, beside inputs and outputs. */
    enum Has {
        INPUTS_AND_OUTPUTS,
        /** Inhibitor arcs of weight 1. */
        INHIBITORS_OF_1,
        INHIBITORS,
        INHIBITORS_AND_CAPACITIES,
        INHIBITORS_AND_TESTS
    }

    private ForeignArcs() {
    }

    /**
     * The arcs for a tool. A test arc becomes a loop, a capacity an inhibitor arc, if the tool lacks them; what it cannot
     * hold is a {@link NetException} with all such arcs.
     */
    static List<Arc> of(PetriNet net, String tool, Has has) {
        List<String> mistakes = new ArrayList<>();
        List<Arc> arcs = new ArrayList<>();
        int all = net.transitions().size();
        List<Map<Integer, int[]>> byTransition = new ArrayList<>();
        for (int t = 0; t < all; t++) {
            byTransition.add(new TreeMap<>());
        }
        for (Arc arc : net.arcs()) {
            byTransition.get(arc.transition()).computeIfAbsent(arc.place(), key -> new int[ArcKind.values().length])[arc.kind().ordinal()]
                = arc.weight();
        }
        for (int t = 0; t < all; t++) {
            for (Map.Entry<Integer, int[]> entry : byTransition.get(t).entrySet()) {
                Place place = net.place(entry.getKey());
                String between = "place " + place.name() + ", transition " + net.transition(t).name();
                int[] weights = entry.getValue();
                capacity(place, weights, has, mistakes, between, tool);
                if (has != Has.INHIBITORS_AND_TESTS || weights[ArcKind.INPUT.ordinal()] > 0) {
                    loop(weights, mistakes, between);
                }
                int inhibitor = weights[ArcKind.INHIBITOR.ordinal()];
                if (inhibitor > 0 && (has == Has.INPUTS_AND_OUTPUTS || has == Has.INHIBITORS_OF_1 && inhibitor > 1)) {
                    mistakes.add(between + ": an inhibitor arc of weight " + inhibitor + "; " + tool
                        + (inhibitor > 1 && has == Has.INHIBITORS_OF_1 ? " has only those of weight 1" : " has none"));
                }
                for (ArcKind kind : ArcKind.values()) {
                    if (weights[kind.ordinal()] > 0) {
                        arcs.add(new Arc(kind, place.index(), t, weights[kind.ordinal()]));
                    }
                }
            }
        }
        if (!mistakes.isEmpty()) {
            throw new NetException("net " + net.name(), 0, "", String.join("\n", mistakes));
        }
        return arcs;
    }

    /** Takes the tested tokens and puts them back. */
    private static void loop(int[] weights, List<String> mistakes, String between) {
        int more = weights[ArcKind.TEST.ordinal()] - weights[ArcKind.INPUT.ordinal()];
        weights[ArcKind.TEST.ordinal()] = 0;
        if (more > 0) {
            weights[ArcKind.INPUT.ordinal()] += more;
            long puts = (long) weights[ArcKind.OUTPUT.ordinal()] + more;
            if (puts > Integer.MAX_VALUE) {
                mistakes.add(between + ": as a loop, the test arc would weigh " + puts + "; expected at most " + Integer.MAX_VALUE);
            }
            weights[ArcKind.OUTPUT.ordinal()] = (int) puts;
        }
    }

    private static void capacity(Place place, int[] weights, Has has, List<String> mistakes, String between, String tool) {
        int gain = weights[ArcKind.OUTPUT.ordinal()] - weights[ArcKind.INPUT.ordinal()];
        if (!place.isLimited() || gain <= 0 || has == Has.INHIBITORS_AND_CAPACITIES) {
            return;
        }
        long free = (long) place.capacity() - gain + 1;
        int inhibitor = weights[ArcKind.INHIBITOR.ordinal()];
        if (free < 1) {
            mistakes.add(between + ": the transition can never fire, as it puts " + gain + " tokens into a capacity of "
                + place.capacity() + "; leave it out");
        } else if (has == Has.INPUTS_AND_OUTPUTS) {
            mistakes.add(between + ": a capacity of " + place.capacity() + "; " + tool + " has none");
        } else {
            weights[ArcKind.INHIBITOR.ordinal()] = inhibitor == 0 ? (int) free : (int) Math.min(inhibitor, free);
        }
    }

    /** The names, with a number behind those that a tool would not accept. */
    static List<String> names(List<String> names, Predicate<String> accepted) {
        Set<String> used = new HashSet<>();
        names.stream().filter(accepted).forEach(used::add);
        List<String> result = new ArrayList<>();
        for (int i = 0; i < names.size(); i++) {
            String name = names.get(i);
            if (!accepted.test(name)) {
                String plain = "_" + name.replaceAll("[^A-Za-z0-9]", "_");
                name = plain + "_" + i;
                for (int more = 2; !used.add(name); more++) {
                    name = plain + "_" + i + "_" + more;
                }
            }
            result.add(name);
        }
        return result;
    }
}
