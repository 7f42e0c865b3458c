package tickbus.petri;

import java.util.List;

/** A condition of several parts that must all hold, and which can tell the part that does not. Views show the parts. */
public interface Conjunction extends Condition {
    /**
     * One part.
     *
     * @param text what must hold, such as {@code 'Guard' is on}
     * @param input the input that it looks at; null if it looks at none, or if nobody knows
     * @param net the net of the place that it looks at; null if it looks at none
     * @param place that place; null if it looks at none
     */
    record Part(String text, String input, String net, String place) {
    }

    /** Its parts, in the order in which they are tested. */
    List<Part> parts();

    /** The first part that did not hold when it was last tested; -1 if all did, or if it has not been tested. */
    int failed();
}
