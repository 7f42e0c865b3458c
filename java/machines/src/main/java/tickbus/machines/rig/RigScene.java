package tickbus.machines.rig;

import java.util.ArrayList;
import java.util.Comparator;
import java.util.List;
import java.util.Locale;
import tickbus.simulator.text.Svg;

/**
 * The machine in a picture.
 *
 * <p>Points are given in the rig's millimetres: to the right, towards the viewer, and height. Index wheel 1 has its
 * infeed in front, lift 1 at its right, the outfeed behind; the chamber wheel reaches from lift 1 to lift 2.
 */
final class RigScene {
    private static final double ORIGIN_X = 262;
    private static final double ORIGIN_Y = 566;
    private static final double ACROSS = 1.28;
    private static final double NEAR = 0.42;
    private static final double UP = 1.06;

    private static final double RADIUS1 = 118;
    private static final double RADIUS2 = 118;
    private static final double RIM = 30;
    private static final double MIDDLE2 = RADIUS1 + RADIUS2;
    private static final double LIFT1 = RADIUS1;
    private static final double LIFT2 = MIDDLE2 + RADIUS2;
    private static final double GROUND = -112;
    /** Above everything that a lift carries. */
    private static final double TOP = Geometry.LAMP_FLOOR + Geometry.BOTTLE_HEIGHT + 20;
    private static final double LAMP = Geometry.LAMP_FLOOR + Geometry.BOTTLE_HEIGHT + 26;

    private static final String STEEL = "fill=\"url(#steel)\" stroke=\"#6d7f8f\"";
    private static final String PLATE = "fill=\"#e3e9ee\" stroke=\"#6d7f8f\" stroke-width=\"1.2\"";
    private static final String MOTOR = "fill=\"url(#motor)\" stroke=\"#26333d\"";
    private static final String HOLE = "fill=\"#93a3b0\" stroke=\"#62727f\"";
    private static final String LABEL = "font-size=\"13.5\" fill=\"#4a5b6b\"";
    private static final String CENTRED = " text-anchor=\"middle\"";
    private static final String ENDING = " text-anchor=\"end\"";

    private final Rig rig;
    private final Svg svg;
    private final List<Bottle> bottles;

    /** An object that hides the objects behind it. */
    private record Thing(double near, Runnable paint) {}

    RigScene(Rig rig, Svg svg) {
        this.rig = rig;
        this.svg = svg;
        this.bottles = rig.bottles();
    }

    void draw() {
        undercarriage();
        belt(-RADIUS1 - RIM + 4, -RADIUS1 - RIM - 118);
        wheel1();
        wheel2();
        lamp();
        beam(Lift.LA1, LIFT1, Geometry.BEAM1);
        beam(Lift.LA2, LIFT2, Geometry.BEAM2);
        signs();
    }

    /** The motors and shafts on the ground, behind and below the wheels. */
    private void undercarriage() {
        shadow(0, 62);
        shadow(LIFT1, 34);
        shadow(MIDDLE2, 62);
        shadow(LIFT2, 34);
        cylinder(0, 0, -14, GROUND, 26, MOTOR, MOTOR);
        cylinder(LIFT1, 0, -14, GROUND, 14, MOTOR, MOTOR);
        cylinder(MIDDLE2, 0, 10, GROUND, 26, MOTOR, MOTOR);
        cylinder(MIDDLE2, 0, Geometry.SLEEVE_FLOOR - 12, 10, 7, STEEL, STEEL);
        cylinder(LIFT2, 0, 130, GROUND, 14, MOTOR, MOTOR);
        within("under", LIFT2, 130, Geometry.SLEEVE_FLOOR - 6, () -> moved(Lift.LA2, () -> rod(Lift.LA2, LIFT2)));
    }

