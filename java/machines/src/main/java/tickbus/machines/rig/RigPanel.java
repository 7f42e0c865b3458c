package tickbus.machines.rig;

import java.util.Locale;

/** Shows a rig in a few lines of text, for a terminal. */
public final class RigPanel {
    private static final String[] PHASES = {
        "initialise", "home", "ready", "run", "abort", "recover", "finalise", "parked",
    };
    private static final int BAR = 19;

    private RigPanel() {}

    /**
     * The name of a phase of the control.
     *
     * @param number as the control shows it on its panel
     * @return the name, or the number itself if it is unknown
     */
    public static String phase(int number) {
        return number >= 0 && number < PHASES.length ? PHASES[number] : Integer.toString(number);
    }

    /**
     * Shows a rig in one line of some hundred characters.
     *
     * @param rig the rig, between two steps
     * @return a line without its end
     */
    public static String line(Rig rig) {
        return String.format(Locale.ROOT,
                "%7.2f s  %-10s step %s  cycle %-3d LA1 %s LA2 %s  IM1 %3.0f°  IM2 %3.0f°  %s %s",
                rig.time() * 1e-9,
                phase(rig.panelPhase()),
                rig.panelStep() == 0 ? "-" : Integer.toString(rig.panelStep()),
                rig.panelCycles(),
                bar(rig, Lift.LA1),
                bar(rig, Lift.LA2),
                rig.wheel1Angle(),
                rig.wheel2Angle(),
                rig.lamp() ? "lamp" : "    ",
                rig.notOk() ? "NOT OK" : "");
    }

    /**
     * Shows a rig in several lines: the contents of {@link #line(Rig)}, the sensors, the bottles, and the causes of a
     * fault.
     *
     * @param rig the rig, between two steps
     * @return lines, each with its end
     */
    public static String lines(Rig rig) {
        StringBuilder text = new StringBuilder();
        text.append(String.format(Locale.ROOT, "%7.2f s  phase %s, step %s, cycle %d%n",
                rig.time() * 1e-9, phase(rig.panelPhase()),
                rig.panelStep() == 0 ? "-" : Integer.toString(rig.panelStep()), rig.panelCycles()));
        for (Lift lift : Lift.values()) {
            int number = lift.ordinal() + 1;
            text.append(String.format(Locale.ROOT, "  lift %d  %s %5.1f mm  SC%d %-3s  package %d %s%n",
                    number, bar(rig, lift), rig.position(lift), number, rig.vacuum(lift) ? "on" : "off",
                    number, rig.beamBlocked(lift) ? "blocked" : "free"));
        }
        text.append(String.format(Locale.ROOT, "  wheel 1 %5.1f° %-5s  wheel 2 %5.1f° %-5s  lamp %s%n",
                rig.wheel1Angle(), rig.homed(1) ? "home" : "", rig.wheel2Angle(), rig.homed(2) ? "home" : "",
                rig.lamp() ? "on" : "off"));
        text.append("  bottles");
        for (Bottle bottle : rig.bottles()) {
            text.append(' ').append(bottle.id()).append(bottle.treated() ? "*" : "").append('@')
                    .append(where(bottle));
        }
        text.append(System.lineSeparator());
        for (String fault : rig.faults()) {
            text.append("  NOT OK: ").append(fault).append(System.lineSeparator());
        }
        return text.toString();
    }

    /** A lift's stroke as a bar, filled up to the cup's position. */
    private static String bar(Rig rig, Lift lift) {
        int filled = (int) Math.round(rig.position(lift) / Geometry.STROKE * BAR);
        boolean carries = rig.bottles().stream().anyMatch(b -> carriedBy(b, lift));
        return "[" + "=".repeat(filled) + (carries ? "O" : rig.vacuum(lift) ? "o" : "|")
                + " ".repeat(BAR - filled) + "]";
    }

    private static boolean carriedBy(Bottle bottle, Lift lift) {
        return switch (bottle.place()) {
            case CUP1, STUCK1 -> lift == Lift.LA1;
            case CUP2, STUCK2 -> lift == Lift.LA2;
            default -> false;
        };
    }

    private static String where(Bottle bottle) {
        return switch (bottle.place()) {
            case AWAY -> "away";
            case POCKET -> "pocket" + bottle.slot();
            case SLEEVE -> "sleeve" + bottle.slot();
            case CUP1 -> "SC1";
            case CUP2 -> "SC2";
            case STUCK1 -> "stuck1";
            case STUCK2 -> "stuck2";
        };
    }
}
