package tickbus.machines.rig;

import controlinterface.ControlInterfaceDeviceDriver;
import java.io.IOException;
import java.io.PrintStream;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import tickbus.machines.demo.DemoFailure;
import tickbus.machines.demo.DemoRun;
import tickbus.machines.demo.Plc;
import tickbus.machines.demo.PlcCommand;
import tickbus.machines.demo.Screen;
import tickbus.machines.demo.Stalls;
import tickbus.machines.demo.Timeline;
import tickbus.machines.demo.Verdict;
import tickbus.simulator.DeviceDriverFolder;
import tickbus.simulator.DriverSet;
import tickbus.simulator.ShutdownGuard;
import tickbus.simulator.Simulator;
import tickbus.simulator.TickMode;
import tickbus.simulator.TimeSource;
import tickbus.simulator.text.Durations;

/**
 * The demo's command line; {@code --help} describes it.
 *
 * <p>The last line on standard output is the verdict, {@code demo: ok …} or {@code demo: failed reason=…}.
 * Exit codes: 0 ok, 1 failed, 2 the command line was wrong, 130 interrupted.
 */
public final class Demo {
    private static final Verdict VERDICT = new Verdict("demo");

    /** The step, and the time in it, at which a picture of the rig shows most: both lifts up, the lamp on. */
    private static final int PICTURE_STEP = 5;

    private static final long PICTURE_NANOS = 400_000_000L;

    private final DemoOptions options;
    private final Display display;
    private final Timeline timeline;
    private final Rig rig = new Rig();
    private final Stalls stalls;
    private Watcher watcher;
    private EdgeAudit audit;
    private Operator operator;
    private boolean pictured;

    /** The verdict on the script when it is over. */
    private String verdict;

