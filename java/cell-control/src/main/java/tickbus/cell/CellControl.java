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
 * The cell's control as a process: {@code CellControl CONFIG TABLES IDENTIFICATION FOLDER [HOST:PORT]}. The arguments are
 * the cell's driver.cfg, the tables that make it the PLC's end ({@link Tickbus#open(Path, String)}), the driver.cfg of the
 * line to the reader of code carriers, a folder for the results (each net with its marking, and its firings), and optionally
 * the address of a live page about the nets.
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
    private final NetController nets;
    private final Heads heads;
    private final CompletableFuture<Proof> proof = new CompletableFuture<>();

    private CellControl(Tickbus bus, Tickbus reader) {
        heads = Heads.on(reader, LocalDateTime::now);
        BoundNet[] all = CellNets.all(heads);
        for (BoundNet one : all) {
            FiringLog log = new FiringLog(one.net(), LOGGED);
            logs.add(log);
            one.listener(log);
        }
        nets = CellNets.controller(bus, all);
        for (BoundNet one : all) {
            coordinators.add(nets.coordinator(one.net().name()));
        }
    }

    /**
     * Runs until a signal ends it.
     *
     * @param args the command line
     */
    public static void main(String[] args) {
        if (args.length != 4 && args.length != 5) {
            System.err.println("usage: CellControl CONFIG TABLES IDENTIFICATION FOLDER [HOST:PORT]");
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
            CellControl control = new CellControl(bus, reader);
            control.prove();
            if (args.length == 5) {
                control.runWithPage(args[4], ending, System.out);
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
        try (NetPage page = NetPage.open(address, "The manufacturing cell", nets.watch())) {
            out.println("nets: live at " + page.address());
            run(ending, out);
        }
    }

    private void run(CountDownLatch ending, PrintStream out) {
        long start = System.nanoTime();
        nets.run(SCAN_NANOS, () -> {
            heads.exchange(System.nanoTime() - start);
            return (nets.scans() % SCANS_PER_REPORT != 0 || print(out)) && ending.getCount() > 0;
        });
        print(out);
    }

    /** Prints the counts; false if the reader was killed. */
    private boolean print(PrintStream out) {
        out.print(report());
        return !out.checkError();
    }

    private String report() {
        StringBuilder text = new StringBuilder();
        line(text, "plc.scans", nets.scans());
        line(text, "stale_scans", nets.staleScans());
        line(text, "loader_freed", count(0, "try again"));
        line(text, "pallet_freed", count(3, "free before 1") + count(3, "free before 2") + count(3, "free before 3")
            + count(3, "free before 4"));
        line(text, "vacuum_lost", count(2, "vacuum lost"));
        line(text, "unread", heads.failures());
        line(text, "refilled", count(0, "magazine filled") + count(1, "parts filled") + count(1, "heads filled")
            + count(2, "caps filled"));
        List<Stop> stops = nets.stops();
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

    private long count(int net, String transition) {
        Coordinator one = coordinators.get(net);
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
