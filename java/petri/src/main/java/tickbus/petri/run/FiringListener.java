package tickbus.petri.run;

/** Called for each firing, in order. */
@FunctionalInterface
public interface FiringListener {
    /**
     * A transition has fired.
     *
     * @param scan the number of the scan, from 1
     * @param nanos the time of the scan
     * @param transition the transition's index
     * @param choices the number of conflicting transitions that it was chosen from; 1 if there was no choice
     */
    void fired(long scan, long nanos, int transition, int choices);
}
