package tickbus.petri.run;

import java.util.List;
import tickbus.petri.net.PetriNet;

/** A running net, as views see it. */
public interface RunningNet {
    /** The net. */
    PetriNet net();

    /** The names of the inputs, in the order of {@link NetState#input}. */
    List<String> inputNames();

    /** The names of the outputs, in the order of {@link NetState#output}. */
    List<String> outputNames();

    /** The condition of the transition with this index; null if it has no condition. */
    Condition condition(int transition);

    /** Fills in the current state. Only for the thread that runs the net; allocates nothing. */
    void copyTo(NetState state);
}
