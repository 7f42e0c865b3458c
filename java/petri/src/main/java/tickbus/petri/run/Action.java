package tickbus.petri.run;

/** The effect of a place or a transition on the outputs. */
@FunctionalInterface
public interface Action {
    /** Runs within the scan; the values that it sets are written at the end of the scan. */
    void run(Inputs inputs, Outputs outputs);
}
