package tickbus.machines.cell;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Locale;
import tickbus.simulator.text.Svg;

/**
 * Draws the cell at rest as a self-contained SVG: the stations from the side, and the transport from above. Everything that
 * moves is bound to signals of plc/cell/cell.cfg, so that {@code java/machines/cell.svg} moves on the live page.
 *
 * <p>A cylinder has a sensor at each end: between them it is drawn half-way.
 */
public final class CellPicture {
    private static final int WIDTH = 960;
    private static final int HEIGHT = 640;
    private static final int TOP = 84;
    private static final int PANEL = 292;
    /** Where pieces and sleeves stand, and their height. */
    private static final double FLOOR = TOP + 205;
    private static final double PIECE = 42;
    private static final String INK = "fill=\"#22313f\"";
    private static final String SMALL = "font-size=\"12\" fill=\"#51626f\"";
    private static final String STEEL = "fill=\"#a9b7c2\" stroke=\"#5d6e7b\" stroke-width=\"1.5\"";
    private static final String DARK = "fill=\"#5d6e7b\"";
    private static final String WOOD = "fill=\"#d8b98a\" stroke=\"#8a6a3c\" stroke-width=\"1.5\"";
    private static final String SLEEVE = "fill=\"#3f5f7a\" stroke=\"#22313f\" stroke-width=\"1.5\"";
    private static final String OFF = "#dde4e9";
    /** Seconds from one end of a cylinder to the middle. */
    private static final String SMOOTH = Svg.bound("smooth", "0.06");

    private final Svg svg = new Svg(WIDTH, HEIGHT, "The manufacturing cell at rest");

    private CellPicture() {
    }

    /** Draws the cell; returns an SVG document. */
    public static String draw() {
        CellPicture picture = new CellPicture();
        picture.panel();
        picture.stationOne(16);
        picture.stationThree(16 + PANEL + 26);
        picture.stationFour(16 + 2 * (PANEL + 26));
        picture.transport();
        return picture.svg.document();
    }

    /**
     * Draws the cell to a file.
     *
     * @throws IOException if the file cannot be written
     */
    static void write(Path file) throws IOException {
        Files.writeString(file, draw());
    }

    private void panel() {
        svg.rect(0, 0, WIDTH, HEIGHT, 14, "fill=\"#f1f4f7\"");
        svg.text(20, 38, "font-size=\"21\" font-weight=\"600\" " + INK, "The manufacturing cell");
        svg.button(310, 16, 86, "switch", "S1 start", "Start", "#2b79b5");
        lamp(420, 31, "Running lamp", "running", "#2fa85a");
        svg.button(520, 16, 138, "switch", "S1 emergency", "Emergency stop", "#d43a2f");
        lamp(690, 31, "Rearm lamp", "asks for Rearm", "#e0a030");
        svg.button(834, 16, 86, "press", "S1 rearm", "Rearm", "#2b79b5");
    }

    private void lamp(double x, double y, String signal, String name, String colour) {
        svg.ellipse(x, y, 7, 7, "fill=\"" + OFF + "\" stroke=\"#b4c0ca\" stroke-width=\"1.5\""
                + Svg.bound("fill", "%s: off -> %s, on -> %s", signal, OFF, colour));
        svg.text(x + 13, y + 5, "font-size=\"13\" " + INK, name);
    }

    private void station(int x, String name) {
        svg.rect(x, TOP - 24, PANEL, 304, 10, "fill=\"#ffffff\" stroke=\"#cfd8df\"");
        svg.text(x + 12, TOP, "font-size=\"15\" font-weight=\"600\" " + INK, name);
    }

    /** A part that moves along x or y between two sensors; distances are in pixels. */
    private void between(String back, String forward, String axis, int way, Runnable inside) {
        svg.group(Svg.bound(axis, "%s: off -> %d, on -> 0", back, way / 2) + SMOOTH,
                () -> svg.group(Svg.bound(axis, "%s: off -> 0, on -> %d", forward, way - way / 2) + SMOOTH, inside));
    }

    private void shown(String signal, Runnable inside) {
        svg.group("display=\"none\"" + Svg.bound("show", signal), inside);
    }

    private void pallet(double middle, int stop) {
        shown("Pallet at stop " + stop, () -> {
            svg.rect(middle - 45, FLOOR, 90, 20, 3, WOOD);
            svg.rect(middle - 10, FLOOR + 14, 20, 6, 1, DARK);
        });
        svg.stroke(middle - 70, FLOOR + 22, middle + 60, FLOOR + 22, "stroke=\"#5d6e7b\" stroke-width=\"3\"");
    }

