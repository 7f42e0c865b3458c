package tickbus.petri.sfc;

import java.util.ArrayList;
import java.util.List;
import java.util.stream.IntStream;
import java.util.stream.Stream;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.PetriNet;

/** The neighbours of each step and transition of a chart, for writing. */
final class ChartShape {
    private final List<List<Integer>> before;
    private final List<List<Integer>> behind;
    private final List<List<Integer>> after;
    private final List<List<Association>> associations;
    private final int[] priorities;

    ChartShape(Sfc chart) {
        PetriNet net = chart.net();
        before = lists(net.transitions().size());
        behind = lists(net.transitions().size());
        after = lists(net.places().size());
        associations = lists(net.places().size());
        for (Arc arc : net.arcs()) {
            (arc.kind() == ArcKind.INPUT ? before : behind).get(arc.transition()).add(arc.place());
            if (arc.kind() == ArcKind.INPUT) {
                after.get(arc.place()).add(arc.transition());
            }
        }
        chart.associations.forEach(one -> associations.get(one.step()).add(one));
        after.forEach(all -> all.sort((a, b) -> Integer.compare(net.transition(b).priority(), net.transition(a).priority())));
        List<Integer> shared = IntStream.range(0, before.size()).boxed()
            .filter(t -> before.get(t).stream().anyMatch(step -> after.get(step).size() > 1))
            .sorted((a, b) -> Integer.compare(net.transition(b).priority(), net.transition(a).priority())).toList();
        priorities = new int[before.size()];
        for (int i = 0; i < shared.size(); i++) {
            priorities[shared.get(i)] = i + 1;
        }
    }

    private static <T> List<List<T>> lists(int count) {
        return Stream.generate(() -> (List<T>) new ArrayList<T>(1)).limit(count).toList();
    }

    /** The steps before a transition. */
    List<Integer> before(int transition) {
        return before.get(transition);
    }

    /** The steps behind a transition. */
    List<Integer> behind(int transition) {
        return behind.get(transition);
    }

    /** The transitions behind a step; the one that goes first is the first. */
    List<Integer> after(int step) {
        return after.get(step);
    }

    List<Association> associations(int step) {
        return associations.get(step);
    }

    /** The priority of a transition that shares a step with another one, from 1, which goes first; 0 for the others. */
    int priority(int transition) {
        return priorities[transition];
    }
}
