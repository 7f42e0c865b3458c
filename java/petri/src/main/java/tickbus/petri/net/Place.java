package tickbus.petri.net;

/**
 * A place of a net.
 *
 * @param index its row in the matrices, from 0
 * @param name unique among the places of the net
 * @param initial its tokens in the initial marking, 0 or more
 * @param capacity the most tokens that it may hold, 1 or more; {@link #UNLIMITED} if there is no limit
 * @param delay nanoseconds for which a token that arrives is unavailable to input and test arcs; 0 in an untimed place
 */
public record Place(int index, String name, int initial, int capacity, long delay) {
    /** The capacity of a place without a limit. */
    public static final int UNLIMITED = Integer.MAX_VALUE;

    /** True if the place has a capacity. */
    public boolean isLimited() {
        return capacity != UNLIMITED;
    }
}
