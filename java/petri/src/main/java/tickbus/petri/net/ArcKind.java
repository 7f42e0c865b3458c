package tickbus.petri.net;

/** The meaning of an arc between a place and a transition. */
public enum ArcKind {
    /** Place to transition: the transition needs at least as many tokens as the weight, and takes them. */
    INPUT,
    /** Transition to place: firing puts as many tokens as the weight. */
    OUTPUT,
    /** Place to transition: the transition needs at least as many tokens as the weight, and leaves them. */
    TEST,
    /** Place to transition: the transition needs fewer tokens than the weight. */
    INHIBITOR
}