    private void wheel1() {
        cylinder(0, 0, -3, -13, RADIUS1 + RIM, STEEL, PLATE);
        List<Thing> things = new ArrayList<>();
        for (int i = 0; i < 4; i++) {
            double angle = Math.toRadians(rig.wheel1Angle() + 90 * i);
            double across = RADIUS1 * Math.sin(angle);
            double near = RADIUS1 * Math.cos(angle);
            bottleIn(Bottle.Place.POCKET, i, across, near, things);
        }
        wheel(0, -3, "IM1 index", -90, rig.wheel1Angle(), () -> {
            for (int i = 0; i < 4; i++) {
                svg.line("<circle cx=\"0\" cy=\"%.1f\" r=\"20\" transform=\"rotate(%d)\" %s/>", RADIUS1, -90 * i, HOLE);
            }
        });
        things.add(new Thing(0, () -> cylinder(0, 0, 12, -3, 13, STEEL, STEEL)));
        things.add(new Thing(0.1, () -> column("low1", Lift.LA1, LIFT1, -8, Geometry.SLEEVE_FLOOR - 6)));
        paint(things);
        belt(RADIUS1 + RIM + 4, RADIUS1 + RIM + 106);
    }

    /** A roller conveyor at the wheel: the infeed in front or the outfeed behind. */
    private void belt(double from, double to) {
        double half = 24;
        svg.path(String.format(Locale.ROOT, "M%.1f %.1fH%.1fV%.1fH%.1fZ",
                x(-half), y(from, -6), x(half), y(to, -6), x(-half)), "fill=\"#aab8c3\" stroke=\"#6d7f8f\"");
        double step = Math.signum(to - from) * 13;
        for (int i = 1; i * 13 < Math.abs(to - from); i++) {
            double near = from + i * step;
            svg.stroke(x(-half + 3), y(near, -6), x(half - 3), y(near, -6),
                    "stroke=\"#e9eef2\" stroke-width=\"3\" stroke-linecap=\"round\"");
        }
    }

    private void wheel2() {
        double floor = Geometry.SLEEVE_FLOOR;
        cylinder(MIDDLE2, 0, floor - 3, floor - 11, RADIUS2 + RIM, STEEL, PLATE);
        List<Thing> things = new ArrayList<>();
        for (int i = 0; i < 2; i++) {
            double angle = Math.toRadians(rig.wheel2Angle() + 180 * i);
            double across = MIDDLE2 - RADIUS2 * Math.cos(angle);
            double near = RADIUS2 * Math.sin(angle);
            bottleIn(Bottle.Place.SLEEVE, i, across, near, things);
            int number = i;
            things.add(new Thing(near + 2, () -> wheel(MIDDLE2, floor - 3, "IM2 index", -180, rig.wheel2Angle(),
                    () -> sleeve(180 * number))));
        }
        wheel(MIDDLE2, floor - 3, "IM2 index", -180, rig.wheel2Angle(), () -> {
            for (int i = 0; i < 2; i++) {
                svg.line("<circle cx=\"%.1f\" cy=\"0\" r=\"20\" transform=\"rotate(%d)\" %s/>", -RADIUS2, -180 * i, HOLE);
            }
        });
        things.add(new Thing(0, () -> cylinder(MIDDLE2, 0, floor + 14, floor - 3, 15, STEEL, STEEL)));
        things.add(new Thing(0.2, () -> column("high1", Lift.LA1, LIFT1, floor - 6, TOP)));
        things.add(new Thing(0.3, () -> column("high2", Lift.LA2, LIFT2, floor - 6, TOP)));
        paint(things);
    }

    private void bottleIn(Bottle.Place place, int slot, double across, double near, List<Thing> things) {
        for (Bottle bottle : bottles) {
            if (bottle.place() == place && bottle.slot() == slot) {
                things.add(new Thing(near + 1, () -> svg.group(Svg.STILL, () -> bottle(bottle, across, near))));
            }
        }
    }

    private static void paint(List<Thing> things) {
        things.sort(Comparator.comparingDouble(Thing::near));
        things.forEach(thing -> thing.paint().run());
    }

    /** The part of a lift between two heights: rod, cup, and the bottle that it carries. */
    private void column(String id, Lift lift, double across, double from, double to) {
        within(id, across, from, to, () -> moved(lift, () -> {
            rod(lift, across);
            cup(lift, x(across), y(0, rig.cupHeight(lift)));
            carried(lift, across);
        }));
    }

