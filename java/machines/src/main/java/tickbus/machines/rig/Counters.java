package tickbus.machines.rig;

/**
 * The rig's counters since power-up.
 *
 * <p>Every bottle is accounted for: {@code fed = delivered + removed + fallen + those in the rig}.
 *
 * @param cycles how often step 6 was completed
 * @param fed bottles delivered by the infeed
 * @param treated bottles that had been at the lamp and came back to a pocket
 * @param delivered treated bottles that left at the outfeed
 * @param removed bottles removed by the operator
 * @param fallen bottles that fell into the catch tray
 * @param jams bottles that stuck in a lift's path
 * @param collisions faults in which parts or bottles met
 * @param faults how often Not OK rose
 * @param retriggers index commands ignored because the wheel was moving
 * @param lampErrors how often the lamp differed from the commanded motion of lift 2 within a step
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
