package tickbus.machines.peeler;

import java.util.List;
import java.util.stream.IntStream;

/**
 * A block of wood, which is a log cut to the length of the lathe: a profile at each end, and straight lines between
 * them.
 */
final class Block {
    /** Length in millimetres; its middle is the middle of the line. */
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
    /** Where the spindles hold the block, relative to its own axis at each end; all 0 before it was ever held. */
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

    /** The block's number, from 1. */
    int number() {
        return number;
    }

    /** The block's shape, for people. */
    String shape() {
        return shape;
    }

    Profile end(boolean ofLeft) {
        return ofLeft ? left : right;
    }

    /** Height of an end's axis above the bottom of a V-block of 90 degrees. */
    double lyingHeight(boolean ofLeft) {
        return (end(ofLeft).reach(DOWN_RIGHT) + end(ofLeft).reach(DOWN_LEFT)) / ROOT;
    }

    /** How far an end's axis is then to the right of the middle of the V. */
    double lyingAside(boolean ofLeft) {
        return (end(ofLeft).reach(DOWN_LEFT) - end(ofLeft).reach(DOWN_RIGHT)) / ROOT;
    }

    /** Height of an end's highest point when the block lies in the V. */
    double lyingTop(boolean ofLeft) {
        return lyingHeight(ofLeft) + end(ofLeft).reach(UP);
    }

    /** Sets where the tips hold the block, relative to each end's axis, in millimetres to the right and upwards. */
    void holdAt(boolean ofLeft, double x, double y) {
        if (ofLeft) {
            leftX = x;
            leftY = y;
        } else {
            rightX = x;
            rightY = y;
        }
    }

    /** Shifts the place where the tips hold the block. */
    void shift(boolean ofLeft, double x, double y) {
        holdAt(ofLeft, (ofLeft ? leftX : rightX) + x, (ofLeft ? leftY : rightY) + y);
    }

    /** The distance between an end's axis and the point where it is held, in millimetres. */
    double eccentricity(boolean ofLeft) {
        return ofLeft ? Math.hypot(leftX, leftY) : Math.hypot(rightX, rightY);
    }

    /** True if a tip at this place, relative to an end's axis, meets wood. */
    boolean isHitAt(boolean ofLeft, double x, double y) {
        double half = Math.hypot(x, y);
        int sector = (int) Math.floorMod(Math.round(Math.toDegrees(Math.atan2(y, x)) * Profile.SECTORS / 360),
                (long) Profile.SECTORS);
        return half < end(ofLeft).radius(sector) / 2;
    }

    /** The block's slices from left to right, around the line between the tips. */
    List<Profile> slices(int count) {
        return IntStream.range(0, count).mapToObj(i -> {
            double part = (i + 0.5) / count;
            return Profile.between(left, right, part)
                    .around(leftX + part * (rightX - leftX), leftY + part * (rightY - leftY));
        }).toList();
    }

    /** The volume in cubic millimetres, computed with this many slices around the block's own axis. */
    double volume(int count) {
        double sum = 0;
        for (int i = 0; i < count; i++) {
            sum += Profile.between(left, right, (i + 0.5) / count).area() * LENGTH / count;
        }
        return sum;
    }
}
