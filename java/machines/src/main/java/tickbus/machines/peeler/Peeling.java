package tickbus.machines.peeler;

import java.util.List;

/**
 * A block between the lathe's spindles, and the veneer that the knife cuts off as it turns.
 *
 * <p>The block consists of slices along its length and sectors around it: as a sector passes the knife, all wood beyond the
 * knife's edge is cut off. The veneer is a continuous ribbon only after the knife has been in the wood over the full length
 * for a full turn; before that it is torn, or comes in short pieces.
 */
final class Peeling {
    /** Slices along the block. */
    static final int SLICES = 9;

    private static final double SLICE = Block.LENGTH / SLICES;
    private static final double SECTOR = 2 * Math.PI / Profile.SECTORS;

    /** A cut of less than this fraction of the thickness leaves a hole in the ribbon. */
    private static final double HOLE = 0.5;

    private final Block block;
    private final Wood wood;
    private final double[][] radius = new double[SLICES][];
    /** Sectors that have passed the knife. */
    private double turned;
    /** Consecutive sectors in which the knife was in the wood over the full length. */
    private int contact;
    private double thickest;
    private double load;

    Peeling(Block block, Wood wood) {
        this.block = block;
        this.wood = wood;
        List<Profile> slices = block.slices(SLICES);
        for (int i = 0; i < SLICES; i++) {
            radius[i] = slices.get(i).radii();
        }
        wood.chuck(volume());
    }

    Block block() {
        return block;
    }

    /** The remaining volume in cubic millimetres. */
    double volume() {
        double sum = 0;
        for (double[] slice : radius) {
            for (double r : slice) {
                sum += r * r / 2 * SECTOR * SLICE;
            }
        }
        return sum;
    }

    /** The largest remaining radius. */
    double reach() {
        double most = 0;
        for (double[] slice : radius) {
            for (double r : slice) {
                most = Math.max(most, r);
            }
        }
        return most;
    }

    /** The radius in front of the knife, in the middle of the block. */
    double surface() {
        return radius[SLICES / 2][sector((long) turned)];
    }

    /** The radius in the middle of the block, this many sectors behind the one in front of the knife. */
    double radius(int sectors) {
        return radius[SLICES / 2][sector((long) turned + sectors)];
    }

    /** The largest radius in front of the knife, over the length of the block. */
    double front() {
        double most = 0;
        for (double[] slice : radius) {
            most = Math.max(most, slice[sector((long) turned)]);
        }
        return most;
    }

    /** True if the veneer is a continuous ribbon. */
    boolean round() {
        return contact >= Profile.SECTORS;
    }

    /** The thickest piece in the last {@link #turn}, in millimetres. */
    double thickest() {
        return thickest;
    }

    /** The largest cross-section of wood cut at once in the last {@link #turn}, in square millimetres. */
    double load() {
        return load;
    }

    /**
     * Turns the block.
     *
     * @param revolutions the angle, towards the knife; in the other direction nothing is cut
     * @param before the knife's distance from the axis at the beginning, in millimetres
     * @param after the distance at the end
     * @param thickness the nominal thickness of the veneer
     * @param belt true if the veneer falls onto the veneer belt, false if into the chipper
     */
    void turn(double revolutions, double before, double after, double thickness, boolean belt) {
        thickest = 0;
        load = 0;
        double sectors = revolutions * Profile.SECTORS;
        if (sectors > 0) {
            long last = (long) (turned + sectors);
            for (long i = (long) turned + 1; i <= last; i++) {
                cut(sector(i), before + (after - before) * (i - turned) / sectors, thickness, belt);
            }
        }
        turned += sectors;
    }

    private static int sector(long count) {
        return (int) Math.floorMod(count, (long) Profile.SECTORS);
    }

    private void cut(int sector, double knife, double thickness, boolean belt) {
        double volume = 0;
        double across = 0;
        boolean whole = true;
        for (double[] slice : radius) {
            double r = slice[sector];
            double depth = r - knife;
            whole &= depth >= HOLE * thickness;
            if (depth > 0) {
                volume += (r * r - knife * knife) / 2 * SECTOR * SLICE;
                across += depth * SLICE;
                thickest = Math.max(thickest, depth);
                slice[sector] = knife;
            }
        }
        load = Math.max(load, across);
        contact = whole ? Math.min(contact + 1, Profile.SECTORS) : 0;
        if (!belt) {
            wood.chip(volume);
        } else if (round()) {
            // The length of a ribbon is that of its middle, between its two faces.
            wood.veneer(volume, volume / across);
        } else {
            wood.torn(volume);
        }
    }
}
