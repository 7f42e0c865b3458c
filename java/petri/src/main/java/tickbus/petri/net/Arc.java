package tickbus.petri.net;

/**
 * One arc of a net.
 *
 * @param kind its effect
 * @param place the index of its place
 * @param transition the index of its transition
 * @param weight 1 or more
 */
public record Arc(ArcKind kind, int place, int transition, int weight) {
}