    private void piece(double middle, String look) {
        svg.rect(middle - 13, FLOOR - PIECE, 26, PIECE, 3, look);
    }

    private void stationOne(int x) {
        station(x, "Station 1: sleeves");
        double back = x + 48;
        double front = x + 112;
        double pallet = x + 220;
        svg.rect(x + 12, TOP + 20, 22, 150, 2, "fill=\"#eef2f5\" stroke=\"#93a3b0\"");
        svg.text(x + 38, TOP + 34, SMALL, "magazine");
        svg.rect(x + 34, FLOOR, 94, 9, 4, STEEL);
        for (double at : new double[] {x + 41, x + 121}) {
            svg.group(Svg.bound("spin", "S1 belt advance: 360"), () -> svg.ellipse(at, FLOOR + 5, 6, 6, DARK)
                    .stroke(at - 5, FLOOR + 5, at + 5, FLOOR + 5, "stroke=\"#ffffff\" stroke-width=\"1.5\""));
        }
        between("S1 loader back", "S1 loader forward", "x", 22, () -> svg.rect(x + 2, FLOOR - 16, 24, 8, 1, STEEL));
        shown("S1 belt back", () -> svg.rect(back - 13, FLOOR - PIECE, 26, PIECE, 3,
                SLEEVE + Svg.bound("fill", "S1 optical: off -> #2b333a, on -> #c0433c")));
        shown("S1 inductive", () -> piece(back, "fill=\"#b9c4cc\" stroke=\"#22313f\" stroke-width=\"1.5\""));
        shown("S1 belt front", () -> piece(front, SLEEVE));
        pallet(pallet, 1);
        svg.stroke(front - 10, TOP + 58, pallet + 30, TOP + 58, "stroke=\"#93a3b0\" stroke-width=\"5\"");
        int way = (int) (pallet - front);
        between("S1 arm left", "S1 arm right", "x", way, () -> {
            svg.rect(front - 16, TOP + 48, 32, 20, 3, STEEL);
            between("S1 arm up", "S1 arm down", "y", 60, () -> {
                svg.rect(front - 4, TOP + 20, 8, 76, 1, STEEL);
                svg.rect(front - 18, TOP + 94, 36, 8, 2, DARK);
                svg.rect(front - 18, TOP + 102, 4, 14, 1, DARK + Svg.bound("x", "S1 gripper: 0..1 -> -4..1"));
                svg.rect(front + 14, TOP + 102, 4, 14, 1, DARK + Svg.bound("x", "S1 gripper: 0..1 -> 4..-1"));
                shown("S1 sleeve held", () -> svg.rect(front - 13, TOP + 103, 26, PIECE, 3, SLEEVE));
            });
        });
        between("S1 reader back", "S1 reader forward", "y", -16, () -> {
            svg.rect(pallet - 14, FLOOR + 42, 28, 12, 2, "fill=\"#3b82c4\"");
            svg.rect(pallet - 3, FLOOR + 54, 6, 14, 0, STEEL);
        });
        svg.text(pallet - 62, FLOOR + 58, SMALL, "head 1");
    }

    private void press(double middle, String station) {
        svg.rect(middle - 16, TOP + 20, 32, 40, 3, STEEL);
        between(station + " press up", station + " press down", "y", 40, () -> {
            svg.rect(middle - 5, TOP + 56, 10, 60, 0, STEEL);
            svg.rect(middle - 18, TOP + 112, 36, 9, 2, DARK);
        });
    }

    private void feeder(double x, String station, String part, int way, String name) {
        between(station + " " + part + " back", station + " " + part + " forward", "x", way,
                () -> svg.rect(x, FLOOR - PIECE - 18, 44, 10, 2, STEEL));
        svg.text(x, FLOOR - PIECE - 26, SMALL, name);
    }

    private void stationThree(int x) {
        station(x, "Station 3: parts and head");
        double middle = x + 150;
        pallet(middle, 3);
        shown("S3 piston in", () -> {
            piece(middle, "fill=\"#8fa9be\" stroke=\"#22313f\" stroke-width=\"1.5\"");
            svg.rect(middle - 9, FLOOR - 22, 18, 8, 1, "fill=\"#e0a030\"");
        });
        shown("S3 head on", () -> {
            piece(middle, SLEEVE);
            svg.rect(middle - 15, FLOOR - PIECE - 3, 30, 8, 2, "fill=\"#c9d3da\" stroke=\"#22313f\"");
        });
        press(middle, "S3");
        feeder(x + 20, "S3", "parts", 58, "parts");
        feeder(x + 228, "S3", "head", -50, "heads");
        lamp(x + 24, FLOOR + 50, "S3 empty lamp", "a magazine is empty", "#e0a030");
    }

