package tickbus.petri.run;

import tickbus.petri.net.Marking;

/**
 * Why a controller stopped. Its outputs have their fail-safe values.
 *
 * @param cause the kind of trouble
 * @param element the location: {@code condition of transition T1}, {@code entry action of place P3}
 * @param message what happened, for people
 * @param thrown the exception; null in a livelock
 * @param scan the number of the scan, from 1
 * @param marking the marking at that moment
 */
public record Stop(Cause cause, String element, String message, Throwable thrown, long scan, Marking marking) {
    /** Kinds of trouble. */
    public enum Cause {
        /** A condition, an action, the reader of the inputs or the writer of the outputs threw. */
        THROWN,
        /** The net did not come to rest within one scan. */
        LIVELOCK
    }
}
