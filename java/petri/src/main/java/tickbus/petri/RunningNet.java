package tickbus.petri;

import java.util.List;

/** A net that runs, as views see it. */
public interface RunningNet {
    /** The net. */
    PetriNet net();

    /** The names of its inputs, in the order of {@link NetState#input}. */
    List<String> inputNames();

    /** The names of its outputs, in the order of {@link NetState#output}. */
    List<String> outputNames();

    /** The condition of the transition with this index; null if there is none. */
    Condition condition(int transition);

    /** Fills in the state of this moment. Only for the thread that runs the net; allocates nothing. */
    void copyTo(NetState state);
}
