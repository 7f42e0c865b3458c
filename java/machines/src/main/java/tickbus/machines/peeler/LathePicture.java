package tickbus.machines.peeler;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Locale;
import tickbus.simulator.text.Svg;

/**
 * Draws the current state of the lathe as a self-contained SVG, seen from its right end: the cross-section of the
 * block at its middle, the knife and the veneer, the rolls, and a caption.
 *
 * <p>Values that signals carry are bound to them, so that the same picture moves on the live page: {@code
 * java/machines/lathe.svg} is the picture before the first block. There the block is round, since no signal carries its
 * shape.
 */
public final class LathePicture {
    private static final int WIDTH = 960;
    private static final int HEIGHT = 620;
    private static final int BAR = 66;
    private static final double X = 450;
    private static final double Y = 275;
    /** Pixels per millimetre. */
    private static final double SCALE = 1.25;
    private static final double ROLL = 60;
    /** The radius of the block on the live page, before it is cut, in millimetres. */
    private static final double UNCUT = 170;
    private static final double SECTOR = 2 * Math.PI / Profile.SECTORS;
    private static final String INK = "fill=\"#22313f\"";
    private static final String STEEL = "fill=\"#a9b7c2\" stroke=\"#5d6e7b\" stroke-width=\"1.5\"";
    private static final String WOOD = "fill=\"#e8c48f\" stroke=\"#8a5a24\" stroke-width=\"2.5\"";

    private static final String RING = "fill=\"none\" stroke=\"#cf9f60\" stroke-width=\"1\"";
    private static final String SPOKE = "stroke=\"#93a3b0\" stroke-width=\"2\"";
    private static final String VENEER = "fill=\"none\" stroke=\"#c98f4a\"";

    private LathePicture() {
    }

    /**
     * Draws the lathe of a line.
     *
     * @param line the line, between two steps
     * @return an SVG document
     */
    public static String draw(Peeler line) {
        Svg svg = new Svg(WIDTH, HEIGHT, "The lathe of the peeling line: " + caption(line));
        svg.rect(0, 0, WIDTH, HEIGHT, 14, "fill=\"#f1f4f7\"");
        svg.text(28, 42, "font-size=\"21\" font-weight=\"600\" " + INK, "The lathe");
        svg.text(28, 66, "font-size=\"14\" " + INK, "seen from its right end");
        svg.group(Svg.STILL, () -> block(line, svg));
        liveBlock(svg);
        roll(svg, line, AxisName.TOP_ROLL, 118, "top roll");
        roll(svg, line, AxisName.BOTTOM_ROLL_LEFT, 196, "bottom roll left");
        roll(svg, line, AxisName.BOTTOM_ROLL_RIGHT, 246, "bottom roll right");
        knife(line, svg);
        bar(line, svg);
        return svg.document();
    }

    /**
     * Draws the lathe to a file.
     *
     * @param line the line, between two steps
     * @param file the file; replaced if it exists
     * @throws IOException if the file cannot be written
     */
    public static void write(Peeler line, Path file) throws IOException {
        Files.writeString(file, draw(line));
    }

    private static String caption(Peeler line) {
        int block = line.blockAt(Place.LATHE);
        return block == 0 ? "no block" : "block " + block + ", " + line.shapeAt(Place.LATHE);
    }

    private static void block(Peeler line, Svg svg) {
        Peeling held = line.lathe().held();
        if (held == null) {
            return;
        }
        StringBuilder path = new StringBuilder();
        for (int i = 0; i < Profile.SECTORS; i++) {
            // The knife is at the right; the part that it cuts next is above it.
            double angle = i * SECTOR;
            double radius = held.radius(i) * SCALE;
            path.append(String.format(Locale.ROOT, "%s%.1f %.1f", i == 0 ? "M" : "L", X + radius * Math.cos(angle),
                    Y - radius * Math.sin(angle)));
        }
        svg.path(path.append('Z').toString(), WOOD);
        for (double ring = 0.2; ring < 0.9; ring += 0.17) {
            svg.ellipse(X, Y, held.surface() * SCALE * ring, held.surface() * SCALE * ring,
                    RING);
        }
        spindle(svg);
    }

    private static void spindle(Svg svg) {
        svg.ellipse(X, Y, 26, 26, STEEL);
        svg.stroke(X - 8, Y, X + 8, Y, "stroke=\"#22313f\"").stroke(X, Y - 8, X, Y + 8, "stroke=\"#22313f\"");
    }

    /** The block by its signals: it turns with the spindles, and reaches to the knife. */
    private static void liveBlock(Svg svg) {
        String turn = Svg.bound("turn", "spindle rotation.ActualPosition: 360") + Svg.bound("pivot", "%.0f %.0f", X, Y);
        String size = Svg.bound("scale", "knife carriage.ActualPosition: 0..%.0f -> 0..1", UNCUT);
        svg.group("display=\"none\"" + Svg.bound("show", "lathe holds block"), () -> svg.group(turn, () -> {
            svg.group(size, () -> {
                svg.ellipse(X, Y, UNCUT * SCALE, UNCUT * SCALE, WOOD);
                for (double ring = 0.2; ring < 0.9; ring += 0.17) {
                    svg.ellipse(X, Y, UNCUT * SCALE * ring, UNCUT * SCALE * ring, RING);
                }
                svg.stroke(X, Y, X + UNCUT * SCALE * 0.93, Y - 18, "stroke=\"#b98744\" stroke-width=\"2\"");
            });
            spindle(svg);
        }));
    }

