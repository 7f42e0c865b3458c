package tickbus.machines.rig;

import java.io.PrintStream;
import java.util.ArrayList;
import java.util.List;
import java.util.Locale;
import tickbus.machines.demo.Plc;
import tickbus.machines.demo.Screen;
import tickbus.machines.demo.Timeline;
import tickbus.simulator.TimeSource;
import tickbus.simulator.text.Durations;

/** A few lines on a terminal, redrawn in place some times a second. */
final class TerminalDisplay implements Display {

    /** The approximate duration of a step, for the progress bar. */
    private static final double STEP_NANOS = 0.8e9;

    private final Screen screen;
    private final int cycles;
    private Watcher watcher;
    private Operator operator;
    private Plc plc;

    TerminalDisplay(PrintStream out, TimeSource time, int cycles) {
        screen = new Screen(out, time);
        this.cycles = cycles;
    }

    @Override
    public void event(Timeline.Event event) {
        screen.event(event.line());
    }

    @Override
    public void tick(Watcher watcher, Operator operator, Plc plc) {
        this.watcher = watcher;
        this.operator = operator;
        this.plc = plc;
        if (screen.due()) {
            screen.draw(lines());
        }
    }

    @Override
    public void end() {
        if (watcher != null) {
            screen.draw(lines());
        }
        screen.flush();
    }

    private List<String> lines() {
        Rig rig = watcher.rig();
        List<String> lines = new ArrayList<>();
        lines.add("tickbus demo " + Durations.seconds(watcher.simulator().simulationNanos()) + " s   "
                + operator.stage());
        lines.add(text("phase   %-10s step %d  %s", watcher.phaseName(), watcher.step(), watcher.stepName()));
        lines.add(text("cycle   %d of %d     %s", Math.min(watcher.cycles() + 1, cycles), cycles, Screen.bar(progress())));
        for (Lift lift : Lift.values()) {
            lines.add(text("%s     %s %6.1f mm  beam %s  cup %s", lift, Screen.bar(rig.position(lift) / Geometry.STROKE),
                    rig.position(lift), rig.beamBlocked(lift) ? "dark" : "free", cup(rig, lift)));
        }
        lines.add("lamp    " + (rig.lamp() ? "ON " : "off") + "   wheel 1 " + (rig.homed(1) ? "at index" : "between ")
                + "   wheel 2 " + (rig.homed(2) ? "at index" : "between ") + (rig.notOk() ? "   NOT OK" : ""));
        lines.add("panel   " + light("Ready", watcher.readyLamp()) + light("Running", watcher.runningLamp())
                + light("Fault", watcher.faultLamp()) + light("Parked", watcher.parkedLamp()));
        lines.add("PLC     " + plc());
        lines.add("link    " + watcher.link());
        lines.add(text("data    %-9s age %s   ticks %d, stale %d, late %d", watcher.statusName(), age(),
                watcher.simulator().ticks(), watcher.staleTicksAtStart() + watcher.staleTicksInOutage(),
                watcher.simulator().lateTicks()));
        return lines;
    }

    private static String cup(Rig rig, Lift lift) {
        Bottle.Place cup = lift == Lift.LA1 ? Bottle.Place.CUP1 : Bottle.Place.CUP2;
        return (rig.vacuum(lift) ? "on " : "off") + rig.bottles().stream().filter(bottle -> bottle.place() == cup)
                .map(bottle -> ", holds bottle " + bottle.id()).findFirst().orElse("");
    }

    private String plc() {
        Outage outage = operator.outage();
        if (watcher.away()) {
            return plc.name() + (operator.restarts() == 0 ? " KILLED, dead for " : " started again, away for ")
                    + seconds(outage.lastedNanos());
        }
        return plc.name() + (outage == null ? "" : ", back after an outage of " + seconds(outage.lastedNanos()));
    }

    private static String seconds(long nanos) {
        return text("%.1f s", nanos / 1e9);
    }

    private String age() {
        double seconds = watcher.ageSeconds();
        return seconds < 1 ? text("%.1f ms", seconds * 1e3) : seconds < 1e6 ? text("%.1f s", seconds) : "none";
    }

    private double progress() {
        if (operator.done() || watcher.cycles() >= cycles) {
            return 1;
        }
        int step = watcher.step();
        return step == 0 ? 0 : (step - 1 + Math.min(1, watcher.stepNanos() / STEP_NANOS)) / 6;
    }

    private static String text(String format, Object... values) {
        return String.format(Locale.ROOT, format, values);
    }

    private static String light(String name, boolean on) {
        return (on ? "(" + name.toUpperCase(Locale.ROOT) + ")" : " " + name.toLowerCase(Locale.ROOT) + " ") + "  ";
    }
}
