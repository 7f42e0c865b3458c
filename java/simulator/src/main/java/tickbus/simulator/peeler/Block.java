package tickbus.simulator.peeler;

import java.util.List;
import java.util.stream.IntStream;

/**
 * A block of wood, as a log is called once it is cut to the length of the lathe: a profile at each end, and straight
 * lines between them.
 */
final class Block {
    /** Length in millimetres; its middle is the line's middle. */
    static final double LENGTH = 1300;

    static final double HALF = LENGTH / 2;

    private static final double ROOT = Math.sqrt(2);
    private static final double DOWN_RIGHT = -45;
    private static final double DOWN_LEFT = -135;
    private static final double UP = 90;

    private final int number;
    private final String shape;
    private final Profile left;
    private final Profile right;
    /** Where the spindles hold it, as seen from its own axis at each end; all 0 before it was ever held. */
    private double leftX;
    private double leftY;
    private double rightX;
    private double rightY;

    Block(int number, String shape, Profile left, Profile right) {
        this.number = number;
        this.shape = shape;
        this.left = left;
        this.right = right;
    }

    /** Counts from 1. */
    int number() {
        return number;
    }

    /** What it looks like, for people. */
    String shape() {
        return shape;
    }

    Profile end(boolean ofLeft) {
        return ofLeft ? left : right;
    }

    /** Height of an end's axis when the block lies in a V of 90 degrees, above the bottom of that. */
    double lyingHeight(boolean ofLeft) {
        return (end(ofLeft).reach(DOWN_RIGHT) + end(ofLeft).reach(DOWN_LEFT)) / ROOT;
    }

    /** How far an end's axis then lies to the right of the middle of the V. */
    double lyingAside(boolean ofLeft) {
        return (end(ofLeft).reach(DOWN_LEFT) - end(ofLeft).reach(DOWN_RIGHT)) / ROOT;
    }

    /** Height of an end's highest point when the block lies in the V. */
    double lyingTop(boolean ofLeft) {
        return lyingHeight(ofLeft) + end(ofLeft).reach(UP);
    }

    /** The tips hold it here, as seen from each end's axis, in millimetres to the right and upwards. */
    void holdAt(boolean ofLeft, double x, double y) {
        if (ofLeft) {
            leftX = x;
            leftY = y;
        } else {
            rightX = x;
            rightY = y;
        }
    }

    /** Who holds it now holds it off from where it was held before. */
    void shift(boolean ofLeft, double x, double y) {
        holdAt(ofLeft, (ofLeft ? leftX : rightX) + x, (ofLeft ? leftY : rightY) + y);
    }

    /** How far off its axis an end is held, in millimetres. */
    double eccentricity(boolean ofLeft) {
        return ofLeft ? Math.hypot(leftX, leftY) : Math.hypot(rightX, rightY);
    }

    /** Whether a tip at this place, as seen from an end's axis, meets wood. */
    boolean isHitAt(boolean ofLeft, double x, double y) {
        double half = Math.hypot(x, y);
        int sector = (int) Math.floorMod(Math.round(Math.toDegrees(Math.atan2(y, x)) * Profile.SECTORS / 360),
                (long) Profile.SECTORS);
        return half < end(ofLeft).radius(sector) / 2;
    }

    /** Its slices from left to right, around the line between the tips. */
    List<Profile> slices(int count) {
        return IntStream.range(0, count).mapToObj(i -> {
            double part = (i + 0.5) / count;
            return Profile.between(left, right, part)
                    .around(leftX + part * (rightX - leftX), leftY + part * (rightY - leftY));
        }).toList();
    }

    /** Cubic millimetres, in so many slices, around its own axis. */
    double volume(int count) {
        double sum = 0;
        for (int i = 0; i < count; i++) {
            sum += Profile.between(left, right, (i + 0.5) / count).area() * LENGTH / count;
        }
        return sum;
    }
}
