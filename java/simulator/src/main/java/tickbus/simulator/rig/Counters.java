package tickbus.simulator.rig;

/**
 * What the rig has counted since power-up.
 *
 * <p>Every bottle is accounted for: {@code fed = delivered + removed + fallen + those in the rig}.
 *
 * @param cycles times that step 6 was completed
 * @param fed bottles that the infeed gave
 * @param treated bottles that had been at the lamp and came back to a pocket
 * @param delivered treated bottles that left at the outfeed
 * @param removed bottles that the operator's hand took away
 * @param fallen bottles that fell into the catch tray
 * @param jams bottles that stuck in a lift's path
 * @param collisions faults in which parts or bottles met
 * @param faults times that Not OK rose
 * @param retriggers index commands ignored because the wheel was moving
 * @param lampErrors times that the lamp differed from the commanded motion of lift 2 within a step
 */
public record Counters(
        long cycles,
        long fed,
        long treated,
        long delivered,
        long removed,
        long fallen,
        long jams,
        long collisions,
        long faults,
        long retriggers,
        long lampErrors) {}
