package tickbus.petri.draw;

import java.io.IOException;
import java.io.InputStream;
import java.io.UncheckedIOException;
import java.nio.charset.StandardCharsets;
import java.util.Arrays;
import java.util.List;
import tickbus.petri.net.Arc;
import tickbus.petri.net.ArcKind;
import tickbus.petri.net.Delay;
import tickbus.petri.net.Marking;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.net.Transition;

/**
 * Draws a net with a marking as SVG.
 *
 * <p>Up to five tokens are dots, more are a number. Enabled transitions are coloured and framed; a timed transition is
 * hollow. An inhibitor arc ends in a ring, a test arc is dashed, a weight above 1 is beside its arc. Nodes have their
 * positions from the net's file if it has a drawing; otherwise they are in layers. The colours follow the screen's light or
 * dark mode. All names are escaped, so the text can be put into a page unchanged.
 */
public final class NetSvg {
    /** x and y of the dots of 0 to 5 tokens, from the middle of the place. */
    static final int[][] DOTS = {{}, {0, 0}, {-6, 0, 6, 0}, {-6, 5, 6, 5, 0, -6}, {-6, -6, 6, -6, -6, 6, 6, 6},
        {-7, -7, 7, -7, -7, 7, 7, 7, 0, 0}};
    static final String STYLE = style("net.css");
    private static final double HEAD = 8;
    private static final double RING = 4;

    private final StringBuilder out = new StringBuilder();

    private NetSvg() {
    }

    /** The net with its initial marking. */
    public static String write(PetriNet net) {
        return write(net, net.initialMarking());
    }

    /** The net with a marking: one element {@code <svg>} with its own style. */
    public static String write(PetriNet net, Marking marking) {
        return write(net, marking, "<style>" + STYLE + "</style>\n");
    }

    /**
     * The net with a marking, without the style: for a page that has {@link #style} once.
     *
     * <p>A view can change it: {@code <g class="net-place" data-place="0">} has its tokens in {@code <g
     * class="net-tokens">},
     * and {@code <g class="net-transition" data-transition="0">} has the class {@code net-enabled} while it is enabled.
     */
    public static String writeWithoutStyle(PetriNet net, Marking marking) {
        return write(net, marking, "");
    }

    /** The style of all drawings, as CSS. */
    public static String style() {
        return STYLE;
    }

    private static String style(String file) {
        try (InputStream in = NetSvg.class.getResourceAsStream(file)) {
            return new String(in.readAllBytes(), StandardCharsets.UTF_8);
        } catch (IOException e) {
            throw new UncheckedIOException(e);
        }
    }

    /** The dots of few tokens, for views that change the marking: x and y of each, by the number of tokens. */
    public static int[][] dots() {
        return Arrays.stream(DOTS).map(int[]::clone).toArray(int[][]::new);
    }

    private static String write(PetriNet net, Marking marking, String style) {
        NetSvg svg = new NetSvg();
        svg.draw(Layout.of(net), marking, style);
        return svg.out.toString();
    }

    private void draw(Layout layout, Marking marking, String style) {
        PetriNet net = layout.net;
        String width = number(Math.ceil(layout.width));
        String height = number(Math.ceil(layout.height));
        add("<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"net\" role=\"img\" width=\"", width, "\" height=\"", height,
            "\" viewBox=\"0 0 ", width, " ", height, "\" aria-label=\"", escaped("net " + net.name()), "\">\n", style);
        List<Arc> arcs = net.arcs();
        for (int a = 0; a < arcs.size(); a++) {
            arc(arcs.get(a), layout.routes[a], layout.curved);
        }
        for (Place place : net.places()) {
            place(layout, place, marking.get(place.index()));
        }
        for (Transition transition : net.transitions()) {
            transition(layout, transition, net.isEnabled(marking, transition.index()));
        }
        // Above all arcs.
        for (int a = 0; a < arcs.size(); a++) {
            weight(arcs.get(a), layout.routes[a], layout.curved);
        }
        add("</svg>\n");
    }

    private void place(Layout layout, Place place, int tokens) {
        int node = place.index();
        String limits = (place.isLimited() ? ", at most " + place.capacity() : "")
            + (place.delay() > 0 ? ", tokens wait " + Delay.seconds(place.delay()) : "");
        add("<g class=\"net-place\" data-place=\"", Integer.toString(node), "\" transform=\"translate(", number(layout.x[node]),
            " ", number(layout.y[node]), ")\"><title>", escaped(place.name() + limits), "</title><circle r=\"",
            number(Layout.RADIUS), "\"/>");
        if (place.delay() > 0) {
            add("<circle r=\"", number(Layout.RADIUS - 3), "\"/>");
        }
        add("<g class=\"net-tokens\">");
        tokens(tokens);
        add("</g>");
        name(layout, node, Layout.RADIUS, Layout.RADIUS);
        add("</g>\n");
    }

    private void tokens(int count) {
        if (count >= DOTS.length) {
            add("<text class=\"net-number\" y=\"4\">", Integer.toString(count), "</text>");
            return;
        }
        int[] at = DOTS[count];
        for (int i = 0; i < at.length; i += 2) {
            add("<circle class=\"net-dot\" r=\"3.2\" cx=\"", Integer.toString(at[i]), "\" cy=\"", Integer.toString(at[i + 1]),
                "\"/>");
        }
    }

