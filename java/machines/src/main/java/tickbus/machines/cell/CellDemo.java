package tickbus.machines.cell;

import controlinterface.ControlInterfaceDeviceDriver;
import java.io.IOException;
import java.io.PrintStream;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.HashMap;
import java.util.List;
import java.util.Map;
import java.util.TreeMap;
import java.util.regex.Pattern;
import java.util.stream.Stream;
import tickbus.machines.demo.DemoFailure;
import tickbus.machines.demo.DemoRun;
import tickbus.machines.demo.HtmlPage;
import tickbus.machines.demo.PlcCommand;
import tickbus.machines.demo.PlcProcess;
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
 * <p>The last line on standard output is the verdict, {@code demo-cell: ok …} or {@code demo-cell: failed reason=…}.
 * Exit codes: 0 ok, 1 failed, 2 the command line was wrong, 130 interrupted.
 */
public final class CellDemo {
    /** The drivers of the control table. */
    private static final int CELL = 1998;
    private static final int READER = 1999;

    private static final Verdict VERDICT = new Verdict("demo-cell");

    /** The interval of the reports of the nets' process. */
    private static final long REPORT_NANOS = 100_000_000L;
    private static final int TICKS_PER_LOOK_AT_NETS = 25;
    /** The counts of the nets' process that begin at 0 again when it is started again. */
    private static final Pattern COUNTS = Pattern.compile("(plc|stale)[._]scans|loader_freed|pallet_freed|vacuum_lost|unread|refilled"
            + "|homed|station\\d\\..*");

    private final CellOptions options;
    private final Timeline timeline;
    private final ManufacturingCell cell = new ManufacturingCell();
    private final Stalls stalls;
    private final CellOperator operator;
    private Simulator simulator;
    private Map<String, String> nets = Map.of();
    /** The last counts of earlier processes of the nets, added up. */
    private final Map<String, Long> earlier = new HashMap<>();
    /** When the current round of cylinders began. */
    private long roundNanos;
    /** The result of the last complete round; null in the first one. */
    private String lastRound;
    /** True if somebody has killed the nets, which no stall excuses. */
    private boolean netsKilled;

    private CellDemo(CellOptions options, PrintStream out, List<String> notes) {
        this.options = options;
        timeline = new Timeline(event -> out.println(event.line()));
        stalls = new Stalls(TimeSource.system(), options.stepNanos());
        operator = new CellOperator(cell, timeline, options.cylinders(), options.page() == null);
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
        return DemoRun.start(args, CellOptions.USAGE, CellOptions::read, VERDICT, options -> run(options, out, err), out, err);
    }

    private static int run(CellOptions options, PrintStream out, PrintStream err) {
        // The guard is closed last, so that the verdict is printed even after Ctrl-C.
        try (ShutdownGuard guard = new ShutdownGuard()) {
            DemoRun run = new DemoRun(VERDICT);
            CellDemo demo;
            String verdict;
            do {
                demo = new CellDemo(options, out, run.notes());
                verdict = demo.play(guard, err);
            } while (!guard.triggered() && !demo.netsKilled && run.repeats(verdict, demo.stalls));
            verdict = run.verdict(verdict);
            if (options.plc() != null && options.recording() != null && !guard.triggered()) {
                Path page = options.report().resolveSibling("report.html");
                String trouble = CellPage.make(options, page, statistics(options));
                if (trouble == null) {
                    out.println("demo-cell: page=" + page);
                } else if (VERDICT.isOk(verdict)) {
                    verdict = VERDICT.failed(trouble);
                }
            }
            return VERDICT.end(verdict, guard, out);
        }
    }

    /** Runs everything from opening the driver to writing the report. */
    private String play(ShutdownGuard guard, PrintStream err) {
        String verdict;
        try (Simulator opened = new Simulator(DeviceDriverFolder.scan(options.drivers()).open(), cell, options.control(),
                options.stepNanos(), TimeSource.system())) {
            simulator = opened;
            verdict = verdict(guard, err);
            return report(verdict);
        } catch (RuntimeException | Error e) {
            // The driver or the control table did not open, or the driver did not close.
            return report(VERDICT.failed(e, err));
        }
    }