    /** Draws the visible part of something between two heights: the wheel that it passes hides the rest. */
    private void within(String id, double across, double from, double to, Runnable inside) {
        svg.line("<clipPath id=\"%s\"><rect x=\"%.1f\" y=\"%.1f\" width=\"120\" height=\"%.1f\"/></clipPath>",
                id, x(across) - 60, y(0, to), (to - from) * UP);
        svg.group("clip-path=\"url(#" + id + ")\"", inside);
    }

    /** Draws something that goes up and down with a lift. */
    private void moved(Lift lift, Runnable inside) {
        svg.group(Svg.bound("y", "%s position: %.2f + %.4f", lift, -UP, rig.position(lift) * UP), inside);
    }

    /** Draws something that turns with a wheel, in the wheel's own plane; each command turns it by {@code degrees}. */
    private void wheel(double across, double height, String command, int degrees, double angle, Runnable inside) {
        svg.line("<g transform=\"translate(%.1f %.1f) scale(%.2f %.2f)\">", x(across), y(0, height), ACROSS, NEAR);
        svg.group(turn(command, degrees) + String.format(Locale.ROOT, " transform=\"rotate(%.1f)\"", -angle), inside);
        svg.line("</g>");
    }

    private static String turn(String command, int degrees) {
        return Svg.bound("turn", "%s.edges: %d", command, degrees) + Svg.bound("pivot", "0 0") + Svg.bound("smooth", "1");
    }

    private void carried(Lift lift, double across) {
        boolean first = lift == Lift.LA1;
        Bottle carried = bottles.stream()
                .filter(bottle -> bottle.place() == (first ? Bottle.Place.CUP1 : Bottle.Place.CUP2)
                        || bottle.place() == (first ? Bottle.Place.STUCK1 : Bottle.Place.STUCK2))
                .findFirst().orElse(null);
        svg.group((carried == null ? "display=\"none\"" : "") + Svg.bound("show", first ? "SC1" : "SC2"), () -> {
            if (carried == null) {
                glass(x(across), y(0, rig.cupHeight(lift)), "fresh", false);
            } else {
                bottle(carried, across, 0);
            }
        });
    }

    private void cup(Lift lift, double px, double py) {
        if (rig.position(lift) <= Geometry.REACH && !rig.homed(lift == Lift.LA1 ? 1 : 2)) {
            return;
        }
        String look = "fill=\"" + (rig.vacuum(lift) ? "#e8862e" : "#3b4a57") + "\" stroke=\"#26333d\""
                + Svg.bound("fill", "SC%d: off -> #3b4a57, on -> #e8862e", lift.ordinal() + 1);
        svg.path(String.format(Locale.ROOT, "M%.1f %.1fL%.1f %.1fH%.1fL%.1f %.1fZ",
                px - 15, py, px - 7, py + 9, px + 7, px + 15, py), look);
        svg.ellipse(px, py, 15, 15 * NEAR / ACROSS, look);
    }

    /** The rod of a lift, from its cup down into the ground; the caller decides which part is visible. */
    private void rod(Lift lift, double across) {
        double top = rig.cupHeight(lift) - 5;
        svg.rect(x(across) - 4.5, y(0, top), 9, (top - GROUND + Geometry.STROKE) * UP, 0, STEEL);
    }

    private void bottle(Bottle bottle, double across, double near) {
        double px = x(across);
        double base = y(near, bottle.height());
        double middle = base - Geometry.BOTTLE_HEIGHT * UP * 0.36;
        boolean stuck = bottle.place() == Bottle.Place.STUCK1 || bottle.place() == Bottle.Place.STUCK2;
        glass(px, base, bottle.treated() ? "treated" : "fresh", stuck);
        svg.group(Svg.STILL, () -> {
            svg.ellipse(px, middle, 11.5, 11.5, "fill=\"#ffffff\" fill-opacity=\"0.92\"");
            svg.text(px, middle + 4.5, "font-size=\"12.5\" font-weight=\"700\" fill=\"#22313f\"" + CENTRED,
                    Integer.toString(bottle.id()));
        });
    }

