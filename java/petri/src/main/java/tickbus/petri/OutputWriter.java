package tickbus.petri;

/** Writes all outputs at the end of a scan, and their fail-safe values when the controller stops. */
@FunctionalInterface
public interface OutputWriter {
    /** The values in the order in which the outputs were named; they are not to be kept or changed. */
    void write(double[] values);
}
