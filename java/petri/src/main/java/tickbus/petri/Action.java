package tickbus.petri;

/** What a place or a transition does to the outputs. */
@FunctionalInterface
public interface Action {
    /** Runs within the scan; what it sets is written at the end of it. */
    void run(Inputs inputs, Outputs outputs);
}
