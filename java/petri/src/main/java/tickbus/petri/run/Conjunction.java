package tickbus.petri.run;

import java.util.List;

/** A condition of several parts that must all hold, and that knows which part does not. Views show the parts. */
public interface Conjunction extends Condition {
    /**
     * One part.
     *
     * @param text what must hold, such as {@code 'Guard' is on}
     * @param input the input that the part tests; null if it tests none, or if this is not known
     * @param net the net of the place that the part tests; null if it tests none
     * @param place that place; null if it looks at none
     */
    record Part(String text, String input, String net, String place) {
    }

    /** The parts of the condition, in the order in which they are tested. */
    List<Part> parts();

    /** The first part that did not hold at the last test; -1 if all did, or before the first test. */
    int failed();
}
