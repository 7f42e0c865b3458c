package tickbus.machines.board;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Locale;
import tickbus.simulator.text.Svg;

/**
 * Draws the current state of the testing board as a self-contained SVG.
 *
 * <p>Values that signals carry are bound to them, so that {@code java/machines/board.svg}, the board at its start, moves on the
 * live page, and its switches can be turned there.
 */
public final class BoardPicture {
    private static final int WIDTH = 760;
    private static final int HEIGHT = 430;
    private static final int TANK = 130;
    private static final int DEEP = 180;
    private static final String INK = "fill=\"#22313f\"";
    private static final String STEEL = "fill=\"none\" stroke=\"#5d6e7b\" stroke-width=\"3\"";
    private static final String PIPE = "stroke=\"#93a3b0\" stroke-width=\"7\"";
    private static final String WATER = "fill=\"#5aa7d6\"";
    private static final String DARK = "fill=\"#c9d2da\" stroke=\"#5d6e7b\" stroke-width=\"2\"";
    private static final String LIT = "fill=\"#ffc83d\" stroke=\"#8a5a24\" stroke-width=\"2\"";

    private BoardPicture() {
    }

    /**
     * Draws a board.
     *
     * @param board the board, between two steps
     * @return an SVG document
     */
    public static String draw(TestingBoard board) {
        Svg svg = new Svg(WIDTH, HEIGHT, String.format(Locale.ROOT, "The testing board: levels %.1f and %.1f percent",
                board.level(1), board.level(2)));
        svg.rect(0, 0, WIDTH, HEIGHT, 14, "fill=\"#f1f4f7\"");
        svg.text(28, 42, "font-size=\"21\" font-weight=\"600\" " + INK, "The testing board");
        for (int i = 1; i <= TestingBoard.SWITCHES; i++) {
            panel(svg, board, i);
        }
        svg.text(28, 404, "font-size=\"15\" " + INK, "gauge");
        svg.text(90, 404, "font-size=\"19\" font-weight=\"600\" " + INK + Svg.bound("text", "gauge: {0.0}"),
                text("%.1f", board.gauge()));
        svg.stroke(365, 60, 365, 150, PIPE);
        device(svg, 365, 92, "valve", board.valve());
        svg.stroke(420, 294, 570, 294, PIPE);
        device(svg, 466, 294, "pump", board.pump());
        tank(svg, 300, board.level(1), 1);
        tank(svg, 560, board.level(2), 2);
        svg.stroke(625, 320, 625, 390, PIPE);
        // No controller works the tap.
        svg.group(Svg.STILL, () -> {
            svg.ellipse(625, 356, 14, 14, board.tap() ? LIT : DARK);
            svg.text(645, 376, "font-size=\"14\" " + INK, board.tap() ? "tap on" : "tap off");
        });
        return svg.document();
    }

    /**
     * Draws a board to a file.
     *
     * @param board the board, between two steps
     * @param file the file; replaced if it exists
     * @throws IOException if the file cannot be written
     */
    public static void write(TestingBoard board, Path file) throws IOException {
        Files.writeString(file, draw(board));
    }

    private static void panel(Svg svg, TestingBoard board, int number) {
        double y = 40 + 75.0 * number;
        boolean on = board.isOn(number);
        String name = "switch " + number;
        svg.group(Svg.bound("switch", name), () -> {
            svg.rect(28, y - 22, 26, 44, 6, DARK);
            svg.rect(32, on ? y - 18 : y, 18, 18, 4, "fill=\"#22313f\"" + Svg.bound("y", name + (on
                    ? ": off -> 18, on -> 0" : ": off -> 0, on -> -18")));
            svg.text(64, y + 5, "font-size=\"14\" " + INK + states(name, name + ":"), name + (on ? ": on" : ": off"));
        });
        lamp(svg, 188, y, 18, "lamp " + number, board.isLit(number));
        svg.text(214, y + 5, "font-size=\"14\" " + INK, "lamp " + number);
    }

    private static void tank(Svg svg, double x, double level, int number) {
        double top = 140;
        double height = DEEP * level / 100;
        String signal = "level " + number;
        svg.line("<clipPath id=\"tank%d\"><rect x=\"%.1f\" y=\"%.1f\" width=\"%d\" height=\"%d\"/></clipPath>", number, x, top,
                TANK, DEEP);
        svg.group("clip-path=\"url(#tank" + number + ")\"", () -> svg.rect(x, top + DEEP - height, TANK, DEEP, 0,
                WATER + Svg.bound("y", signal + ": %.1f + %.4f", -DEEP / 100.0, height)));
        svg.rect(x, top, TANK, DEEP, 4, STEEL);
        svg.text(x + 8, top + 24, "font-size=\"15\" font-weight=\"600\" " + INK, "tank " + number);
        svg.text(x + 8, top + 44, "font-size=\"14\" " + INK + Svg.bound("text", signal + ": {0.0} %%"),
                text("%.1f %%", level));
    }

    private static void device(Svg svg, double x, double y, String name, boolean on) {
        lamp(svg, x, y, 14, name, on);
        svg.text(x + 20, y + 20, "font-size=\"14\" " + INK + states(name, name), name + (on ? " on" : " off"));
    }

    private static void lamp(Svg svg, double x, double y, double radius, String signal, boolean on) {
        svg.ellipse(x, y, radius, radius, (on ? LIT : DARK)
                + Svg.bound("fill", signal + ": off -> #c9d2da, on -> #ffc83d"));
    }

    private static String states(String signal, String caption) {
        return Svg.bound("text", "%s: off -> \"%s off\", on -> \"%s on\"", signal, caption, caption);
    }

    private static String text(String format, double value) {
        return String.format(Locale.ROOT, format, value);
    }
}
