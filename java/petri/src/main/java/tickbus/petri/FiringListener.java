package tickbus.petri;

/** Hears of each firing, in order. */
@FunctionalInterface
public interface FiringListener {
    /**
     * A transition has fired.
     *
     * @param scan the number of the scan, from 1
     * @param nanos the time of the scan
     * @param transition its index
     * @param choices among how many conflicting transitions it was chosen; 1 if there was no choice
     */
    void fired(long scan, long nanos, int transition, int choices);
}
