package tickbus.simulator.demo;

import controlinterface.ControlInterfaceDeviceDriver;
import java.io.IOException;
import java.io.PrintStream;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import tickbus.simulator.Arguments;
import tickbus.simulator.DeviceDriverFolder;
import tickbus.simulator.DriverSet;
import tickbus.simulator.ShutdownGuard;
import tickbus.simulator.Simulator;
import tickbus.simulator.TimeSource;
import tickbus.simulator.rig.Counters;
import tickbus.simulator.rig.Rig;
import tickbus.simulator.rig.RigPicture;
import tickbus.simulator.text.Durations;

/**
 * The demo's command line; see {@code --help} for what it takes.
 *
 * <p>Its last line on standard output is the verdict, {@code demo: ok …} or {@code demo: failed reason=…}.
 * Exit codes: 0 ok, 1 failed, 2 the command line was wrong, 130 interrupted.
 */
public final class Demo {
    private static final int OK = 0;
    private static final int FAILED = 1;
    private static final int USAGE = 2;
    private static final int INTERRUPTED = 130;

    /** Step and time in it at which the rig's picture tells most: both lifts up, the lamp on. */
    private static final int PICTURE_STEP = 5;

    private static final long PICTURE_NANOS = 400_000_000L;

    private final DemoOptions options;
    private final Display display;
    private final Timeline timeline;
    private final Rig rig = new Rig();
    private Watcher watcher;
    private List<EdgeAudit.Line> edges = List.of();
    private boolean pictured;

