package tickbus.petri.run;

/** Writes all outputs at the end of a scan, and their fail-safe values when the controller stops. */
@FunctionalInterface
public interface OutputWriter {
    /** Writes the values, in the order in which the outputs were named. The array must not be kept or changed. */
    void write(double[] values);
}