    private void stationFour(int x) {
        station(x, "Station 4: cap and exit");
        double middle = x + 100;
        double exit = x + 236;
        pallet(middle, 4);
        shown("S4 cap on", () -> {
            piece(middle, SLEEVE);
            svg.rect(middle - 15, FLOOR - PIECE - 6, 30, 10, 3, "fill=\"#d64545\" stroke=\"#22313f\"");
        });
        press(middle - 26, "S4");
        feeder(x + 8, "S4", "cap", 36, "caps");
        svg.stroke(middle + 10, TOP + 58, exit + 30, TOP + 58, "stroke=\"#93a3b0\" stroke-width=\"5\"");
        int way = (int) (exit - middle - 24);
        between("S4 arm inside", "S4 arm outside", "x", way, () -> {
            svg.rect(middle + 8, TOP + 48, 32, 20, 3, STEEL);
            between("S4 arm up", "S4 arm down", "y", 58, () -> {
                svg.rect(middle + 20, TOP + 20, 8, 76, 1, STEEL);
                svg.ellipse(middle + 24, TOP + 99, 15, 5, DARK
                        + Svg.bound("fill", "S4 vacuum valve: off -> #5d6e7b, on -> #3b82c4"));
                shown("S4 vacuum", () -> svg.rect(middle + 11, TOP + 104, 26, PIECE, 3, SLEEVE));
            });
        });
        svg.path(String.format(Locale.ROOT, "M%.0f %.0fh56l-10 34h-36z", exit - 28, FLOOR), "fill=\"#eef2f5\" stroke=\"#93a3b0\"");
        svg.text(exit - 12, FLOOR + 50, SMALL, "exit");
        shown("S4 exit", () -> svg.rect(exit - 13, FLOOR + 4, 26, 26, 3, SLEEVE));
        lamp(x + 24, FLOOR + 50, "S4 empty lamp", "no caps", "#e0a030");
    }

    /** The stops in the loop, seen from above; the belt runs clockwise. */
    private void transport() {
        double left = 60;
        double right = WIDTH - 60;
        double top = 432;
        double bottom = 580;
        svg.rect(left, top, right - left, bottom - top, 60, "fill=\"none\" stroke=\"#b4c0ca\" stroke-width=\"44\"");
        svg.rect(left, top, right - left, bottom - top, 60, "fill=\"none\" stroke=\"#e8edf1\" stroke-width=\"36\"");
        double[][] stops = {{250, top}, {710, top}, {710, bottom}, {250, bottom}};
        for (int stop = 1; stop <= Transport.STOPS; stop++) {
            double x = stops[stop - 1][0];
            double y = stops[stop - 1][1];
            double ahead = stop <= 2 ? x + 44 : x - 44;
            shown("Pallet at stop " + stop, () -> svg.rect(x - 36, y - 15, 72, 30, 4, WOOD).ellipse(x, y, 7, 7, DARK));
            svg.rect(ahead - 4, y - 20, 8, 40, 2, "fill=\"#d64545\""
                    + Svg.bound("fill", "Open stop %d: off -> #d64545, on -> #2fa85a", stop));
            svg.text(x - 40, stop <= 2 ? y + 42 : y - 30, SMALL, stop == 2 ? "stop 2, no station" : "stop " + stop + ", station " + stop);
        }
        for (double x : new double[] {left, right}) {
            double y = (top + bottom) / 2;
            svg.group(Svg.bound("spin", "Belt: 300"), () -> svg.group(Svg.bound("spin", "Belt back: -300"),
                    () -> svg.ellipse(x, y, 16, 16, STEEL).stroke(x - 14, y, x + 14, y, "stroke=\"#22313f\" stroke-width=\"2\"")
                            .stroke(x, y - 14, x, y + 14, "stroke=\"#22313f\" stroke-width=\"2\"")));
        }
        svg.text(WIDTH / 2.0 - 90, (top + bottom) / 2 + 5, "font-size=\"14\" " + INK
                + Svg.bound("text", "Belt: off -> the belt stands, on -> the belt runs"), "the belt stands");
    }
}
