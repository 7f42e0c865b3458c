package tickbus.cell;

import java.io.IOException;
import java.io.PrintStream;
import java.nio.file.Files;
import java.nio.file.Path;
import java.time.LocalDateTime;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.CountDownLatch;
import java.util.concurrent.TimeUnit;
import tickbus.Tickbus;
import tickbus.petri.control.BoundNet;
import tickbus.petri.control.NetController;
import tickbus.petri.draw.NetSvg;
import tickbus.petri.page.NetPage;
import tickbus.petri.run.Coordinator;
import tickbus.petri.run.FiringLog;
import tickbus.petri.run.Stop;

/**
 * The cell's control as a process: {@code CellControl CONFIG TABLES IDENTIFICATION FOLDER [--markings FILE] [HOST:PORT]}. The arguments are
 * the cell's driver.cfg, the tables that make it the PLC's end ({@link Tickbus#open(Path, String)}), the driver.cfg of the
 * line to the reader of code carriers, a folder for the results (each net with its marking, and its firings), and optionally
 * a file for the markings ({@link CellProgram}) and the address of a live page about the nets.
 *
 * <p>Until a signal ends the process, or nobody reads its output any more, it prints its counts every 100 ms as lines {@code
 * key=value}, and an empty line.
 */
public final class CellControl {
    private static final long SCAN_NANOS = 5_000_000;
    private static final int SCANS_PER_REPORT = 20;
    private static final int LOGGED = 20_000;
    private static final long SECONDS_TO_END = 4;
    private static final int USAGE = 2;
    private static final int FAILED = 1;

    private final List<FiringLog> logs = new ArrayList<>();
    private final List<Coordinator> coordinators = new ArrayList<>();
    private final CellProgram program;
    private final NetController nets;
    private final Heads heads;
    private final List<StationTimes> times = new ArrayList<>();
    private boolean homed;
    private final CompletableFuture<Proof> proof = new CompletableFuture<>();

    private CellControl(Tickbus bus, Tickbus reader, Path markings) throws IOException {
        heads = Heads.on(reader, LocalDateTime::now);
        BoundNet[] all = CellNets.all(heads);
        BoundNet[] before = HomingNets.all(heads);
        // The milliseconds of the clock: another number in each run.
        program = new CellProgram(bus, heads, log(all), log(before), markings, (int) (System.currentTimeMillis() & Integer.MAX_VALUE) | 1);
        nets = program.nets();
        for (BoundNet one : all) {
            coordinators.add(nets.coordinator(one.net().name()));
        }
        for (BoundNet one : before) {
            coordinators.add(program.homing().coordinator(one.net().name()));
        }
        for (int station : new int[] {1, 3, 4}) {
            times.add(new StationTimes(nets, station));
        }
    }

    private BoundNet[] log(BoundNet... all) {
        for (BoundNet one : all) {
            FiringLog log = new FiringLog(one.net(), LOGGED);
            logs.add(log);
            one.listener(log);
        }
        return all;
    }

    /**
     * Runs until a signal ends it.
     *
     * @param args the command line
     */
    public static void main(String[] args) {
        boolean keeps = args.length > 5 && args[4].equals("--markings");
        int page = keeps ? 6 : 4;
        if (args.length < 4 || args.length > page + 1 || args.length > page && args[page].startsWith("-")) {
            System.err.println("usage: CellControl CONFIG TABLES IDENTIFICATION FOLDER [--markings FILE] [HOST:PORT]");
            System.exit(USAGE);
        }
        CountDownLatch ending = new CountDownLatch(1);
        CountDownLatch done = new CountDownLatch(1);
        Runtime.getRuntime().addShutdownHook(new Thread(() -> {
            ending.countDown();
            try {
                done.await(SECONDS_TO_END, TimeUnit.SECONDS);
            } catch (InterruptedException e) {
                Thread.currentThread().interrupt();
            }
        }, "end of the nets"));
        boolean failed = false;
        try (Tickbus bus = Tickbus.open(Path.of(args[0]), args[1]); Tickbus reader = Tickbus.open(Path.of(args[2]))) {
            CellControl control = new CellControl(bus, reader, keeps ? Path.of(args[5]) : null);
            control.prove();
            if (args.length > page) {
                control.runWithPage(args[page], ending, System.out);
            } else {
                control.run(ending, System.out);
            }
            control.leave(Path.of(args[3]));
        } catch (IOException | RuntimeException e) {
            System.err.println(e.getMessage() == null ? e.toString() : e.getMessage());
            failed = true;
        } finally {
            done.countDown();
        }
        if (failed && ending.getCount() > 0) {
            System.exit(FAILED);
        }
    }

