package tickbus.sdsp;

/**
 * A run that came to its end, or was stopped between two steps.
 *
 * @param steps the number of steps; all clients have finished all of them
 * @param nanos the virtual time of the last step in nanoseconds; one step below 0 if no step was done
 * @param hash the trace hash: equal for runs that are equal to the last bit
 */
public record Outcome(long steps, long nanos, long hash) {
    /**
     * The trace hash as {@code tickbus sync} prints it.
     *
     * @return 16 hexadecimal digits
     */
    public String hashText() {
        return String.format("%016x", hash);
    }
}
