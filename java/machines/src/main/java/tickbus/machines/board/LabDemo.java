package tickbus.machines.board;

import java.io.IOException;
import java.io.PrintStream;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import tickbus.machines.demo.DemoFailure;
import tickbus.machines.demo.DemoRun;
import tickbus.machines.demo.HtmlPage;
import tickbus.machines.demo.Stalls;
import tickbus.machines.demo.Timeline;
import tickbus.machines.demo.Verdict;
import tickbus.simulator.DeviceDriverFolder;
import tickbus.simulator.ShutdownGuard;
import tickbus.simulator.Simulator;
import tickbus.simulator.TickMode;
import tickbus.simulator.TimeSource;

/**
 * The demo's command line; {@code --help} describes it.
 *
 * <p>The last line on standard output is the verdict, {@code demo-lab: ok …} or {@code demo-lab: failed reason=…}. Exit
 * codes: 0 ok, 1 failed, 2 the command line was wrong, 130 interrupted.
 */
public final class LabDemo {
    private static final Verdict VERDICT = new Verdict("demo-lab");

    /** The driver's text when the dispatcher has accepted it: it is not running yet, because nothing is connected. */
    private static final String JOINED = "joined the dispatcher";

    /** The interval of looking at the processes' output and state. */
    private static final int TICKS_PER_LOOK = 5;

    private final LabOptions options;
    private final Timeline timeline;
    private final TestingBoard board = new TestingBoard();
    private final PrintStream out;
    private final LabFacts facts = new LabFacts();
    private final Stalls stalls;

    private LabDemo(LabOptions options, PrintStream out, List<String> notes) {
        this.options = options;
        this.out = out;
        timeline = new Timeline(event -> out.println(event.line()));
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
        return DemoRun.start(args, LabOptions.USAGE, LabOptions::read, VERDICT, options -> run(options, out, err), out, err);
    }

    private static int run(LabOptions options, PrintStream out, PrintStream err) {
        // The guard is closed last, so that the verdict is printed even after Ctrl-C.
        try (ShutdownGuard guard = new ShutdownGuard()) {
            DemoRun run = new DemoRun(VERDICT);
            LabDemo demo;
            String verdict;
            do {
                demo = new LabDemo(options, out, run.notes());
                verdict = demo.play(guard, err);
            } while (!guard.triggered() && run.repeats(verdict, demo.stalls));
            verdict = run.verdict(verdict);
            String trouble = demo.page(out);
            if (trouble != null && VERDICT.isOk(verdict)) {
                verdict = VERDICT.failed(trouble);
            }
            return VERDICT.end(verdict, guard, out);
        }
    }

    /** Runs everything from starting the dispatcher to writing the report. */
    private String play(ShutdownGuard guard, PrintStream err) {
        String run = "";
        String verdict;
        try (Laboratory lab = new Laboratory(options, timeline)) {
            lab.open();
            if (lab.page() != null) {
                out.println("demo-lab: patch bay at " + lab.page());
            }
            try (Simulator simulator = new Simulator(DeviceDriverFolder.scan(options.drivers()).open(), board,
                    options.control(), options.stepNanos(), TimeSource.system())) {
                try {
                    operate(simulator, lab, guard);
                } finally {
                    run = LabReport.run(options, simulator);
                    keepStatistics(simulator);
                }
            }
            int overtaken = lab.end();
            if (overtaken > 0) {
                throw new DemoFailure(overtaken + " values were overtaken by newer ones on their way");
            }
            verdict = VERDICT.ok(facts.line(overtaken) + " report=" + options.report());
        } catch (RuntimeException | Error e) {
            verdict = VERDICT.failed(e, err);
        }
        return report(verdict, run);
    }

    private void operate(Simulator simulator, Laboratory lab, ShutdownGuard guard) {
        var driver = simulator.drivers().get(0);
        LabOperator operator = new LabOperator(board, lab, facts, timeline,
                () -> driver.statistics().getOrDefault("reason", "").startsWith(JOINED));
        boolean[] over = new boolean[1];
        simulator.run(TickMode.REAL_TIME, () -> {
            if (guard.triggered()) {
                if (over[0]) {
                    return false;
                }
                throw new DemoFailure("interrupted");
            }
            long now = simulator.simulationNanos();
            if (over[0]) {
                // Somebody looks at the patch bay.
                lab.listen(now);
                return true;
            }
            stalls.look();
            if (simulator.ticks() % TICKS_PER_LOOK == 0) {
                lab.listen(now);
                Verdict.unlessInterrupted(guard, lab::check);
            }
            long begun = System.nanoTime();
            over[0] = operator.look(now, simulator.stepNanos());
            if (System.nanoTime() - begun > simulator.stepNanos()) {
                // The operator has started or killed a process.
                stalls.pause();
            }
            if (over[0] && options.page()) {
                timeline.add(now, "demo", "is over; the patch bay stays until Ctrl-C");
            }
            return !over[0] || options.page();
        });
        if (!over[0]) {
            throw new DemoFailure("interrupted");
        }
    }

    private void keepStatistics(Simulator simulator) {
        try {
            HtmlPage.keepStatistics(beside("statistics.txt"), simulator.drivers().get(0).statistics());
        } catch (IOException e) {
            throw new DemoFailure("the statistics cannot be written: " + e);
        }
    }

    private String report(String verdict, String run) {
        try {
            Files.createDirectories(options.report().toAbsolutePath().getParent());
            BoardPicture.write(board, beside("board.svg"));
            Files.writeString(options.report(), LabReport.write(verdict, facts, timeline, run));
            return verdict;
        } catch (IOException e) {
            return VERDICT.isOk(verdict) ? VERDICT.failed("the report cannot be written: " + e) : verdict;
        }
    }

    private Path beside(String name) {
        return options.report().resolveSibling(name);
    }

    /** Makes an HTML page about the driver's recording; returns the error, or null. */
    private String page(PrintStream out) {
        if (options.recording() == null) {
            return null;
        }
        Path page = beside("report.html");
        String trouble = HtmlPage.make(options.tickbus(), List.of(options.recording().toString(), "--out",
                page.toString(), "--stats", beside("statistics.txt").toString(), "--text", options.report().toString()));
        if (trouble == null) {
            out.println("demo-lab: page=" + page);
        }
        return trouble;
    }
}