    private Demo(DemoOptions options, Display display) {
        this.options = options;
        this.display = display;
        timeline = new Timeline(display::event);
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
     * @param out gets the steps and, last, the verdict
     * @param err gets complaints about the command line, and what unexpected exceptions say
     * @return the exit code
     */
    public static int run(String[] args, PrintStream out, PrintStream err) {
        if (List.of(args).contains("--help")) {
            out.print(DemoOptions.USAGE);
            return OK;
        }
        DemoOptions options;
        try {
            options = DemoOptions.read(args);
        } catch (Arguments.UsageException e) {
            err.println(e.getMessage() + "\n");
            err.print(DemoOptions.USAGE);
            out.println(failed(e.getMessage()));
            return USAGE;
        }
        Path folder = options.drivers();
        return run(options, () -> DeviceDriverFolder.scan(folder).open(), out, err);
    }

    /** Where drivers come from. */
    @FunctionalInterface
    interface Opener {
        DriverSet open();
    }

    static int run(DemoOptions options, Opener opener, PrintStream out, PrintStream err) {
        Display display = out == System.out && TerminalDisplay.fits()
                ? new TerminalDisplay(out, TimeSource.system(), options.cycles())
                : new LogDisplay(out);
        return run(options, opener, display, out, err);
    }

    static int run(DemoOptions options, Opener opener, Display display, PrintStream out, PrintStream err) {
        // The guard is closed last, so that after Ctrl-C the verdict is still printed.
        try (ShutdownGuard guard = new ShutdownGuard()) {
            String verdict = new Demo(options, display).play(opener, guard, err);
            out.println(verdict);
            out.flush();
            return guard.triggered() ? INTERRUPTED : verdict.startsWith("demo: ok ") ? OK : FAILED;
        }
    }

    /** Everything from opening the drivers to writing the report. */
    private String play(Opener opener, ShutdownGuard guard, PrintStream err) {
        String verdict;
        try (Simulator simulator = new Simulator(opener.open(), rig, options.control(), options.stepNanos(),
                TimeSource.system())) {
            verdict = verdict(simulator, guard, err);
            display.end();
            verdict = report(verdict);
        } catch (RuntimeException | Error e) {
            // The drivers or the control table did not open, or the drivers did not close.
            verdict = report(failure(e, err));
        }
        return verdict;
    }

    private String verdict(Simulator simulator, ShutdownGuard guard, PrintStream err) {
        try {
            operate(simulator, guard);
            return check(simulator);
        } catch (RuntimeException | Error e) {
            return failure(e, err);
        }
    }

    private void operate(Simulator simulator, ShutdownGuard guard) {
        if (simulator.drivers().size() != 1) {
            throw new DemoFailure("the driver folder has " + simulator.drivers().size()
                    + " .cfg files; the demo takes exactly one");
        }
        ControlInterfaceDeviceDriver driver = simulator.drivers().get(0);
        for (String name : simulator.unconnected()) {
            timeline.add(0, "note", "no row of the control table writes " + name);
        }
        watcher = new Watcher(simulator, rig, driver.id(), timeline);
        EdgeAudit audit = new EdgeAudit(simulator, driver);
        StatisticsPeer peer = new StatisticsPeer(driver);
        Operator operator = new Operator(options, watcher, timeline, audit, peer);
        simulator.run(options.mode(), () -> {
            if (guard.triggered()) {
                throw new DemoFailure("interrupted");
            }
            if (simulator.ticks() > 0) {
                audit.look();
                watcher.look();
                operator.act();
                display.tick(watcher, operator);
                picture();
            }
            if (!operator.done() && simulator.simulationNanos() >= options.timeLimitNanos()) {
                throw new DemoFailure("the time limit of " + Durations.text(options.timeLimitNanos())
                        + " of simulation time is over in stage " + operator.stage());
            }
            return !operator.done();
        });
        if (!operator.done()) {
            throw new DemoFailure("interrupted");
        }
        edges = audit.compare(peer);
    }

    /** The verdict on a script that was played to its end. */
    private String check(Simulator simulator) {
        Counters counters = rig.counters();
        long missed = EdgeAudit.missed(edges);
        long inRig = rig.bottles().size();
        must(watcher.cycles() == options.cycles(), "the PLC counts " + watcher.cycles() + " cycles instead of "
                + options.cycles());
        must(watcher.rigCycles() == options.cycles(), "the rig counts " + watcher.rigCycles() + " cycles instead of "
                + options.cycles());
        must(counters.jams() == 1, "there were " + counters.jams() + " jams instead of 1");
        must(counters.faults() == 1, "Not OK rose " + counters.faults() + " times instead of once");
        must(watcher.lampErrors() == 0, "the lamp differed from the motion of lift 2 " + watcher.lampErrors()
                + " times");
        must(counters.fallen() == 0, counters.fallen() + " bottles fell");
        must(counters.fed() == counters.delivered() + counters.removed() + counters.fallen() + inRig,
                "bottles unaccounted: " + counters.fed() + " fed, " + counters.delivered() + " delivered, "
                        + counters.removed() + " removed, " + inRig + " in the rig");
        must(missed == 0, "missed edges: " + missed + "; the report has them by signal");
        return "demo: ok cycles=" + watcher.cycles() + " jams=" + counters.jams() + " ticks=" + simulator.ticks()
                + " missed_edges=" + missed + " stale_ticks=" + watcher.staleTicks() + " report="
                + options.report();
    }

    private static void must(boolean fulfilled, String reason) {
        if (!fulfilled) {
            throw new DemoFailure(reason);
        }
    }

    private static String failure(Throwable e, PrintStream err) {
        boolean told = e instanceof DemoFailure || e.getMessage() != null;
        if (!(e instanceof DemoFailure)) {
            err.println(told ? e.getMessage() : e.toString());
        }
        return failed(told ? e.getMessage() : e.toString());
    }

    private static String failed(String reason) {
        String line = reason.strip().replaceAll("\\s*\\R\\s*", "; ").replace('"', '\'');
        return "demo: failed reason=" + (line.matches("[\\w.-]+") ? line : "\"" + line + "\"");
    }

    private String report(String verdict) {
        try {
            folder();
            Files.writeString(options.report(), Report.write(options, verdict, timeline, watcher, edges));
            return verdict;
        } catch (IOException e) {
            return verdict.startsWith("demo: ok ") ? failed("the report cannot be written: " + e) : verdict;
        }
    }

    private void picture() {
        if (pictured || watcher.step() != PICTURE_STEP || watcher.stepNanos() < PICTURE_NANOS || !rig.lamp()) {
            return;
        }
        pictured = true;
        try {
            RigPicture.write(rig, folder().resolve("rig.svg"));
        } catch (IOException e) {
            throw new DemoFailure("the rig's picture cannot be written: " + e);
        }
    }

    /** The report's folder, made if it is missing. */
    private Path folder() throws IOException {
        return Files.createDirectories(options.report().toAbsolutePath().getParent());
    }
}