    private String verdict(ShutdownGuard guard, PrintStream err) {
        try {
            String port = PlcCommand.device(driver(READER));
            List<String> command = command(driver(CELL));
            empty(CellPage.nets(options));
            try (PlcProcess plc = new PlcProcess("the nets", "they run with the java of this demo", () -> command, REPORT_NANOS,
                    options.report().toAbsolutePath().resolveSibling("nets.log"))) {
                plc.start();
                timeline.add(0, "nets", plc.name());
                timeline.add(0, "reader", "on " + port);
                try {
                    operate(plc, guard);
                } finally {
                    netsKilled = plc.endedBySignal();
                }
            }
            return lastRound == null ? check() : lastRound;
        } catch (IOException e) {
            return VERDICT.failed("the folder of the nets cannot be made, or emptied: " + e);
        } catch (RuntimeException | Error e) {
            // Ctrl-C, which ends endless rounds, may have reached the nets' process first.
            return lastRound != null && guard.triggered() ? lastRound : VERDICT.failed(e, err);
        }
    }

    /** Removes the nets of an earlier attempt. */
    private static void empty(Path folder) throws IOException {
        Files.createDirectories(folder);
        try (Stream<Path> files = Files.list(folder)) {
            for (Path file : files.toList()) {
                Files.delete(file);
            }
        }
    }

    /** The driver with this id of the control table. */
    private ControlInterfaceDeviceDriver driver(int id) {
        return simulator.drivers().stream().filter(one -> one.id() == id).findAny().orElseThrow(() -> new DemoFailure(
                "the driver folder has no .cfg file with the id " + id + "; the demo takes those of the cell, " + CELL
                        + ", and of its reader, " + READER));
    }

    private List<String> command(ControlInterfaceDeviceDriver driver) {
        Path cfg = DeviceDriverFolder.scan(options.drivers()).configurations().get(driver.id());
        String java = Path.of(System.getProperty("java.home"), "bin", "java").toString();
        String client = "[fieldbus]\nkind = \"modbus-client\"\nrole = \"controller\"\nwrite_to = \"tickbus "
                + driver.name() + "\"\naddress = \"" + PlcCommand.address(driver)
                // The machine's end records.
                + "\"\n[record]\nfile = \"none.vcd\"\nwhen = \"never\"\n";
        List<String> command = new ArrayList<>(List.of(java, "--enable-native-access=ALL-UNNAMED", "-cp", options.nets()));
        // Such as the path of the native library.
        System.getProperties().stringPropertyNames().stream().filter(name -> name.startsWith("tickbus."))
                .forEach(name -> command.add("-D" + name + "=" + System.getProperty(name)));
        command.addAll(List.of("tickbus.cell.CellControl", cfg.toString(), client,
                options.identification().toString(), CellPage.nets(options).toString(), "--markings",
                CellPage.nets(options).resolve("markings").toString()));
        if (options.page() != null) {
            command.add(options.page());
        }
        return command;
    }

    private void operate(PlcProcess plc, ShutdownGuard guard) {
        simulator.unconnected().forEach(name -> timeline.add(0, "note", "no row of the control table writes " + name));
        simulator.run(TickMode.REAL_TIME, () -> {
            if (guard.triggered()) {
                if (lastRound != null) {
                    return false;
                }
                throw new DemoFailure("interrupted");
            }
            if (simulator.ticks() > 0) {
                stalls.look();
            }
            if (simulator.ticks() % TICKS_PER_LOOK_AT_NETS == 0) {
                Verdict.unlessInterrupted(guard, plc::check);
                nets = statistics(plc);
                plc.news().forEach(line -> timeline.add(simulator.simulationNanos(), "nets", line));
                if (nets.containsKey("stop")) {
                    throw new DemoFailure("a net has stopped: " + nets.get("stop"));
                }
                if (nets.containsKey("proof")) {
                    throw new DemoFailure("the analysis of the nets failed: " + nets.get("proof"));
                }
            }
            operator.act(simulator.simulationNanos());
            if (operator.wantsRestart()) {
                restart(plc);
            }
            boolean over = operator.done() && !cell.showsRunning() && nets.containsKey("markings");
            if (!over && simulator.simulationNanos() - roundNanos >= options.timeLimitNanos()) {
                throw new DemoFailure("the time limit of " + Durations.text(options.timeLimitNanos())
                        + " of simulation time is over with " + cell.delivered().size() + " of " + operator.ordered()
                        + " cylinders" + (nets.containsKey("markings") ? "" : "; the analysis of the nets is not done"));
            }
            if (over && options.page() != null) {
                nets = statistics(plc);
                lastRound = check();
                timeline.add(simulator.simulationNanos(), "round", lastRound + "; the next one begins, until Ctrl-C");
                roundNanos = simulator.simulationNanos();
                operator.again();
                return true;
            }
            return !over;
        });
        if (lastRound == null && !operator.done()) {
            throw new DemoFailure("interrupted");
        }
        nets = statistics(plc);
    }

