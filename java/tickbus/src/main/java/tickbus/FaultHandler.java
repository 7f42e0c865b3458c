package tickbus;

/** Receives the faults of the simulation's model; see {@link Tickbus#pollFaults}. */
@FunctionalInterface
public interface FaultHandler {
    /**
     * A fault of the model begins, changes its value, or ends.
     *
     * @param name one of the names that were passed to {@link Tickbus#declareFaults}
     * @param value the fault's value; 0 when it has ended
     */
    void fault(String name, double value);
}