    private void glass(double px, double base, String paint, boolean stuck) {
        double tall = Geometry.BOTTLE_HEIGHT * UP;
        String edge = stuck ? "stroke=\"#d12f2f\" stroke-width=\"3\"" : "stroke=\"#1f4a66\" stroke-width=\"1\"";
        svg.path(String.format(Locale.ROOT,
                "M%.1f %.1fv%.1fq0 -9 10 -12v%.1fh14v%.1fq10 3 10 12v%.1fa17 5.6 0 0 1 -34 0Z",
                px - 17, base, -(tall - 25), -9.0, 9.0, tall - 25), "fill=\"url(#" + paint + ")\" " + edge);
        svg.rect(px - 8, base - tall - 1, 16, 6, 2, "fill=\"#f4f6f8\" stroke=\"#52636f\"");
    }

    /** A sleeve at an angle of its wheel: it turns with the wheel, and stays upright. */
    private void sleeve(int angle) {
        double around = Math.toRadians(angle);
        double upright = rig.wheel2Angle();
        svg.line("<g transform=\"translate(%.1f %.1f)\">", -RADIUS2 * Math.cos(around), RADIUS2 * Math.sin(around));
        svg.line("<g transform=\"rotate(%.1f)\"%s>", upright, turn("IM2 index", 180));
        svg.line("<g transform=\"scale(%.4f %.4f)\">", 1 / ACROSS, 1 / NEAR);
        String look = "fill=\"url(#glass)\" fill-opacity=\"0.38\" stroke=\"#5f8299\" stroke-width=\"1.3\"";
        double top = -49 * UP;
        svg.path(String.format(Locale.ROOT, "M-22 %.1fV0a22 7 0 0 0 44 0V%.1fa22 7 0 0 1 -44 0Z", top, top), look);
        svg.ellipse(0, top, 22, 7, "fill=\"none\" stroke=\"#5f8299\" stroke-width=\"1.3\"");
        svg.line("</g></g></g>");
    }

    private void lamp() {
        double px = x(LIFT2);
        double py = y(0, LAMP);
        svg.ellipse(px, py + 12, 118, 100, "fill=\"url(#glow)\"" + (rig.lamp() ? "" : " display=\"none\"")
                + Svg.bound("show", "Lamp"));
        svg.path(String.format(Locale.ROOT, "M%.1f %.1fH%.1fl14 30h-88Z", px - 30, py - 26, px + 30),
                "fill=\"#3b4a57\" stroke=\"#26333d\"");
        svg.ellipse(px, py + 5, 25, 11, (rig.lamp()
                ? "fill=\"#fff6c4\" stroke=\"#e0a500\" stroke-width=\"2\""
                : "fill=\"#a9b5be\" stroke=\"#66757f\" stroke-width=\"2\"")
                + Svg.bound("fill", "Lamp: off -> #a9b5be, on -> #fff6c4")
                + Svg.bound("stroke", "Lamp: off -> #66757f, on -> #e0a500"));
        svg.rect(px - 4, 0, 8, py - 26, 0, STEEL);
        svg.text(px + 54, py - 8, LABEL + Svg.bound("text", "Lamp: 0 -> lamp off, 1 -> lamp on"),
                rig.lamp() ? "lamp on" : "lamp off");
    }

