package tickbus.machines.board;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Locale;
import tickbus.simulator.text.Svg;

/** Draws the current state of the testing board as a self-contained SVG. */
public final class BoardPicture {
    private static final int WIDTH = 760;
    private static final int HEIGHT = 430;
    private static final int TANK = 130;
    private static final int DEEP = 180;
    private static final String INK = "fill=\"#22313f\"";
    private static final String STEEL = "fill=\"none\" stroke=\"#5d6e7b\" stroke-width=\"3\"";
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
        svg.text(28, 390, "font-size=\"15\" " + INK, "gauge");
        svg.text(90, 390, "font-size=\"19\" font-weight=\"600\" " + INK, text("%.1f", board.gauge()));
        device(svg, 330, 90, "valve", board.valve());
        tank(svg, 300, board.level(1), "tank 1");
        device(svg, 480, 320, "pump", board.pump());
        tank(svg, 560, board.level(2), "tank 2");
        device(svg, 660, 380, "tap", board.tap());
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
        svg.rect(28, y - 22, 26, 44, 6, DARK).rect(32, on ? y - 18 : y, 18, 18, 4, "fill=\"#22313f\"");
        svg.text(64, y + 5, "font-size=\"14\" " + INK, "switch " + number + (on ? ": on" : ": off"));
        boolean lit = board.isLit(number);
        svg.ellipse(188, y, 18, 18, lit ? LIT : DARK);
        svg.text(214, y + 5, "font-size=\"14\" " + INK, "lamp " + number);
    }

    private static void tank(Svg svg, double x, double level, String name) {
        double top = 140;
        double height = DEEP * level / 100;
        svg.rect(x, top + DEEP - height, TANK, height, 0, WATER).rect(x, top, TANK, DEEP, 4, STEEL);
        svg.text(x + 8, top + 24, "font-size=\"15\" font-weight=\"600\" " + INK, name);
        svg.text(x + 8, top + 44, "font-size=\"14\" " + INK, text("%.1f %%", level));
    }

    private static void device(Svg svg, double x, double y, String name, boolean on) {
        svg.ellipse(x, y, 14, 14, on ? LIT : DARK);
        svg.text(x + 22, y + 5, "font-size=\"14\" " + INK, name + (on ? " on" : " off"));
    }

    private static String text(String format, double value) {
        return String.format(Locale.ROOT, format, value);
    }
}
