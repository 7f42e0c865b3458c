package tickbus.machines.rig;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Locale;
import tickbus.simulator.text.Svg;

/**
 * Draws the current state of a rig as a self-contained SVG: both wheels seen from a little above, both lifts with
 * their cups, every bottle with its number, the lamp, the sensors, and a caption with phase, step and cycle.
 *
 * <p>Values that signals carry are bound to them, so that the same picture moves on the live page: {@code
 * java/machines/rig.svg} is the picture of the rig's start position.
 */
public final class RigPicture {
    private static final int WIDTH = 960;
    private static final int HEIGHT = 780;
    private static final int BAR = 66;
    private static final int PHASES = 8;
    private static final String INK = "fill=\"#22313f\"";
    private static final String PALE = "fill=\"#8fa1b0\"";

    private RigPicture() {}

    /**
     * Draws a rig.
     *
     * @param rig the rig, between two steps
     * @return an SVG document
     */
    public static String draw(Rig rig) {
        Svg svg = new Svg(WIDTH, HEIGHT, "The test rig: " + caption(rig));
        define(svg);
        svg.line("<clipPath id=\"card\"><rect width=\"%d\" height=\"%d\" rx=\"14\"/></clipPath>", WIDTH, HEIGHT);
        svg.line("<g clip-path=\"url(#card)\">");
        svg.rect(0, 0, WIDTH, HEIGHT, 0, "fill=\"url(#wall)\"");
        svg.rect(0, 622, WIDTH, HEIGHT, 0, "fill=\"url(#floor)\"");
        new RigScene(rig, svg).draw();
        panel(rig, svg);
        bar(rig, svg);
        svg.line("</g>");
        return svg.document();
    }

    /**
     * Draws a rig to a file.
     *
     * @param rig the rig, between two steps
     * @param file the file; replaced if it exists
     * @throws IOException if the file cannot be written
     */
    public static void write(Rig rig, Path file) throws IOException {
        Files.writeString(file, draw(rig));
    }

    private static String caption(Rig rig) {
        return String.format(Locale.ROOT, "phase %s, step %d, cycle %d, %.2f s",
                RigPanel.phase(rig.panelPhase()), rig.panelStep(), rig.panelCycles(), rig.time() * 1e-9);
    }

    private static void define(Svg svg) {
        svg.line("<defs>");
        gradient(svg, "wall", "0", "1", "#fbfcfd", "#e4eaef");
        gradient(svg, "floor", "0", "1", "#c3ced6", "#dbe2e7");
        gradient(svg, "steel", "1", "0", "#a3b1bd", "#f0f3f6", "#95a4b1");
        gradient(svg, "motor", "1", "0", "#33434f", "#7e92a3", "#2d3b46");
        gradient(svg, "fresh", "1", "0", "#2a76ab", "#a5d6f3", "#276e9f");
        gradient(svg, "treated", "1", "0", "#2f8a4f", "#aee6be", "#2a7c47");
        gradient(svg, "glass", "1", "0", "#8fb3c9", "#ffffff", "#8fb3c9");
        svg.line("<radialGradient id=\"glow\"><stop offset=\"0\" stop-color=\"#fff2a8\" stop-opacity=\"1\"/>"
                + "<stop offset=\"0.4\" stop-color=\"#ffd84d\" stop-opacity=\"0.5\"/>"
                + "<stop offset=\"1\" stop-color=\"#ffd84d\" stop-opacity=\"0\"/></radialGradient>");
        svg.line("</defs>");
    }

    private static void gradient(Svg svg, String id, String x2, String y2, String... colours) {
        StringBuilder stops = new StringBuilder();
        for (int i = 0; i < colours.length; i++) {
            stops.append(String.format(Locale.ROOT, "<stop offset=\"%.2f\" stop-color=\"%s\"/>",
                    i / (colours.length - 1.0), colours[i]));
        }
        svg.line("<linearGradient id=\"%s\" x1=\"0\" y1=\"0\" x2=\"%s\" y2=\"%s\">%s</linearGradient>",
                id, x2, y2, stops);
    }

