package tickbus.petri.net;

/**
 * A transition of a net.
 *
 * @param index its column in the matrices, from 0
 * @param name unique among the transitions of the net
 * @param priority the greatest fires first; 0 unless given
 * @param delay how long it must be enabled without interruption before it may fire
 */
public record Transition(int index, String name, int priority, Delay delay) {
}