    /** Kills the nets' process, and starts it again: it finds its markings in the file. */
    private void restart(PlcProcess plc) {
        plc.kill();
        plc.statistics().forEach((key, value) -> {
            if (COUNTS.matcher(key).matches()) {
                earlier.merge(key, Long.parseLong(value), Long::sum);
            }
        });
        timeline.add(simulator.simulationNanos(), "operator", plc.name() + " of the nets is killed, and started again");
        plc.start();
    }

    /** The counts of the current process of the nets, and those of earlier ones. */
    private Map<String, String> statistics(PlcProcess plc) {
        Map<String, String> all = new HashMap<>(plc.statistics());
        if (!all.isEmpty()) {
            earlier.forEach((key, before) -> all.merge(key, before.toString(),
                    (now, more) -> String.valueOf(Long.parseLong(now) + Long.parseLong(more))));
        }
        return all;
    }

    /** The verdict when all cylinders are out. */
    private String check() {
        Counters counters = cell.counters();
        int ordered = operator.ordered();
        must(cell.delivered().size() == ordered, "there are " + cell.delivered().size() + " cylinders instead of " + ordered);
        must(cell.delivered().stream().allMatch(Workpiece::isComplete), "a cylinder is not complete; the report has them all");
        long kinds = cell.delivered().stream().map(PieceKind::of).distinct().count();
        int all = PieceKind.values().length - 1;
        must(kinds == Math.min(all, options.cylinders()) || options.cylinders() < all, "there are " + kinds
                + " kinds of cylinders instead of " + all + ": " + CellReport.kinds(cell));
        must(counters.fallen() == 0, counters.fallen() + " pieces fell");
        must(counters.wasted() == 0, counters.wasted() + " parts were pressed into nothing");
        must(counters.collisions() == 0, "an arm was moved to the side while it was down");
        must(counters.loaderJams() + counters.palletJams() + counters.vacuumLosses() + counters.carriersMissed()
                        == operator.mishaps(),
                "of " + operator.mishaps() + " mishaps " + counters.loaderJams() + " of the loader, " + counters.palletJams()
                        + " of pallets, " + counters.vacuumLosses() + " of the vacuum and " + counters.carriersMissed()
                        + " of head 1 happened and were recovered");
        equal("loader_freed", counters.loaderJams());
        equal("pallet_freed", counters.palletJams());
        equal("vacuum_lost", counters.vacuumLosses());
        // On a busy computer a head can see a carrier long after the sensor has seen the pallet; then the nets also read
        // again.
        must(number("unread") >= counters.carriersMissed(), "the nets count unread=" + number("unread") + " instead of "
                + counters.carriersMissed() + " or more");
        equal("refilled", operator.refills());
        equal("stops", 0);
        must("true".equals(nets.get("all_markings")), "the analysis of the nets gave up at " + nets.get("markings") + " markings");
        equal("deadlocks", 0);
        return VERDICT.ok("cylinders=" + ordered + " kinds=" + CellReport.kinds(cell) + " deadlocks=0 markings="
                + nets.get("markings") + " jams=" + (counters.loaderJams() + counters.palletJams()) + " recovered="
                + (number("loader_freed") + number("pallet_freed")) + " vacuum_lost=" + counters.vacuumLosses() + " missed="
                + counters.carriersMissed() + " refills="
                + operator.refills() + " emergency_stops=" + operator.emergencies() + " restarts=" + operator.restarts() + " ticks=" + simulator.ticks() + " report=" + options.report());
    }

    private long number(String key) {
        try {
            return Long.parseLong(nets.getOrDefault(key, ""));
        } catch (NumberFormatException e) {
            throw new DemoFailure("the nets' process says " + key + "=" + nets.get(key) + ", which is no count");
        }
    }

    private void equal(String key, long here) {
        must(number(key) == here, "the nets count " + key + "=" + number(key) + " instead of " + here);
    }

    private static void must(boolean fulfilled, String reason) {
        if (!fulfilled) {
            throw new DemoFailure(reason);
        }
    }

    private static Path statistics(CellOptions options) {
        return options.report().resolveSibling("statistics.txt");
    }

    private String report(String verdict) {
        try {
            Files.createDirectories(options.report().toAbsolutePath().getParent());
            if (simulator != null) {
                HtmlPage.keepStatistics(statistics(options), driver(CELL).statistics());
            }
            Path markings = CellPage.nets(options).resolve("nets.txt");
            Files.writeString(options.report(), CellReport.write(options, verdict, timeline, cell, new TreeMap<>(nets),
                    Files.exists(markings) ? Files.readString(markings) : "", simulator));
            return verdict;
        } catch (IOException | RuntimeException e) {
            return VERDICT.isOk(verdict) ? VERDICT.failed("the report cannot be written: " + e) : verdict;
        }
    }
}