    /** Analyses the nets beside the control, on a thread of low priority. */
    private void prove() {
        Thread thread = new Thread(() -> {
            try {
                proof.complete(Proof.of(CellNets.composition(1, 3, 4)));
            } catch (RuntimeException | Error e) {
                proof.completeExceptionally(e);
            }
        }, "analysis of the nets");
        thread.setDaemon(true);
        thread.setPriority(Thread.MIN_PRIORITY);
        thread.start();
    }

    private void runWithPage(String address, CountDownLatch ending, PrintStream out) throws IOException {
        try (NetPage page = NetPage.open(address, "The manufacturing cell", nets.watch(), program.homing().watch())) {
            out.println("nets: live at " + page.address());
            run(ending, out);
        }
    }

    private void run(CountDownLatch ending, PrintStream out) {
        long start = System.nanoTime();
        nets.run(SCAN_NANOS, () -> goesOn(nets, start, ending, out) && !program.isHoming());
        if (program.isHoming() && ending.getCount() > 0) {
            homed = true;
            out.println("nets: homing after Rearm, because " + program.why());
            NetController homing = program.homing();
            homing.scan(System.nanoTime() - start);
            homing.run(SCAN_NANOS, () -> {
                program.takeOver();
                return goesOn(homing, start, ending, out) && program.isHoming();
            });
            if (!program.isHoming()) {
                out.println("nets: homed");
                nets.scan(System.nanoTime() - start);
                nets.run(SCAN_NANOS, () -> goesOn(nets, start, ending, out));
            }
        }
        print(out);
    }

    private boolean goesOn(NetController running, long start, CountDownLatch ending, PrintStream out) {
        long now = System.nanoTime() - start;
        heads.exchange(now);
        if (!program.isHoming()) {
            times.forEach(one -> one.count(now));
        }
        return (running.scans() % SCANS_PER_REPORT != 0 || print(out)) && ending.getCount() > 0;
    }

    /** Prints the counts; false if the reader was killed. */
    private boolean print(PrintStream out) {
        out.print(report());
        return !out.checkError();
    }

    private String report() {
        StringBuilder text = new StringBuilder();
        line(text, "plc.scans", nets.scans() + program.homing().scans());
        line(text, "stale_scans", nets.staleScans() + program.homing().staleScans());
        line(text, "homed", homed && !program.isHoming() ? 1 : 0);
        line(text, "loader_freed", count("station 1", "try again"));
        line(text, "pallet_freed", count("transport", "free before 1") + count("transport", "free before 2") + count("transport", "free before 3")
            + count("transport", "free before 4"));
        line(text, "vacuum_lost", count("station 4", "vacuum lost"));
        line(text, "unread", heads.failures());
        line(text, "refilled", count("station 1", "magazine filled") + count("station 3", "parts filled") + count("station 3", "heads filled")
            + count("station 4", "caps filled"));
        times.forEach(one -> text.append(one.lines()));
        List<Stop> stops = program.stops();
        line(text, "stops", stops.size());
        if (!stops.isEmpty()) {
            line(text, "stop", stops.get(0).message().replace('\n', ' '));
        }
        if (proof.isCompletedExceptionally()) {
            line(text, "proof", proof.handle((none, thrown) -> thrown.toString().replace('\n', ' ')).join());
        } else if (proof.isDone()) {
            Proof known = proof.join();
            line(text, "markings", known.markings());
            line(text, "deadlocks", known.deadlocks());
            line(text, "all_markings", known.complete());
            line(text, "safe", known.safe());
        }
        return text.append('\n').toString();
    }

    private static void line(StringBuilder text, String key, Object value) {
        text.append(key).append('=').append(value).append('\n');
    }

    private long count(String net, String transition) {
        Coordinator one = nets.coordinator(net);
        return one.firings(one.net().transition(transition).index());
    }

    /** Writes each net with its marking, and the last firings. */
    private void leave(Path folder) throws IOException {
        Files.createDirectories(folder);
        StringBuilder markings = new StringBuilder();
        for (int i = 0; i < coordinators.size(); i++) {
            Coordinator one = coordinators.get(i);
            String name = one.net().name();
            String file = name.replace(' ', '-');
            line(markings, name, logs.get(i).total() + " firings, now " + one.marking());
            Files.writeString(folder.resolve(file + ".svg"), NetSvg.write(one.net(), one.marking()));
            Files.writeString(folder.resolve(file + ".firings"), logs.get(i).toString());
        }
        Files.writeString(folder.resolve("nets.txt"), markings);
    }
}