    private Demo(DemoOptions options, Display display, List<String> notes) {
        this.options = options;
        this.display = display;
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
     * @param out gets the steps and, last, the verdict
     * @param err gets errors in the command line, and messages of unexpected exceptions
     * @return the exit code
     */
    public static int run(String[] args, PrintStream out, PrintStream err) {
        return DemoRun.start(args, DemoOptions.USAGE, DemoOptions::read, VERDICT, options -> run(options,
                () -> DeviceDriverFolder.scan(options.drivers()).open(),
                driver -> options.plc() == null ? new HostedPlc(driver) : process(options, driver), out, err), out, err);
    }

    /** The rig's PLC program as a process that connects to a driver, which must be listening. */
    private static Plc process(DemoOptions options, ControlInterfaceDeviceDriver driver) {
        Path log = options.report().resolveSibling("plc.log");
        if (options.plcCommand() != null) {
            return PlcCommand.process(options.plc(), options.plcCommand(), log);
        }
        Path cfg = DeviceDriverFolder.scan(options.drivers()).configurations().get(driver.id());
        return PlcCommand.process(options.plc(), "rig", cfg, driver, log);
    }

    /** Opens drivers. */
    @FunctionalInterface
    interface Opener {
        DriverSet open();
    }

    /** Makes the PLC at the other end of a driver. */
    @FunctionalInterface
    interface PlcMaker {
        Plc make(ControlInterfaceDeviceDriver driver);
    }

    static int run(DemoOptions options, Opener opener, PlcMaker plc, PrintStream out, PrintStream err) {
        Display display = out == System.out && Screen.fits()
                ? new TerminalDisplay(out, TimeSource.system(), options.cycles())
                : new LogDisplay(out);
        return run(options, opener, plc, display, out, err);
    }

    static int run(DemoOptions options, Opener opener, PlcMaker plc, Display display, PrintStream out,
            PrintStream err) {
        // The guard is closed last, so that the verdict is printed even after Ctrl-C.
        try (ShutdownGuard guard = new ShutdownGuard()) {
            DemoRun run = new DemoRun(VERDICT);
            Demo demo;
            String verdict;
            do {
                demo = new Demo(options, display, run.notes());
                verdict = demo.play(opener, plc, guard, err);
            } while (!guard.triggered() && run.repeats(verdict, demo.stalls));
            verdict = run.verdict(verdict);
            if (options.recording() != null && options.plc() != null) {
                String trouble = RigPage.make(options, out);
                if (trouble != null && VERDICT.isOk(verdict)) {
                    verdict = VERDICT.failed(trouble);
                }
            }
            return VERDICT.end(verdict, guard, out);
        }
    }

    /** Runs everything from opening the drivers to writing the report. */
    private String play(Opener opener, PlcMaker maker, ShutdownGuard guard, PrintStream err) {
        String verdict;
        // The PLC is ended last: otherwise the driver would report it as lost.
        try (Ending ending = new Ending(); Simulator simulator = new Simulator(opener.open(), rig, options.control(),
                options.stepNanos(), TimeSource.system())) {
            verdict = verdict(simulator, maker, ending, guard, err);
            display.end();
            verdict = report(verdict);
        } catch (RuntimeException | Error e) {
            // The drivers or the control table did not open, or the drivers did not close.
            verdict = report(VERDICT.failed(e, err));
        }
        return verdict;
    }

    /** Ends the PLC, if there is one. */
    private static final class Ending implements AutoCloseable {
        private Plc plc;

        @Override
        public void close() {
            if (plc != null) {
                plc.close();
            }
        }
    }

    private String verdict(Simulator simulator, PlcMaker maker, Ending ending, ShutdownGuard guard, PrintStream err) {
        try {
            if (simulator.drivers().size() != 1) {
                throw new DemoFailure("the driver folder has " + simulator.drivers().size()
                        + " .cfg files; the demo takes exactly one");
            }
            ControlInterfaceDeviceDriver driver = simulator.drivers().get(0);
            ending.plc = maker.make(driver);
            return operate(simulator, driver, ending.plc, guard);
        } catch (RuntimeException | Error e) {
            return VERDICT.failed(e, err);
        }
    }

    /** Runs the script; returns the verdict on it. */
    private String operate(Simulator simulator, ControlInterfaceDeviceDriver driver, Plc plc, ShutdownGuard guard) {
        for (String name : simulator.unconnected()) {
            timeline.add(0, "note", "no row of the control table writes " + name);
        }
        watcher = new Watcher(simulator, rig, driver, timeline);
        audit = new EdgeAudit(simulator, driver);
        plc.start();
        timeline.add(0, "PLC", plc.name());
        operator = new Operator(options, watcher, timeline, audit, plc, stalls,
                () -> new Outage(watcher, driver, timeline, plc.name(), PlcCommand.maxAgeNanos(driver)));
        simulator.run(options.mode(), () -> {
            if (guard.triggered()) {
                if (verdict != null) {
                    return false;
                }
                throw new DemoFailure("interrupted");
            }
            if (verdict != null) {
                return true;
            }
            if (simulator.ticks() > 0) {
                lookForStalls(plc);
                Verdict.unlessInterrupted(guard, plc::check);
                audit.look();
                watcher.look();
                operator.act();
                display.tick(watcher, operator, plc);
                picture();
            }
            if (!operator.done() && simulator.simulationNanos() >= options.timeLimitNanos()) {
                throw new DemoFailure("the time limit of " + Durations.text(options.timeLimitNanos())
                        + " of simulation time is over in stage " + operator.stage());
            }
            if (operator.done()) {
                audit.end(plc.counts());
                verdict = check(simulator);
                timeline.add(simulator.simulationNanos(), "demo", options.page()
                        ? "is over; the live page stays until Ctrl-C" : "is over");
            }
            return verdict == null || options.page();
        });
        if (verdict == null) {
            throw new DemoFailure("interrupted");
        }
        return verdict;
    }

    private void lookForStalls(Plc plc) {
        if (options.mode() == TickMode.REAL_TIME) {
            stalls.look();
            stalls.silent(plc.longestSilenceNanos());
        }
    }

    /** The verdict after a complete script. */
    private String check(Simulator simulator) {
        Counters counters = rig.counters();
        long missed = audit.missed();
        long inRig = rig.bottles().size();
        must(watcher.cycles() == options.cycles(), "the PLC counts " + watcher.cycles() + " cycles instead of "
                + options.cycles());
        must(counters.cycles() == options.cycles(), "the rig counts " + counters.cycles() + " cycles instead of "
                + options.cycles());
        must(counters.jams() == 1, "there were " + counters.jams() + " jams instead of 1");
        must(counters.faults() == 1, "Not OK rose " + counters.faults() + " times instead of once");
        must(counters.lampErrors() == 0, "the lamp differed from the motion of lift 2 " + counters.lampErrors()
                + " times");
        must(counters.fallen() == 0, counters.fallen() + " bottles fell");
        must(counters.fed() == counters.delivered() + counters.removed() + counters.fallen() + inRig,
                "bottles unaccounted: " + counters.fed() + " fed, " + counters.delivered() + " delivered, "
                        + counters.removed() + " removed, " + inRig + " in the rig");
        must(missed == 0, "missed edges: " + missed + "; the report has them by signal");
        if (operator.outage() != null) {
            must(operator.restarts() == 1, "the PLC was started again " + operator.restarts() + " times instead of once");
            must(operator.outage().over(), "the outage never ended");
            must(watcher.staleTicksInOutage() > 0, "no tick was stale while the PLC was dead");
        }
        return VERDICT.ok("cycles=" + watcher.cycles() + " jams=" + counters.jams() + " restarts="
                + operator.restarts() + " ticks=" + simulator.ticks() + " missed_edges=" + missed + " stale_ticks="
                + watcher.staleTicksInOutage() + " report=" + options.report());
    }

    private static void must(boolean fulfilled, String reason) {
        if (!fulfilled) {
            throw new DemoFailure(reason);
        }
    }

    private String report(String verdict) {
        try {
            folder();
            if (watcher != null) {
                RigPage.keepStatistics(options, watcher.simulator().drivers().get(0).statistics());
            }
            Files.writeString(options.report(), Report.write(options, verdict, timeline, watcher, audit, operator));
            return verdict;
        } catch (IOException e) {
            return VERDICT.isOk(verdict) ? VERDICT.failed("the report cannot be written: " + e) : verdict;
        }
    }

    private void picture() {
        if (pictured || watcher.step() != PICTURE_STEP || watcher.stepNanos() < PICTURE_NANOS || !rig.lamp()
                || rig.jammed()) {
            return;
        }
        pictured = true;
        try {
            RigPicture.write(rig, folder().resolve("rig.svg"));
        } catch (IOException e) {
            throw new DemoFailure("the rig's picture cannot be written: " + e);
        }
    }

    /** The report's folder, created if missing. */
    private Path folder() throws IOException {
        return Files.createDirectories(options.report().toAbsolutePath().getParent());
    }
}
