package tickbus;

/** Receives the writes of a PLC one by one, on buses where each one matters; see {@link Tickbus#pollEvents}. */
@FunctionalInterface
public interface EventHandler {
    /**
     * One write of the PLC.
     *
     * @param signal the signal that was written
     * @param value the value, in the signal's unit; 64-bit integers are rounded to a double
     * @param timeNanos when it arrived, in nanoseconds on the driver's clock; only differences are meaningful
     */
    void event(Signal signal, double value, long timeNanos);
}
