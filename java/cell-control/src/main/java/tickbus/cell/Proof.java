package tickbus.cell;

import tickbus.petri.analysis.Reachability;
import tickbus.petri.analysis.Verdict;
import tickbus.petri.net.Marking;
import tickbus.petri.net.PetriNet;

/**
 * Properties of all nets together, whatever the signals do.
 *
 * @param markings the number of reachable markings that were found
 * @param complete true if these are all
 * @param safe true if no place ever has two tokens
 * @param deadlocks markings in which nothing can happen unless somebody turns the switch
 */
public record Proof(int markings, boolean complete, boolean safe, int deadlocks) {
    private static final int LIMIT = 2_000_000;

    static Proof of(PetriNet composition) {
        Reachability graph = Reachability.explore(composition, LIMIT);
        int start = composition.transition("cell.start").index();
        int stop = composition.transition("cell.stop").index();
        int deadlocks = 0;
        for (int i = 0; i < graph.size(); i++) {
            if (isStuck(composition, graph.marking(i), start, stop)) {
                deadlocks++;
            }
        }
        return new Proof(graph.size(), graph.isComplete(), graph.isSafe() == Verdict.YES, deadlocks);
    }

    private static boolean isStuck(PetriNet net, Marking marking, int start, int stop) {
        for (int t = 0; t < net.transitions().size(); t++) {
            if (t != start && t != stop && net.isEnabled(marking, t)) {
                return false;
            }
        }
        return true;
    }
}
