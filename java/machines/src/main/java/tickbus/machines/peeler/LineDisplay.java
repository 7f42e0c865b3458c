package tickbus.machines.peeler;

import java.io.PrintStream;
import java.util.ArrayList;
import java.util.List;
import java.util.Locale;
import java.util.stream.Collectors;
import tickbus.machines.demo.Screen;
import tickbus.machines.demo.Timeline;
import tickbus.simulator.TimeSource;
import tickbus.simulator.text.Durations;

/** Shows the line while it runs: on a terminal as a few lines that are redrawn, otherwise one line per event. */
final class LineDisplay {
    /** Largest distance of knife and rolls, in millimetres. */
    private static final double FARTHEST = 300;

    private static final double DM3 = 1000;

    private final PrintStream out;
    private final Screen screen;
    private final int logs;

    LineDisplay(PrintStream out, boolean terminal, int logs) {
        this.out = out;
        this.screen = terminal ? new Screen(out, TimeSource.system()) : null;
        this.logs = logs;
    }

    void event(Timeline.Event event) {
        if (screen == null) {
            out.println(event.line());
        } else {
            screen.event(event.line());
        }
    }

    void tick(LineWatcher watcher, CommandRate rate) {
        if (screen != null && screen.due()) {
            screen.draw(lines(watcher, rate));
        }
    }

    void end(LineWatcher watcher, CommandRate rate) {
        if (screen != null && watcher != null) {
            screen.draw(lines(watcher, rate));
        }
        out.flush();
    }

    private List<String> lines(LineWatcher watcher, CommandRate rate) {
        Peeler line = watcher.line();
        Wood wood = line.wood();
        List<String> lines = new ArrayList<>();
        lines.add(text("peeling line %s s   block %d of %d   %s",
                Durations.seconds(watcher.simulator().simulationNanos()),
                Math.min(wood.coreCount() + 1, logs), logs, line.shapeAt(Place.LATHE)));
        lines.add("feeder    " + place(line, Place.STEP_1) + place(line, Place.STEP_2) + place(line, Place.STEP_3)
                + place(line, Place.STEP_4) + text("  step %5.1f   linear %5.1f %s", line.position(AxisName.STEP_FEEDER),
                        line.position(AxisName.LINEAR_FEEDER), place(line, Place.LINEAR_FEEDER)));
        lines.add(text("centring  %s  x %5.1f  y %5.1f / %5.1f", place(line, Place.CENTRING),
                line.position(AxisName.CENTRING_X_LEFT), line.position(AxisName.CENTRING_Y_LEFT),
                line.position(AxisName.CENTRING_Y_RIGHT)));
        lines.add(text("transfer  %s  arm %5.1f", place(line, Place.CLAMPS), line.position(AxisName.TRANSFER_ARM)));
        lines.add(text("spindles  %s  %6.1f turns  %5.2f rev/s   surface %4.2f m/s", place(line, Place.LATHE),
                line.position(AxisName.SPINDLE_ROTATION), line.speed(AxisName.SPINDLE_ROTATION), line.surfaceSpeed()));
        double knife = line.position(AxisName.KNIFE_CARRIAGE);
        lines.add(text("knife     %s %5.1f mm  %s", Screen.bar(1 - knife / FARTHEST), knife,
                line.round() ? text("ribbon of %.1f mm", line.torque(AxisName.KNIFE_CARRIAGE)) : ""));
        double roll = line.position(AxisName.TOP_ROLL);
        lines.add(text("rolls     %s %5.1f mm  pitch %4.2f deg", Screen.bar(1 - roll / FARTHEST), roll,
                line.position(AxisName.PITCH_ANGLE)));
        lines.add(text("wood      ribbon %.1f m, %.1f dm3; torn %.1f, chipped %.1f, cores %.1f dm3", wood.ribbon(),
                DM3 * wood.veneer(), DM3 * wood.torn(), DM3 * wood.chipped(), DM3 * wood.cores()));
        if (!line.failed().isEmpty()) {
            lines.add("axes      not healthy: " + line.failed().stream().map(AxisName::label).collect(Collectors.joining(", ")));
        }
        AxisName busiest = rate.busiest();
        lines.add(text("commands  %d, busiest axis %s: %d, at most %d in a second", rate.commands(), busiest.label(),
                rate.commands(busiest), rate.most(busiest)));
        for (int i = 0; i < watcher.simulator().drivers().size(); i++) {
            lines.add(text("%-9s %s", watcher.simulator().drivers().get(i).name().toLowerCase(Locale.ROOT),
                    watcher.link(i)));
        }
        lines.add(text("ticks     %d, late %d", watcher.simulator().ticks(), watcher.simulator().lateTicks()));
        return lines;
    }

    private static String place(Peeler line, Place place) {
        int block = line.blockAt(place);
        return block == 0 ? "[  ]" : text("[%2d]", block);
    }

    private static String text(String format, Object... values) {
        return String.format(Locale.ROOT, format, values);
    }
}
