package tickbus.machines.peeler;

/** The values of an axis's error word, from 0 on; docs/axis-link.md documents them for the PLC's programmer. */
enum AxisError {
    /** No error. */
    NONE,
    /** The target is beyond an end position: the axis stopped there. */
    BEYOND_END,
    /** Speed, acceleration or deceleration is not above 0: the command was not carried out. */
    NO_SPEED,
    /** This kind of axis has no such command. */
    NO_SUCH_COMMAND,
    /** The axis has failed. */
    FAILED,
    /** The block slipped in the spindles, which hold it too loosely for the cut. */
    SPIN_OUT,
    /** The knife ran into a block that stood still. */
    KNIFE_HIT,
    /** Execute rose while Enable was off: the command was not carried out. */
    NOT_ENABLED
}
