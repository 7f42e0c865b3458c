package tickbus.petri.run;

/** Reads all inputs at the start of a scan. */
@FunctionalInterface
public interface InputReader {
    /** Fills in the values, in the order in which the inputs were named. */
    void read(double[] values);
}