    private void transition(Layout layout, Transition transition, boolean enabled) {
        int node = layout.net.places().size() + transition.index();
        double across = layout.halfWidth[transition.index()];
        double tall = layout.halfHeight[transition.index()];
        Delay delay = transition.delay();
        boolean timed = delay.kind() != Delay.Kind.NONE;
        String extra = switch (delay.kind()) {
            case NONE -> "";
            case FIXED -> ", after " + Delay.seconds(delay.first());
            case EXPONENTIAL -> ", after " + Delay.seconds(delay.first()) + " on average";
            case UNIFORM -> ", after " + Delay.seconds(delay.first()) + " to " + Delay.seconds(delay.second());
        } + (transition.priority() == 0 ? "" : ", priority " + transition.priority());
        add("<g class=\"net-transition", timed ? " net-timed" : "", enabled ? " net-enabled" : "", "\" data-transition=\"",
            Integer.toString(transition.index()), "\" transform=\"translate(", number(layout.x[node]), " ",
            number(layout.y[node]), ")\"><title>", escaped(transition.name() + extra), "</title>");
        rectangle("net-bar", across, tall);
        rectangle("net-frame", across + 3, tall + 3);
        name(layout, node, across, tall);
        add("</g>\n");
    }

    private void rectangle(String kind, double across, double tall) {
        add("<rect class=\"", kind, "\" x=\"", number(-across), "\" y=\"", number(-tall), "\" width=\"", number(2 * across),
            "\" height=\"", number(2 * tall), "\"/>");
    }

    private void name(Layout layout, int node, double across, double tall) {
        List<String> lines = layout.label(node);
        for (int i = 0; i < lines.size(); i++) {
            double x = layout.namesBeside ? across + 7 : 5;
            double y = 13 * i + (layout.namesBeside ? 4 - 6.5 * (lines.size() - 1) : tall + 14);
            add("<text x=\"", number(x), "\" y=\"", number(y), "\">", escaped(lines.get(i)), "</text>");
        }
    }

    private void arc(Arc arc, double[] route, boolean curved) {
        int last = route.length - 2;
        double dx = route[last] - route[last - 2];
        double dy = route[last + 1] - route[last - 1];
        double length = Math.max(1e-9, Math.hypot(dx, dy));
        double towardsX = curved ? 0 : dx / length;
        double towardsY = curved ? Math.signum(dy) : dy / length;
        boolean inhibitor = arc.kind() == ArcKind.INHIBITOR;
        double tipX = route[last];
        double tipY = route[last + 1];
        double[] points = route.clone();
        double back = inhibitor ? 2 * RING : HEAD - 1;
        points[last] -= back * towardsX;
        points[last + 1] -= back * towardsY;
        if (arc.kind() == ArcKind.OUTPUT) {
            // The gap is for heads and rings at a frame; a line begins at the transition itself.
            double startX = curved ? 0 : points[2] - points[0];
            double startY = points[3] - points[1];
            double first = Math.max(1e-9, Math.hypot(startX, startY));
            points[0] -= Layout.FRAME * startX / first;
            points[1] -= Layout.FRAME * startY / first;
        }
        add("<path class=\"net-arc", arc.kind() == ArcKind.TEST ? " net-test" : "", "\" d=\"M", number(points[0]), " ",
            number(points[1]));
        for (int i = 2; i < points.length; i += 2) {
            double half = (points[i - 1] + points[i + 1]) / 2;
            if (curved && Math.abs(points[i] - points[i - 2]) > 0.4) {
                add("C", number(points[i - 2]), " ", number(half), " ", number(points[i]), " ", number(half), " ",
                    number(points[i]), " ", number(points[i + 1]));
            } else {
                add("L", number(points[i]), " ", number(points[i + 1]));
            }
        }
        add("\"/>");
        if (inhibitor) {
            add("<circle class=\"net-ring\" r=\"", number(RING), "\" cx=\"", number(tipX - RING * towardsX), "\" cy=\"",
                number(tipY - RING * towardsY), "\"/>\n");
        } else {
            double baseX = tipX - HEAD * towardsX;
            double baseY = tipY - HEAD * towardsY;
            add("<path class=\"net-head\" d=\"M", number(tipX), " ", number(tipY), "L", number(baseX - 3.5 * towardsY), " ",
                number(baseY + 3.5 * towardsX), "L", number(baseX + 3.5 * towardsY), " ", number(baseY - 3.5 * towardsX),
                "Z\"/>\n");
        }
    }

    /** Places the weight beside the middle of the arc, or above it if the arc can be level. */
    private void weight(Arc arc, double[] route, boolean curved) {
        if (arc.weight() > 1) {
            int i = route.length / 4 * 2;
            add("<text x=\"", number((route[i - 2] + route[i]) / 2 + 5), "\" y=\"",
                number((route[i - 1] + route[i + 1]) / 2 + (curved ? 4 : -5)), "\">", Integer.toString(arc.weight()), "</text>\n");
        }
    }

    private void add(String... parts) {
        Arrays.stream(parts).forEach(out::append);
    }

    /** The number with at most one decimal. */
    private static String number(double value) {
        long tenths = Math.round(value * 10);
        String sign = tenths < 0 ? "-" : "";
        long size = Math.abs(tenths);
        return sign + size / 10 + (size % 10 == 0 ? "" : "." + size % 10);
    }

    /** The text escaped for elements and for attributes in double quotes. */
    static String escaped(String text) {
        return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace("\"", "&quot;");
    }
}
