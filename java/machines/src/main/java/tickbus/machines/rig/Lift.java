package tickbus.machines.rig;

/** One of the rig's two lifts. */
public enum Lift {
    /** Lift 1: between index wheel 1 and the chamber wheel. */
    LA1,
    /** Lift 2: between the chamber wheel and the lamp. */
    LA2
}
