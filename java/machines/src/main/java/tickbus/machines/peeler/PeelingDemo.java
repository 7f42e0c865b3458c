package tickbus.machines.peeler;

import controlinterface.ControlInterfaceDeviceDriver;
import java.io.IOException;
import java.io.PrintStream;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.EnumMap;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import tickbus.machines.demo.DemoFailure;
import tickbus.machines.demo.DemoRun;
import tickbus.machines.demo.HtmlPage;
import tickbus.machines.demo.Screen;
import tickbus.machines.demo.Stalls;
import tickbus.machines.demo.Timeline;
import tickbus.machines.demo.Verdict;
import tickbus.simulator.DeviceDriverFolder;
import tickbus.simulator.ShutdownGuard;
import tickbus.simulator.Simulator;
import tickbus.simulator.TickMode;
import tickbus.simulator.TimeSource;
import tickbus.simulator.text.Durations;

/**
 * The demo's command line; {@code --help} describes it.
 *
 * <p>The last line on standard output is the verdict, {@code demo-peeler: ok …} or {@code demo-peeler: failed reason=…}.
 * Exit codes: 0 ok, 1 failed, 2 the command line was wrong, 130 interrupted.
 */
public final class PeelingDemo {
    private static final Verdict VERDICT = new Verdict("demo-peeler");

    /** The position of the knife at which the picture of a block that is not round is most instructive. */
    private static final double PICTURE_MM = 138;

    /** Need not be written: the driver acknowledges automatically, and without a jerk there are no S-curves. */
    private static final List<String> LEFT_OUT = List.of(".Acknowledge", ".Jerk");

    /** How often the PLCs are checked. */
    private static final int TICKS_PER_LOOK_AT_PLCS = 25;

    private final PeelingOptions options;
    private final PrintStream out;
    private final LineDisplay display;
    private final Timeline timeline;
    private final Peeler line = new Peeler();
    private final CommandRate rate = new CommandRate(line);
    private final Stalls stalls;
    private LineWatcher watcher;
    private String tables = "";
    private boolean pictured;

    private PeelingDemo(PeelingOptions options, PrintStream out, List<String> notes) {
        this.options = options;
        this.out = out;
        display = new LineDisplay(out, out == System.out && Screen.fits(), options.logs());
        timeline = new Timeline(display::event);
        stalls = new Stalls(TimeSource.system(), options.stepNanos());
        notes.forEach(note -> timeline.add(0, "note", note));
    }

    /**
     * Runs the demo and ends the JVM with its exit code.
     *
     * @param args the command line
     */
    public static void main(String[] args) {
        System.exit(run(args, System.out, System.err));
    }

    /**
     * Runs the demo.
     *
     * @param args the command line
     * @param out gets the events and, last, the verdict
     * @param err gets errors in the command line, and messages of unexpected exceptions
     * @return the exit code
     */
    public static int run(String[] args, PrintStream out, PrintStream err) {
        return DemoRun.start(args, PeelingOptions.USAGE, PeelingOptions::read, VERDICT, options -> run(options, out, err), out, err);
    }

    private static int run(PeelingOptions options, PrintStream out, PrintStream err) {
        // The guard is closed last, so that the verdict is printed even after Ctrl-C.
        try (ShutdownGuard guard = new ShutdownGuard()) {
            DemoRun run = new DemoRun(VERDICT);
            PeelingDemo demo;
            String verdict;
            do {
                demo = new PeelingDemo(options, out, run.notes());
                verdict = demo.play(guard, err);
            } while (!guard.triggered() && run.repeats(verdict, demo.stalls));
            verdict = run.verdict(verdict);
            out.print(demo.tables);
            String trouble = demo.pages();
            if (trouble != null && VERDICT.isOk(verdict)) {
                verdict = VERDICT.failed(trouble);
            }
            return VERDICT.end(verdict, guard, out);
        }
    }

    /** Runs everything from opening the drivers to writing the report. */
    private String play(ShutdownGuard guard, PrintStream err) {
        String verdict;
        try (Simulator simulator = new Simulator(DeviceDriverFolder.scan(options.drivers()).open(), line,
                options.control(), options.stepNanos(), TimeSource.system())) {
            verdict = verdict(simulator, guard, err);
            display.end(watcher, rate);
            verdict = report(verdict);
        } catch (RuntimeException | Error e) {
            // The drivers or the control table did not open, or the drivers did not close.
            verdict = report(VERDICT.failed(e, err));
        }
        return verdict;
    }

    private String verdict(Simulator simulator, ShutdownGuard guard, PrintStream err) {
        watcher = new LineWatcher(simulator, line, timeline);
        try (Plcs plcs = new Plcs(options, simulator.drivers())) {
            operate(simulator, plcs, guard);
            Map<Intervals.Direction, Intervals> intervals = intervals(simulator.drivers(), plcs);
            tables = PeelingReport.tables(intervals, rate);
            LineCheck.check(watcher, options.logs());
            double mean = intervals.values().stream().mapToDouble(Intervals::mean).max().orElse(0);
            return VERDICT.ok(String.format(Locale.ROOT,
                    "logs=%d veneer_m=%.1f commands_per_s=%.2f busiest_per_s=%.2f busiest_in_1s=%d mean_ms=%.2f report=%s",
                    line.wood().coreCount(), line.wood().ribbon(), rate.mean(), rate.mean(rate.busiest()),
                    rate.most(rate.busiest()), mean, options.report()));
        } catch (RuntimeException | Error e) {
            return VERDICT.failed(e, err);
        }
    }