    /** A package sensor: the beam ends at a bottle that blocks it. */
    private void beam(Lift lift, double across, double height) {
        double px = x(across);
        double py = y(0, height);
        boolean blocked = rig.beamBlocked(lift);
        svg.rect(px - 66, py - 7, 13, 14, 3, "fill=\"#3b4a57\"");
        svg.rect(px + 53, py - 7, 13, 14, 3, "fill=\"#3b4a57\"");
        String signal = "Package sensor " + (lift.ordinal() + 1);
        svg.ellipse(px + 59.5, py, 3.6, 3.6, (blocked ? "fill=\"#ff5d4d\"" : "fill=\"#58d68d\"")
                + Svg.bound("fill", signal + ": off -> #58d68d, on -> #ff5d4d"));
        ray(px - 17, px, py, blocked, Svg.bound("show", signal));
        ray(px + 53, px, py, !blocked, Svg.bound("hide", signal));
        if (!blocked && rig.cupHeight(lift) > height) {
            svg.group(Svg.STILL, () -> svg.rect(px - 4.5, py - 2, 9, 4, 0, "fill=\"#d5dde4\""));
        }
        String name = "package " + (lift.ordinal() + 1);
        String words = name + (blocked ? " blocked" : "");
        String look = LABEL + Svg.bound("text", "%s: 0 -> %s, 1 -> %s blocked", signal, name, name);
        if (lift == Lift.LA1) {
            svg.text(px - 73, py + 5, look + ENDING, words);
        } else {
            svg.text(px + 73, py + 5, look, words);
        }
    }

    private void ray(double end, double px, double py, boolean shown, String when) {
        svg.stroke(px - 53, py, end, py, "stroke=\"#e23b2e\" stroke-width=\"2\" stroke-opacity=\"0.85\""
                + (shown ? "" : " display=\"none\"") + when);
    }

    private void signs() {
        double left = x(-RADIUS1 - RIM);
        sensor(1, left - 14, y(0, -8));
        svg.text(24, y(0, -8) - 30, LABEL, "homing 1");
        svg.text(24, y(0, -8) + 74, LABEL + Svg.STILL, String.format(Locale.ROOT, "index wheel 1 at %.0f°", rig.wheel1Angle()));
        double right = x(MIDDLE2 + RADIUS2 + RIM);
        sensor(2, right + 14, y(0, Geometry.SLEEVE_FLOOR - 7));
        svg.text(right + 30, y(0, Geometry.SLEEVE_FLOOR - 7) + 5, LABEL, "homing 2");
        svg.text(right + 5, y(0, Geometry.SLEEVE_FLOOR - 7) - 24, LABEL + Svg.STILL,
                String.format(Locale.ROOT, "chamber wheel at %.0f°", rig.wheel2Angle()));
        svg.text(x(30), y(RADIUS1 + RIM + 78, -6), LABEL, "infeed");
        svg.text(x(-31), y(-RADIUS1 - RIM - 78, -6), LABEL + ENDING, "outfeed");
        lift(Lift.LA1, x(LIFT1) + 25, y(0, 66));
        lift(Lift.LA2, x(LIFT2) + 27, y(0, 66));
    }

    private void lift(Lift lift, double px, double py) {
        int number = lift.ordinal() + 1;
        svg.text(px, py, LABEL + Svg.bound("text", "%s position: lift %d at {0} mm", lift, number),
                String.format(Locale.ROOT, "lift %d at %.0f mm", number, rig.position(lift)));
        svg.text(px, py + 18, LABEL + Svg.bound("text", "SC%1$d: 0 -> SC%1$d off, 1 -> SC%1$d on", number),
                "SC" + number + (rig.vacuum(lift) ? " on" : " off"));
    }

    private void sensor(int wheel, double px, double py) {
        svg.rect(px - 9, py - 8, 18, 16, 4, "fill=\"#3b4a57\"");
        svg.ellipse(px, py, 4, 4, (rig.homed(wheel) ? "fill=\"#58d68d\"" : "fill=\"#7c8b97\"")
                + Svg.bound("fill", "Homing sensor %d: off -> #7c8b97, on -> #58d68d", wheel));
    }

    private void shadow(double across, double half) {
        svg.ellipse(x(across), y(0, GROUND) + 3, half * ACROSS, half * NEAR, "fill=\"#22313f\" fill-opacity=\"0.13\"");
    }

    private void cylinder(
            double across, double near, double top, double bottom, double radius, String side, String lid) {
        svg.cylinder(x(across), y(near, top), y(near, bottom), radius * ACROSS, radius * NEAR, side, lid);
    }

    private static double x(double across) {
        return ORIGIN_X + across * ACROSS;
    }

    private static double y(double near, double height) {
        return ORIGIN_Y + near * NEAR - height * UP;
    }
}