    /** The operator panel: its lamps, as the control drives them, the rig's own Not OK, and the buttons. */
    private static void panel(Rig rig, Svg svg) {
        svg.text(28, 42, "font-size=\"21\" font-weight=\"600\" " + INK, "Test rig");
        String[] names = {"Ready", "Running", "Fault", "Parked", "Not OK"};
        boolean[] lit = {
            rig.panelLamp(0), rig.panelLamp(1), rig.panelLamp(2), rig.panelLamp(3), rig.notOk(),
        };
        String[] colours = {"#3b82c4", "#2fa85a", "#d64545", "#8a6fc2", "#d64545"};
        for (int i = 0; i < names.length; i++) {
            double y = 72 + 25 * i;
            String signal = i < 4 ? names[i] + " lamp" : names[i];
            svg.ellipse(38, y, 7.5, 7.5, (lit[i]
                    ? "fill=\"" + colours[i] + "\" stroke=\"#ffffff\" stroke-width=\"1.5\""
                    : "fill=\"#dde4e9\" stroke=\"#b4c0ca\" stroke-width=\"1.5\"")
                    + Svg.bound("fill", "%s: off -> #dde4e9, on -> %s", signal, colours[i]));
            svg.text(54, y + 5, "font-size=\"14\" " + (lit[i] ? INK + " font-weight=\"600\"" : PALE)
                    + Svg.bound("fill", "%s: off -> #8fa1b0, on -> #22313f", signal), names[i]);
        }
        svg.button(28, 196, 86, "press", "Start button", "Start", "#35a060");
        svg.button(124, 196, 86, "press", "Stop button", "Stop", "#d43a2f");
        svg.button(220, 196, 86, "press", "Reset button", "Reset", "#2b79b5");
        svg.group(Svg.STILL, () -> {
            for (int i = 0; i < 2; i++) {
                String paint = i == 0 ? "fresh" : "treated";
                svg.rect(155, 64 + 25 * i, 14, 17, 4, "fill=\"url(#" + paint + ")\" stroke=\"#1f4a66\"");
                svg.text(178, 77 + 25 * i, "font-size=\"14\" " + INK, paint);
            }
        });
    }

    private static void bar(Rig rig, Svg svg) {
        double top = HEIGHT - BAR;
        svg.rect(0, top, WIDTH, BAR, 0, "fill=\"#22313f\"");
        field(svg, 28, "phase", phases(), RigPanel.phase(rig.panelPhase()));
        field(svg, 180, "step", Svg.bound("text", "Step: 0 -> –, else -> {0} of 6"),
                rig.panelStep() == 0 ? "–" : rig.panelStep() + " of 6");
        field(svg, 290, "cycle", Svg.bound("text", "Cycles: {0}"), Long.toString(rig.panelCycles()));
        svg.group(Svg.STILL, () -> {
            field(svg, 380, "time", "", String.format(Locale.ROOT, "%.2f s", rig.time() * 1e-9));
            Counters counters = rig.counters();
            field(svg, 500, "bottles fed", "", Long.toString(counters.fed()));
            field(svg, 610, "treated", "", Long.toString(counters.treated()));
            field(svg, 700, "delivered", "", Long.toString(counters.delivered()));
            field(svg, 800, "jams", "", Long.toString(counters.jams()));
        });
        svg.group((rig.notOk() ? "" : "display=\"none\"") + Svg.bound("show", "Not OK"), () -> {
            svg.rect(0, top - 32, WIDTH, 32, 0, "fill=\"#b83232\"");
            String look = "font-size=\"14.5\" font-weight=\"600\" fill=\"#ffffff\"";
            svg.text(28, top - 11, look + Svg.bound("text", "Not OK: 0 -> OK, 1 -> Not OK: a jam or a collision"),
                    rig.notOk() ? "Not OK: " + rig.faults().get(0) + (rig.faults().size() > 1 ? " …" : "") : "OK");
        });
    }

    /** The names of the PLC program's phases. */
    private static String phases() {
        StringBuilder cases = new StringBuilder("Phase: ");
        for (int phase = 0; phase < PHASES; phase++) {
            cases.append(phase == 0 ? "" : ", ").append(phase).append(" -> ").append(RigPanel.phase(phase));
        }
        return Svg.bound("text", cases.toString());
    }

    private static void field(Svg svg, double x, String name, String bound, String value) {
        svg.text(x, HEIGHT - BAR + 24, "font-size=\"12\" fill=\"#9fb2c2\"", name);
        svg.text(x, HEIGHT - BAR + 48, "font-size=\"19\" font-weight=\"600\" fill=\"#ffffff\"" + bound, value);
    }
}
