package tickbus.simulator.text;

import java.util.Locale;

/**
 * Writes SVG elements, with numbers short enough to read and the same on every locale.
 *
 * <p>Drawn elements can be bound to signals: the live page then moves them (docs/live-page.md).
 */
public final class Svg {
    /** An attribute for parts of the still picture, left out of the live page, since no signal carries them. */
    public static final String STILL = " data-tb-still=\"\"";

    private final StringBuilder text = new StringBuilder(16_384);

    /**
     * Begins a document.
     *
     * @param width in pixels
     * @param height in pixels
     * @param title of the picture
     */
    public Svg(int width, int height, String title) {
        line("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" width=\"%d\" height=\"%d\""
                        + " font-family=\"'Segoe UI', 'DejaVu Sans', Helvetica, Arial, sans-serif\" role=\"img\">",
                width, height, width, height);
        line("<title" + STILL + ">%s</title>", escape(title));
    }

    /**
     * The attribute that binds an element to a signal.
     *
     * @param what the bound property: "y", "fill", "show", "text", …
     * @param how the signal's name, and behind a colon the conversion of its values
     * @param values of the format's placeholders
     * @return an attribute, with a blank in front of it
     */
    public static String bound(String what, String how, Object... values) {
        return " data-tb-" + what + "=\"" + escape(String.format(Locale.ROOT, how, values)) + "\"";
    }

    /**
     * Adds a group that is clipped by a rectangle, or moves together.
     *
     * @param look attributes of the group
     * @param inside draws the contents
     * @return this
     */
    public Svg group(String look, Runnable inside) {
        text.append("<g ").append(look.strip()).append(">\n");
        inside.run();
        text.append("</g>\n");
        return this;
    }

    /**
     * Adds one element or any other line of markup, formatted.
     *
     * @param markup a format
     * @param values its values
     * @return this
     */
    public Svg line(String markup, Object... values) {
        text.append(String.format(Locale.ROOT, markup, values)).append('\n');
        return this;
    }

    /**
     * Adds a rectangle.
     *
     * @param x left
     * @param y top
     * @param width in pixels
     * @param height in pixels
     * @param round radius of the corners
     * @param look attributes
     * @return this
     */
    public Svg rect(double x, double y, double width, double height, double round, String look) {
        return line("<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" rx=\"%.1f\" %s/>",
                x, y, width, height, round, look);
    }

    /**
     * Adds an ellipse.
     *
     * @param x the middle
     * @param y the middle
     * @param rx half width
     * @param ry half height
     * @param look attributes
     * @return this
     */
    public Svg ellipse(double x, double y, double rx, double ry, String look) {
        return line("<ellipse cx=\"%.1f\" cy=\"%.1f\" rx=\"%.1f\" ry=\"%.1f\" %s/>", x, y, rx, ry, look);
    }

    /**
     * Adds a line.
     *
     * @param x1 from
     * @param y1 from
     * @param x2 to
     * @param y2 to
     * @param look attributes
     * @return this
     */
    public Svg stroke(double x1, double y1, double x2, double y2, String look) {
        return line("<line x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\" %s/>", x1, y1, x2, y2, look);
    }

    /**
     * Adds a path.
     *
     * @param data in SVG's syntax
     * @param look attributes
     * @return this
     */
    public Svg path(String data, String look) {
        return line("<path d=\"%s\" %s/>", data, look);
    }

    /**
     * Adds words.
     *
     * @param x left
     * @param y base line
     * @param look attributes
     * @param words the text
     * @return this
     */
    public Svg text(double x, double y, String look, String words) {
        return line("<text x=\"%.1f\" y=\"%.1f\" %s>%s</text>", x, y, look, escape(words));
    }

    /**
     * Adds a button that works on the live page, and is lit while its signal is on.
     *
     * @param x left
     * @param y top
     * @param width in pixels
     * @param kind "press" for a push-button, "switch" for a switch
     * @param signal the name of a BOOL
     * @param caption the text on the button
     * @param colour of the lit button
     * @return this
     */
    public Svg button(double x, double y, double width, String kind, String signal, String caption, String colour) {
        return group(bound(kind, signal), () -> rect(x, y, width, 30, 6, "fill=\"#3c474f\""
                + bound("fill", "%s: off -> #3c474f, on -> %s", signal, colour))
                .text(x + width / 2, y + 20, "font-size=\"14\" fill=\"#ffffff\" text-anchor=\"middle\"", caption));
    }

    /**
     * Adds an upright cylinder: a round top and a side.
     *
     * @param x the middle
     * @param top of its side
     * @param bottom of its side
     * @param rx half width
     * @param ry half height of the top
     * @param side attributes
     * @param lid attributes of the top
     * @return this
     */
    public Svg cylinder(double x, double top, double bottom, double rx, double ry, String side, String lid) {
        path(String.format(Locale.ROOT, "M%.1f %.1fV%.1fA%.1f %.1f 0 0 0 %.1f %.1fV%.1fZ",
                x - rx, top, bottom, rx, ry, x + rx, bottom, top), side);
        return ellipse(x, top, rx, ry, lid);
    }

    /**
     * The whole document.
     *
     * @return markup
     */
    public String document() {
        return text + "</svg>\n";
    }

    private static String escape(String words) {
        return words.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace("\"", "&quot;");
    }
}