    private static void roll(Svg svg, Peeler line, AxisName axis, double degrees, String name) {
        double position = line.position(axis);
        double from = (position + ROLL) * SCALE;
        double[] way = {SCALE * Math.cos(Math.toRadians(degrees)), -SCALE * Math.sin(Math.toRadians(degrees))};
        double x = X + from * way[0] / SCALE;
        double y = Y + from * way[1] / SCALE;
        StringBuilder moved = new StringBuilder();
        for (int i = 0; i < 2; i++) {
            moved.append(Svg.bound(i == 0 ? "x" : "y", "%s.ActualPosition: %.4f %s %.4f", name, way[i],
                    way[i] * position > 0 ? "-" : "+", Math.abs(way[i] * position)));
        }
        svg.group(moved.toString(), () -> {
            svg.ellipse(x, y, ROLL * SCALE, ROLL * SCALE, STEEL);
            svg.group(Svg.bound("turn", "roll rotation.ActualPosition: -360"), () -> {
                svg.stroke(x - ROLL * SCALE * 0.9, y, x + ROLL * SCALE * 0.9, y, SPOKE);
                svg.stroke(x, y - ROLL * SCALE * 0.9, x, y + ROLL * SCALE * 0.9, SPOKE);
            });
            svg.text(x - 4 * name.length(), y + 5, "font-size=\"13\" " + INK, name);
        });
    }

    private static void knife(Peeler line, Svg svg) {
        double position = line.position(AxisName.KNIFE_CARRIAGE);
        double pitch = line.position(AxisName.PITCH_ANGLE);
        double edge = X + position * SCALE;
        String moved = Svg.bound("x", "knife carriage.ActualPosition: %.2f - %.4f", SCALE, position * SCALE);
        String pitched = Svg.bound("turn", "pitch angle.ActualPosition: -1 %s %.4f", pitch < 0 ? "-" : "+", Math.abs(pitch))
                + Svg.bound("pivot", "%.1f %.1f", edge, Y);
        svg.group(moved, () -> {
            svg.group(String.format(Locale.ROOT, "transform=\"rotate(%.2f %.1f %.1f)\"", -pitch, edge, Y) + pitched,
                    () -> svg.path(String.format(Locale.ROOT, "M%.1f %.1fL%.1f %.1fV%.1fH%.1fZ", edge, Y, edge + 52, Y + 175,
                            Y + 230, edge + 12), STEEL));
            svg.text(edge + 62, Y + 170, "font-size=\"13\" " + INK, "knife carriage");
            svg.group("display=\"none\"" + Svg.bound("show", "knife carriage.Tracking"), () -> svg.path(ribbon(edge), VENEER
                    + " stroke-width=\"4\""));
        });
        Peeling held = line.lathe().held();
        if (held == null || held.thickest() == 0) {
            return;
        }
        svg.group(Svg.STILL, () -> {
            svg.path(ribbon(edge), VENEER + " stroke-width=\"" + Math.max(2.5, held.thickest() * SCALE) + "\""
                    + (line.round() ? "" : " stroke-dasharray=\"34 12 11 15\""));
            svg.text(edge + 110, Y + 74, "font-size=\"14\" font-weight=\"600\" " + INK,
                    line.round() ? "a whole ribbon" : "torn pieces: not round yet");
        });
    }

    /** The veneer on its way from the edge of the knife. */
    private static String ribbon(double edge) {
        return String.format(Locale.ROOT, "M%.1f %.1fC%.1f %.1f %.1f %.1f %d %.1f", edge + 2, Y - 2, edge + 30, Y + 60,
                edge + 70, Y + 112, WIDTH, Y + 120);
    }

    private static void bar(Peeler line, Svg svg) {
        svg.rect(0, HEIGHT - BAR, WIDTH, BAR, 0, "fill=\"#22313f\"");
        field(svg, 28, "in the spindles", "lathe holds block: 0 -> no block, 1 -> a block", caption(line));
        field(svg, 480, "knife", "knife carriage.ActualPosition: {0.0} mm",
                text("%.1f mm", line.position(AxisName.KNIFE_CARRIAGE)));
        field(svg, 590, "thickness", "knife carriage.Torque: {0.0} mm",
                text("%.1f mm", line.torque(AxisName.KNIFE_CARRIAGE)));
        field(svg, 690, "spindles", "spindle rotation.ActualSpeed: {0.00} rev/s",
                text("%.2f rev/s", line.speed(AxisName.SPINDLE_ROTATION)));
        svg.group(Svg.STILL, () -> field(svg, 830, "ribbon so far", null, text("%.1f m", line.wood().ribbon())));
    }

    private static String text(String format, double value) {
        return String.format(Locale.ROOT, format, value);
    }

    private static void field(Svg svg, double x, String name, String bound, String value) {
        svg.text(x, HEIGHT - BAR + 24, "font-size=\"12\" fill=\"#9fb2c2\"", name);
        svg.text(x, HEIGHT - BAR + 48, "font-size=\"16\" fill=\"#ffffff\""
                + (bound == null ? "" : Svg.bound("text", bound)), value);
    }
}
