package tickbus.machines.peeler;

import java.util.Arrays;

/**
 * A cross-section of a block: its radius in millimetres around an axis, by angle.
 *
 * <p>Angles count from the horizontal, anticlockwise as seen from the right end, in {@link #SECTORS} steps. Every
 * point of the surface is visible from the axis.
 */
final class Profile {
    /** Sectors in a turn. */
    static final int SECTORS = 720;

    private static final double TURN = 2 * Math.PI;
    private static final double SECTOR = TURN / SECTORS;

    private final double[] radius;

    private Profile(double[] radius) {
        this.radius = radius;
    }

    static Profile circle(double radius) {
        double[] all = new double[SECTORS];
        Arrays.fill(all, radius);
        return new Profile(all);
    }

    /** An ellipse with its half axes, the first one horizontal. */
    static Profile ellipse(double a, double b) {
        double[] all = new double[SECTORS];
        for (int i = 0; i < SECTORS; i++) {
            all[i] = a * b / Math.hypot(b * Math.cos(i * SECTOR), a * Math.sin(i * SECTOR));
        }
        return new Profile(all);
    }

    /** This profile with a bump, or with a dent if its height is below 0; angle and width in degrees. */
    Profile bump(double angle, double width, double height) {
        double[] all = radius.clone();
        for (int i = 0; i < SECTORS; i++) {
            double off = Math.IEEEremainder(i * 360.0 / SECTORS - angle, 360) / width;
            all[i] += height * Math.exp(-off * off);
        }
        return new Profile(all);
    }

    /** A profile interpolated between two others: the first one at part 0, the second at part 1. */
    static Profile between(Profile first, Profile second, double part) {
        double[] all = new double[SECTORS];
        for (int i = 0; i < SECTORS; i++) {
            all[i] = first.radius[i] + part * (second.radius[i] - first.radius[i]);
        }
        return new Profile(all);
    }

    /** This profile scaled by a factor. */
    Profile scale(double by) {
        return new Profile(Arrays.stream(radius).map(r -> r * by).toArray());
    }

    double radius(int sector) {
        return radius[sector];
    }

    double[] radii() {
        return radius.clone();
    }

    /** The area in square millimetres. */
    double area() {
        return Arrays.stream(radius).map(r -> r * r / 2 * SECTOR).sum();
    }

    /**
     * The extent of the profile in a direction, in degrees: where a straight edge perpendicular to that direction would
     * touch.
     */
    double reach(double direction) {
        double towards = Math.toRadians(direction);
        double farthest = 0;
        for (int i = 0; i < SECTORS; i++) {
            farthest = Math.max(farthest, radius[i] * Math.cos(i * SECTOR - towards));
        }
        return farthest;
    }

    /**
     * The same cross-section around another axis, which must be inside it.
     *
     * @param x of the new axis relative to the current one, in millimetres
     * @param y of the new axis, upwards
     */
    Profile around(double x, double y) {
        double[] angle = new double[SECTORS + 1];
        double[] distance = new double[SECTORS + 1];
        for (int i = 0; i <= SECTORS; i++) {
            int sector = i % SECTORS;
            double px = radius[sector] * Math.cos(sector * SECTOR) - x;
            double py = radius[sector] * Math.sin(sector * SECTOR) - y;
            distance[i] = Math.hypot(px, py);
            angle[i] = Math.atan2(py, px);
            if (i > 0) {
                angle[i] += TURN * Math.rint((angle[i - 1] - angle[i]) / TURN);
            }
        }
        double[] all = new double[SECTORS];
        for (int i = 0; i < SECTORS; i++) {
            all[i] = onEdge(angle, distance, i * SECTOR);
        }
        return new Profile(all);
    }

    /** The intersection of a ray with the polygon through points given by ascending angles and distances. */
    private static double onEdge(double[] angle, double[] distance, double ray) {
        double at = ray + TURN * Math.ceil((angle[0] - ray) / TURN);
        int found = Arrays.binarySearch(angle, at);
        int next = Math.max(1, Math.min(SECTORS, found >= 0 ? found : -found - 1));
        double before = at - angle[next - 1];
        double behind = angle[next] - at;
        double across = distance[next - 1] * Math.sin(before) + distance[next] * Math.sin(behind);
        return across == 0 ? distance[next]
                : distance[next - 1] * distance[next] * Math.sin(before + behind) / across;
    }
}
