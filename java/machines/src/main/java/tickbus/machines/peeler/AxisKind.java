package tickbus.machines.peeler;

/** The commands that an axis accepts. */
public enum AxisKind {
    /** To a position; by joystick. */
    POSITION,
    /** Turns at a speed. */
    SPEED,
    /** To a position, by joystick, or following other axes. */
    TRACKING,
    /** Opens and closes with a pressure, from end to end. */
    TORQUE
}