    private void operate(Simulator simulator, Plcs plcs, ShutdownGuard guard) {
        for (String name : simulator.unconnected()) {
            if (LEFT_OUT.stream().noneMatch(name::endsWith)) {
                timeline.add(0, "note", "no row of the control table writes " + name);
            }
        }
        simulator.run(TickMode.REAL_TIME, () -> {
            boolean peeled = line.wood().coreCount() >= options.logs();
            if (guard.triggered()) {
                if (peeled) {
                    return false;
                }
                throw new DemoFailure("interrupted");
            }
            if (simulator.ticks() > 0) {
                stalls.look();
                stalls.silent(plcs.longestSilenceNanos());
                rate.look(simulator.simulationNanos());
                watcher.look();
                lookAtLinks(plcs, guard);
                // After enough blocks, Ctrl-C ends the demo, and may reach the PLCs first.
                if (!peeled && simulator.ticks() % TICKS_PER_LOOK_AT_PLCS == 0) {
                    plcs.listen(simulator.simulationNanos(), timeline);
                    Verdict.unlessInterrupted(guard, plcs::check);
                }
                display.tick(watcher, rate);
                picture();
            }
            if (line.wood().coreCount() < options.logs() && simulator.simulationNanos() >= options.timeLimitNanos()) {
                throw new DemoFailure("the time limit of " + Durations.text(options.timeLimitNanos())
                        + " of simulation time is over with " + line.wood().coreCount() + " of " + options.logs()
                        + " blocks peeled");
            }
            return options.page() || line.wood().coreCount() < options.logs();
        });
        if (line.wood().coreCount() < options.logs()) {
            throw new DemoFailure("interrupted");
        }
    }

    /**
     * Reports a link that broke because its PLC has died; ignores one that broke because the computer stalled.
     */
    private void lookAtLinks(Plcs plcs, ShutdownGuard guard) {
        if (watcher.broken() == null) {
            return;
        }
        Verdict.unlessInterrupted(guard, () -> {
            plcs.check();
            stalls.silent(watcher.silentNanos());
            throw new DemoFailure(watcher.broken());
        });
    }

    /** Draws a block that is being rounded, once. */
    private void picture() {
        boolean tells = line.blockAt(Place.LATHE) > 1 && !line.round()
                && line.position(AxisName.KNIFE_CARRIAGE) < PICTURE_MM;
        if (pictured || !tells) {
            return;
        }
        pictured = true;
        try {
            Files.createDirectories(options.report().toAbsolutePath().getParent());
            LathePicture.write(line, beside("lathe.svg"));
        } catch (IOException e) {
            throw new DemoFailure("the lathe's picture cannot be written: " + e);
        }
    }

    private static Map<Intervals.Direction, Intervals> intervals(List<ControlInterfaceDeviceDriver> drivers, Plcs plcs) {
        Map<Intervals.Direction, Intervals> intervals = new EnumMap<>(Intervals.Direction.class);
        for (Intervals.Direction direction : Intervals.Direction.values()) {
            boolean charger = direction.name().contains("CHARGER");
            Map<String, String> statistics = direction.name().startsWith("SIMULATION")
                    ? plcs.statistics(Plcs.PROGRAMS.get(charger ? 0 : 1))
                    : drivers.get(charger ? 0 : 1).statistics();
            intervals.put(direction, Intervals.of(statistics, direction));
        }
        return intervals;
    }

    private String report(String verdict) {
        try {
            Files.createDirectories(options.report().toAbsolutePath().getParent());
            if (watcher != null) {
                for (ControlInterfaceDeviceDriver driver : watcher.simulator().drivers()) {
                    HtmlPage.keepStatistics(beside(driver.name().toLowerCase(Locale.ROOT) + ".statistics.txt"),
                            driver.statistics());
                }
            }
            Files.writeString(options.report(),
                    PeelingReport.write(options, verdict, timeline, watcher, tables, rate));
            return verdict;
        } catch (IOException e) {
            return VERDICT.isOk(verdict) ? VERDICT.failed("the report cannot be written: " + e) : verdict;
        }
    }

    private Path beside(String name) {
        return options.report().resolveSibling(name);
    }

    /** Makes an HTML page for each driver's recording; returns the error, or null. */
    private String pages() {
        if (options.recordings() == null) {
            return null;
        }
        for (String program : Plcs.PROGRAMS) {
            Path recording = options.recordings().resolve(program + ".vcd");
            Path page = beside(program + ".html");
            List<String> arguments = new ArrayList<>(List.of(recording.toString(), "--out", page.toString(), "--stats",
                    beside(program + ".statistics.txt").toString(), "--text", options.report().toString()));
            String trouble = HtmlPage.make(options.plc(), arguments);
            if (trouble != null) {
                return trouble;
            }
            out.println("demo-peeler: page=" + page);
        }
        return null;
    }
}
