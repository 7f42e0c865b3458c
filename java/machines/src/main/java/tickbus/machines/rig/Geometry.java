package tickbus.machines.rig;

/**
 * The rig's lengths, angles and ramps.
 *
 * <p>Heights are in millimetres above the floor of index wheel 1's pockets. Angles are in degrees, growing in the
 * direction of turning.
 *
 * <p>Index wheel 1 passes four stations: infeed at 0, lift 1 at 90, outfeed at 180, a free one at 270; its pockets are 90
 * apart. The chamber wheel's two sleeves are 180 apart: at 0 a sleeve is over lift 1, at 180 over lift 2.
 */
public final class Geometry {
    /** Height of a bottle. */
    public static final double BOTTLE_HEIGHT = 60.0;

    /** Base of a bottle in a pocket. */
    public static final double POCKET_FLOOR = 0.0;

    /** The big move of either lift. */
    public static final double BIG = 180.0;

    /** The small move of lift 1, which brings its cup clear of the chamber wheel. */
    public static final double SMALL = 20.0;

    /** Base of a bottle in a sleeve: lift 1 after a big move, lift 2 at its bottom. */
    public static final double SLEEVE_FLOOR = POCKET_FLOOR + BIG;

    /** Base of a bottle at the lamp: lift 2 after a big move. */
    public static final double LAMP_FLOOR = SLEEVE_FLOOR + BIG;

    /** Upper end stop of either lift, above its bottom. */
    public static final double STROKE = 190.0;

    /** Beam of package sensor 1, across the path of lift 1 at mid-height. */
    public static final double BEAM1 = 120.0;

    /** Beam of package sensor 2, across the path of lift 2 at mid-height. */
    public static final double BEAM2 = 300.0;

    /** Station of the infeed on index wheel 1. */
    public static final double INFEED = 0.0;

    /** Station of lift 1 on index wheel 1. */
    public static final double LIFT_STATION = 90.0;

    /** Station of the outfeed on index wheel 1. */
    public static final double OUTFEED = 180.0;

    /** Station of the chamber wheel over lift 1. */
    public static final double OVER_LIFT1 = 0.0;

    /** Station of the chamber wheel over lift 2. */
    public static final double OVER_LIFT2 = 180.0;

    /** Half the window of a homing sensor around an index position: a jogging wheel has time to stop inside it. */
    public static final double HOMING_WINDOW = 10.0;

    /** Half the range of a bottom switch, in millimetres. */
    public static final double BOTTOM_WINDOW = 0.5;

    /**
     * How close a cup must be to a bottle to grip it, and a bottle to a pocket or sleeve to be held, in millimetres.
     */
    static final double REACH = 1.0;

    /** How far a wheel may be off an index position for a lift to pass through it, in degrees. */
    static final double ALIGNED = 2.0;

    /** Underside of the chamber wheel: anything higher at lift 1 obstructs the wheel. */
    static final double CHAMBER_UNDERSIDE = SLEEVE_FLOOR - 5.0;

    private Geometry() {}
}
