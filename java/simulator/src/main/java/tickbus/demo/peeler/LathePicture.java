package tickbus.demo.peeler;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Locale;
import tickbus.simulator.text.Svg;

/**
 * Draws the current state of the lathe as a self-contained SVG, seen from its right end: the cross-section of the
 * block at its middle, the knife and the veneer, the rolls, and a caption.
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
    private static final double SECTOR = 2 * Math.PI / Profile.SECTORS;
    private static final String INK = "fill=\"#22313f\"";
    private static final String STEEL = "fill=\"#a9b7c2\" stroke=\"#5d6e7b\" stroke-width=\"1.5\"";
    private static final String WOOD = "fill=\"#e8c48f\" stroke=\"#8a5a24\" stroke-width=\"2.5\"";

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
        block(line, svg);
        roll(svg, line.position(AxisName.TOP_ROLL), 118, "top roll");
        roll(svg, line.position(AxisName.BOTTOM_ROLL_LEFT), 196, "bottom roll left");
        roll(svg, line.position(AxisName.BOTTOM_ROLL_RIGHT), 246, "bottom roll right");
        knife(line, svg);
        bar(line, svg);
        return svg.document();
    }

    /**
     * Draws it to a file.
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
            // The knife is at the right; what it cuts next is above it.
            double angle = i * SECTOR;
            double radius = held.radius(i) * SCALE;
            path.append(String.format(Locale.ROOT, "%s%.1f %.1f", i == 0 ? "M" : "L", X + radius * Math.cos(angle),
                    Y - radius * Math.sin(angle)));
        }
        svg.path(path.append('Z').toString(), WOOD);
        for (double ring = 0.2; ring < 0.9; ring += 0.17) {
            svg.ellipse(X, Y, held.surface() * SCALE * ring, held.surface() * SCALE * ring,
                    "fill=\"none\" stroke=\"#cf9f60\" stroke-width=\"1\"");
        }
        svg.ellipse(X, Y, 26, 26, STEEL);
        svg.stroke(X - 8, Y, X + 8, Y, "stroke=\"#22313f\"").stroke(X, Y - 8, X, Y + 8, "stroke=\"#22313f\"");
    }

    private static void roll(Svg svg, double distance, double degrees, String name) {
        double from = (distance + ROLL) * SCALE;
        double x = X + from * Math.cos(Math.toRadians(degrees));
        double y = Y - from * Math.sin(Math.toRadians(degrees));
        svg.ellipse(x, y, ROLL * SCALE, ROLL * SCALE, STEEL);
        svg.text(x - 4 * name.length(), y + 5, "font-size=\"13\" " + INK, name);
    }

    private static void knife(Peeler line, Svg svg) {
        double edge = X + line.position(AxisName.KNIFE_CARRIAGE) * SCALE;
        svg.line("<g transform=\"rotate(%.2f %.1f %.1f)\">", -line.position(AxisName.PITCH_ANGLE), edge, Y);
        svg.path(String.format(Locale.ROOT, "M%.1f %.1fL%.1f %.1fV%.1fH%.1fZ", edge, Y, edge + 52, Y + 175, Y + 230,
                edge + 12), STEEL);
        svg.line("</g>");
        svg.text(edge + 62, Y + 170, "font-size=\"13\" " + INK, "knife carriage");
        Peeling held = line.lathe().held();
        if (held == null || held.thickest() == 0) {
            return;
        }
        String look = "fill=\"none\" stroke=\"#c98f4a\" stroke-width=\"" + Math.max(2.5, held.thickest() * SCALE) + "\""
                + (line.round() ? "" : " stroke-dasharray=\"34 12 11 15\"");
        svg.path(String.format(Locale.ROOT, "M%.1f %.1fC%.1f %.1f %.1f %.1f %d %.1f", edge + 2, Y - 2, edge + 30,
                Y + 60, edge + 70, Y + 112, WIDTH, Y + 120), look);
        svg.text(edge + 110, Y + 74, "font-size=\"14\" font-weight=\"600\" " + INK,
                line.round() ? "a whole ribbon" : "torn pieces: not round yet");
    }

    private static void bar(Peeler line, Svg svg) {
        svg.rect(0, HEIGHT - BAR, WIDTH, BAR, 0, "fill=\"#22313f\"");
        field(svg, 28, "in the spindles", caption(line));
        field(svg, 480, "knife", text("%.1f mm", line.position(AxisName.KNIFE_CARRIAGE)));
        field(svg, 590, "thickness", text("%.1f mm", line.torque(AxisName.KNIFE_CARRIAGE)));
        field(svg, 690, "spindles", text("%.2f rev/s", line.speed(AxisName.SPINDLE_ROTATION)));
        field(svg, 830, "ribbon so far", text("%.1f m", line.wood().ribbon()));
    }

    private static String text(String format, double value) {
        return String.format(Locale.ROOT, format, value);
    }

    private static void field(Svg svg, double x, String name, String value) {
        svg.text(x, HEIGHT - BAR + 24, "font-size=\"12\" fill=\"#9fb2c2\"", name);
        svg.text(x, HEIGHT - BAR + 48, "font-size=\"16\" fill=\"#ffffff\"", value);
    }
}
