package tickbus.simulator.demo;

import java.io.PrintStream;
import java.util.ArrayDeque;
import java.util.ArrayList;
import java.util.Deque;
import java.util.List;
import java.util.Locale;
import tickbus.simulator.TimeSource;
import tickbus.simulator.rig.Bottle;
import tickbus.simulator.rig.Geometry;
import tickbus.simulator.rig.Lift;
import tickbus.simulator.rig.Rig;
import tickbus.simulator.text.Durations;

/** A few lines on a terminal, redrawn in place some times a second. */
final class TerminalDisplay implements Display {
    private static final long REDRAW_NANOS = 200_000_000L;
    private static final int SHOWN_EVENTS = 6;
    private static final int BAR = 24;
    private static final int WIDTH = 79;

    /** What a step takes, roughly; only for the bar. */
    private static final double STEP_NANOS = 0.8e9;

    private final PrintStream out;
    private final TimeSource time;
    private final int cycles;
    private final Deque<String> events = new ArrayDeque<>();
    private long nextDraw;
    private int drawn;
    private Watcher watcher;
    private Operator operator;
    private Plc plc;

    TerminalDisplay(PrintStream out, TimeSource time, int cycles) {
        this.out = out;
        this.time = time;
        this.cycles = cycles;
        nextDraw = time.nanoTime();
    }

    /** Whether standard output is a terminal that can be redrawn. */
    static boolean fits() {
        String term = System.getenv("TERM");
        if (System.console() == null || term == null || term.equals("dumb") || System.getenv("CI") != null) {
            return false;
        }
        try {
            // From JDK 22 on there is a console even where there is no terminal, and this method to ask it.
            return (Boolean) java.io.Console.class.getMethod("isTerminal").invoke(System.console());
        } catch (ReflectiveOperationException e) {
            return true;
        }
    }

    @Override
    public void event(Timeline.Event event) {
        events.add(event.line());
        if (events.size() > SHOWN_EVENTS) {
            events.remove();
        }
    }

    @Override
    public void tick(Watcher watcher, Operator operator, Plc plc) {
        this.watcher = watcher;
        this.operator = operator;
        this.plc = plc;
        long now = time.nanoTime();
        if (now - nextDraw >= 0) {
            nextDraw = now + REDRAW_NANOS;
            draw();
        }
    }

    @Override
    public void end() {
        if (watcher != null) {
            draw();
        }
        out.flush();
    }

    private void draw() {
        StringBuilder text = new StringBuilder();
        if (drawn > 0) {
            text.append("\u001b[").append(drawn).append('A');
        }
        List<String> lines = lines();
        for (String line : lines) {
            text.append(line, 0, Math.min(line.length(), WIDTH)).append("\u001b[K\n");
        }
        drawn = lines.size();
        out.print(text);
        out.flush();
    }

    private List<String> lines() {
        Rig rig = watcher.rig();
        List<String> lines = new ArrayList<>();
        lines.add("tickbus demo " + Durations.seconds(watcher.simulator().simulationNanos()) + " s   "
                + operator.stage());
        lines.add(text("phase   %-10s step %d  %s", watcher.phaseName(), watcher.step(), watcher.stepName()));
        lines.add(text("cycle   %d of %d     %s", Math.min(watcher.cycles() + 1, cycles), cycles, bar(progress())));
        for (Lift lift : Lift.values()) {
            lines.add(text("%s     %s %6.1f mm  beam %s  cup %s", lift, bar(rig.position(lift) / Geometry.STROKE),
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
        lines.add("");
        lines.addAll(events);
        while (lines.size() < drawn) {
            lines.add("");
        }
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

    private static String bar(double part) {
        int full = (int) Math.round(Math.max(0, Math.min(1, part)) * BAR);
        return "[" + "#".repeat(full) + ".".repeat(BAR - full) + "]";
    }
}
