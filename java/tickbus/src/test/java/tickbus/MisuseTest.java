package tickbus;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertNull;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.Random;
import java.util.concurrent.Callable;
import java.util.concurrent.CyclicBarrier;
import java.util.concurrent.ExecutionException;
import java.util.concurrent.ExecutorService;
import java.util.concurrent.Executors;
import java.util.concurrent.Future;
import java.util.concurrent.atomic.AtomicBoolean;
import java.util.concurrent.atomic.AtomicInteger;
import java.util.concurrent.atomic.AtomicReference;
import org.junit.jupiter.api.BeforeAll;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.function.Executable;
import org.junit.jupiter.api.io.TempDir;

/** Misuse of the API: each call gets an answer, and the JVM survives. */
@Tag("native")
class MisuseTest {
    @TempDir
    Path directory;

    @BeforeAll
    static void load() {
        NativeLibrary.load();
    }

    private static FieldbusException assertStatus(Status expected, Executable call) {
        FieldbusException thrown = assertThrows(FieldbusException.class, call);
        assertEquals(expected, thrown.status(), thrown::getMessage);
        return thrown;
    }

    private Path mirror() {
        return DriverCfg.mirror(1).signal("in", "%IW0").signal("out", "%QX0.0", "latch = \"rising\"").write(directory);
    }

    @Test
    void aSweepThatIsUsedTooEarlyOrTooLateAnswers() {
        String keys = "moments = \"out\"\ntold = \"out\"\nwithin = \"1s\"\n";
        try (Tickbus bus = Tickbus.open(mirror())) {
            SweepSession sweep = new SweepSession(bus, "up", directory, keys, 1_000_000);
            assertStatus(Status.BAD_ARGUMENT, () -> sweep.plan(false));
            assertStatus(Status.BAD_ARGUMENT, () -> sweep.begin(bus, 0));
            assertStatus(Status.BAD_ARGUMENT, sweep::accept);
            assertTrue(sweep.after(bus), "a run that never began is over");
            assertEquals("", sweep.summary());
            assertNull(sweep.verdict(-5));
            sweep.close();
            sweep.close();
            assertStatus(Status.CLOSED, () -> sweep.beginWithoutFault(bus));
            FieldbusException wrong = assertStatus(Status.BAD_ARGUMENT,
                () -> new SweepSession(bus, "up", directory, keys.replace("told", "tolld"), 1_000_000));
            assertTrue(wrong.getMessage().contains("did you mean \"told\"?"), wrong.getMessage());
        }
    }

    @Test
    void whatWasNeverOpenedIsNotOpen() {
        Random random = new Random(4711);
        for (int i = 0; i < 100_000; i++) {
            long handle = i < 1000 ? -i : random.nextLong() | Long.MIN_VALUE >>> random.nextInt(8);
            assertEquals(Status.NOT_OPEN.code(), Tickbus.xChangeData(handle), () -> Long.toHexString(handle));
            assertEquals(Status.NOT_OPEN.code(), Tickbus.receiveNative(handle), () -> Long.toHexString(handle));
            assertEquals(Status.NOT_OPEN.code(), Tickbus.sendNative(handle), () -> Long.toHexString(handle));
        }
        for (long handle : new long[] {0, 1, -1, 64, 255, Long.MIN_VALUE, Long.MAX_VALUE}) {
            assertStatus(Status.NOT_OPEN, () -> Tickbus.finalizeNative(handle));
            assertStatus(Status.NOT_OPEN, () -> Tickbus.statisticsNative(handle));
            assertStatus(Status.NOT_OPEN, () -> SwallowedChanges.linesNative(handle));
            assertEquals(-1, SwallowedChanges.countNative(handle));
            assertStatus(Status.NOT_OPEN, () -> Tickbus.eventsNative(handle, new long[3]));
            assertStatus(Status.NOT_OPEN, () -> Tickbus.injectNative(handle, "kind = \"link-down\""));
            assertStatus(Status.NOT_OPEN, () -> Tickbus.endFaultNative(handle, 1));
            assertStatus(Status.NOT_OPEN, () -> Tickbus.faultsNative(handle));
        }
    }

    @Test
    void whatWasClosedStaysClosed() {
        Layout layout = new Layout();
        long handle = Tickbus.initializeNative(mirror().toString(), "", layout);
        assertTrue(Tickbus.xChangeData(handle) >= 0);
        assertEquals(Status.NOT_OPEN.code(), Tickbus.xChangeData(handle + (1L << 40)));
        Tickbus.finalizeNative(handle);
        try (Tickbus tenantOfTheSamePlace = Tickbus.open(mirror())) {
            assertEquals(Status.CLOSED.code(), Tickbus.xChangeData(handle));
            assertEquals(Status.CLOSED.code(), Tickbus.receiveNative(handle));
            assertEquals(Status.CLOSED.code(), Tickbus.sendNative(handle));
            assertStatus(Status.CLOSED, () -> Tickbus.finalizeNative(handle));
            assertStatus(Status.CLOSED, () -> Tickbus.statisticsNative(handle));
            assertStatus(Status.CLOSED, () -> SwallowedChanges.linesNative(handle));
            assertEquals(-1, SwallowedChanges.countNative(handle));
            assertStatus(Status.CLOSED, () -> Tickbus.eventsNative(handle, new long[3]));
            assertStatus(Status.CLOSED, () -> Tickbus.injectNative(handle, "kind = \"link-down\""));
            assertStatus(Status.CLOSED, () -> Tickbus.endFaultNative(handle, 1));
            assertStatus(Status.CLOSED, () -> Tickbus.overNative(handle));
            assertStatus(Status.CLOSED, () -> Tickbus.faultsNative(handle));
            assertTrue(tenantOfTheSamePlace.exchange() >= 0);
        }
    }

    @Test
    void argumentsThatAreNullOrTooShortAreRefused() {
        assertStatus(Status.BAD_ARGUMENT, () -> Tickbus.initializeNative(null, "", new Layout()));
        assertStatus(Status.BAD_ARGUMENT, () -> Tickbus.initializeNative(mirror().toString(), "", null));
        assertThrows(NullPointerException.class, () -> Tickbus.open(null));
        Layout layout = new Layout();
        long handle = Tickbus.initializeNative(mirror().toString(), "", layout);
        try {
            assertStatus(Status.BAD_ARGUMENT, () -> Tickbus.eventsNative(handle, null));
            assertStatus(Status.BAD_ARGUMENT, () -> Tickbus.injectNative(handle, null));
            assertStatus(Status.BAD_ARGUMENT, () -> Tickbus.injectNative(handle, ""));
            for (int id : new int[] {0, 1, -1, Integer.MIN_VALUE, Integer.MAX_VALUE}) {
                assertFalse(Tickbus.endFaultNative(handle, id));
            }
            assertEquals(0, Tickbus.eventsNative(handle, new long[0]));
            assertEquals(0, Tickbus.eventsNative(handle, new long[2]));
        } finally {
            Tickbus.finalizeNative(handle);
        }
    }

    @Test
    void afterCloseEveryCallIsRefused() {
        Tickbus bus = Tickbus.open(mirror());
        Signal in = bus.signal("in");
        Signal out = bus.signal("out");
        bus.close();
        bus.close();
        List<Executable> calls = List.of(bus::exchange, () -> bus.exchange(1), bus::receive,
            () -> bus.receive(1), bus::send, bus::signals, () -> bus.signal("in"),
            bus::ageNanos, bus::sequence, bus::grantedNanos, bus::statistics, () -> bus.pollEvents((s, v, t) -> { }),
            () -> bus.setAll(new double[1]), () -> bus.getAll(new double[1]), in::get, () -> in.set(1), in::getBoolean,
            () -> in.setBoolean(true), in::getLong, () -> in.setLong(1), out::edges);
        for (Executable call : calls) {
            assertStatus(Status.CLOSED, call);
        }
        assertEquals(1, bus.id());
        assertEquals("Driver 1", bus.name());
    }

    /** Runs a call on another thread, and waits for it. */
    private static void elsewhere(Executable call) throws Exception {
        AtomicReference<Throwable> thrown = new AtomicReference<>();
        Thread thread = new Thread(() -> {
            try {
                call.execute();
            } catch (Throwable e) {
                thrown.set(e);
            }
        }, "elsewhere");
        thread.start();
        thread.join();
        if (thrown.get() != null) {
            throw new AssertionError(thrown.get());
        }
    }

    @Test
    void theTickBelongsToOneThreadUntilItLetsGo() throws Exception {
        try (Tickbus bus = Tickbus.open(mirror())) {
            String owner = Thread.currentThread().getName();
            assertTrue(bus.exchange() >= 0);
            elsewhere(() -> {
                for (Executable call : List.<Executable>of(bus::exchange, () -> bus.exchange(1), bus::receive,
                    () -> bus.receive(1), bus::send,
                    () -> bus.pollEvents((s, v, t) -> { }))) {
                    FieldbusException busy = assertThrows(FieldbusException.class, call);
                    assertEquals(Status.BUSY, busy.status());
                    assertTrue(busy.getMessage().contains(owner), busy.getMessage());
                }
                bus.releaseThread();
                assertStatus(Status.BUSY, bus::exchange);
                assertEquals("1", bus.statistics().get("ticks"), "anybody may look");
            });
            bus.releaseThread();
            elsewhere(() -> assertTrue(bus.exchange() >= 0));
            assertTrue(bus.exchange() >= 0, "that thread has ended");
            elsewhere(bus::close);
            assertStatus(Status.CLOSED, bus::exchange);
        }
    }

    /** Runs both on a thread each, starting simultaneously, and waits for them. */
    private static <T> List<T> atOnce(Callable<T> one, Callable<T> other) throws Exception {
        CyclicBarrier start = new CyclicBarrier(2);
        ExecutorService threads = Executors.newFixedThreadPool(2);
        try {
            List<Future<T>> running = new ArrayList<>();
            for (Callable<T> work : List.of(one, other)) {
                running.add(threads.submit(() -> {
                    start.await();
                    return work.call();
                }));
            }
            List<T> done = new ArrayList<>();
            for (Future<T> each : running) {
                done.add(each.get());
            }
            return done;
        } catch (ExecutionException e) {
            throw new AssertionError(e.getCause());
        } finally {
            threads.shutdownNow();
        }
    }

    @Test
    void twoThreadsInTheNativeExchangeAreServedOrBusy() throws Exception {
        long handle = Tickbus.initializeNative(mirror().toString(), "", new Layout());
        Callable<Integer> exchanges = () -> {
            int served = 0;
            for (int i = 0; i < 50_000; i++) {
                int code = Tickbus.xChangeData(handle);
                assertTrue(code >= 0 || code == Status.BUSY.code(), "code " + code);
                served += code >= 0 ? 1 : 0;
            }
            return served;
        };
        int served = atOnce(exchanges, exchanges).stream().mapToInt(Integer::intValue).sum();
        assertTrue(Tickbus.statisticsNative(handle).contains("ticks=" + served + "\n"), "served " + served);
        Tickbus.finalizeNative(handle);
    }

    /** Makes a call that another thread may block; false if it did. */
    private static boolean served(Runnable call) {
        try {
            call.run();
            return true;
        } catch (FieldbusException e) {
            assertEquals(Status.BUSY, e.status(), e::getMessage);
            return false;
        }
    }

    @Test
    void twoThreadsThatTickOneDriverAreServedOrBusy() throws Exception {
        try (Tickbus bus = Tickbus.open(mirror())) {
            Callable<Integer> exchanges = () -> {
                int served = 0;
                for (int i = 0; i < 50_000; i++) {
                    served += served(bus::exchange) ? 1 : 0;
                }
                return served;
            };
            int served = atOnce(exchanges, exchanges).stream().mapToInt(Integer::intValue).sum();
            assertEquals(String.valueOf(served), bus.statistics().get("ticks"));
        }
    }

    @Test
    void aThreadThatReadsStatisticsDisturbsNoTick() throws Exception {
        try (Tickbus bus = Tickbus.open(mirror())) {
            AtomicBoolean ticked = new AtomicBoolean();
            Callable<Integer> ticks = () -> {
                try {
                    for (int i = 0; i < 20_000; i++) {
                        assertTrue(bus.exchange() >= 0);
                        bus.pollEvents((s, v, t) -> { });
                    }
                    return 0;
                } finally {
                    ticked.set(true);
                }
            };
            Callable<Integer> looks = () -> {
                int seen = 0;
                while (!ticked.get()) {
                    bus.statistics();
                    seen++;
                }
                return seen;
            };
            atOnce(ticks, looks);
            assertEquals("20000", bus.statistics().get("ticks"));
        }
    }

    /** A call that had its effect is never reported as refused, however long another thread is in the way. */
    @Test
    void aCallThatMustNotBeRefusedIsMadeUntilItGetsThrough() {
        AtomicInteger calls = new AtomicInteger();
        assertEquals(100_000, Patience.untilIdle(() -> {
            if (calls.incrementAndGet() < 100_000) {
                throw new FieldbusException(Status.BUSY, "in the way");
            }
            return calls.get();
        }));
        assertStatus(Status.CLOSED, () -> Patience.untilIdle(() -> {
            throw new FieldbusException(Status.CLOSED, "closed");
        }));
    }

    /** Between two long exchanges one call fits in, but not always two: that of the fault, and what is asked of it. */
    @Test
    void aFaultThatIsSaidToBeRefusedIsNotInjected() throws Exception {
        final int enough = 20;
        try (Tickbus bus = Tickbus.open(mirror())) {
            AtomicBoolean injected = new AtomicBoolean();
            Callable<Integer> ticks = () -> {
                for (long turn = 1; !injected.get(); turn++) {
                    assertTrue(bus.exchange(turn * 10_000_000_000L) >= 0);
                }
                return 0;
            };
            Callable<Integer> injects = () -> {
                try {
                    int done = 0;
                    for (int i = 0; i < 10_000 && done < enough; i++) {
                        done += served(() -> bus.inject("kind = \"delay\"\nby = \"1ms\"\ntick = 1000000000")) ? 1 : 0;
                    }
                    return done;
                } finally {
                    injected.set(true);
                }
            };
            int done = atOnce(ticks, injects).stream().mapToInt(Integer::intValue).sum();
            assertEquals(done, bus.faults().size());
            assertTrue(done > 0, "no call got through");
        }
    }

    @Test
    void aDriverClosesBetweenTwoExchangesOfAThreadThatNeverPauses() throws Exception {
        for (int round = 0; round < 50; round++) {
            Tickbus bus = Tickbus.open(mirror());
            Callable<Integer> ticking = () -> {
                int ticks = 0;
                while (true) {
                    try {
                        bus.exchange();
                        ticks++;
                    } catch (FieldbusException e) {
                        assertEquals(Status.CLOSED, e.status(), e::getMessage);
                        return ticks;
                    }
                }
            };
            Callable<Integer> closing = () -> {
                bus.close();
                return 0;
            };
            atOnce(ticking, closing);
            assertStatus(Status.CLOSED, bus::exchange);
        }
    }

    @Test
    void aForgottenDriverIsClosed() throws Exception {
        long handle = forgotten();
        while (Tickbus.xChangeData(handle) >= 0) {
            System.gc();
            Thread.sleep(1);
        }
        assertEquals(Status.CLOSED.code(), Tickbus.xChangeData(handle));
    }

    /** The handle of a driver that nobody has closed, and to which nothing refers. */
    private long forgotten() {
        return Tickbus.open(mirror()).handle();
    }

    @Test
    void aHandlerThatClosesTheDriverGetsNoFurtherEvent() {
        Path cfg = DriverCfg.mirror(1).fieldbus("events = true").signal("in", "%IX0.0").signal("out", "%QX0.0").write(directory);
        Tickbus bus = Tickbus.open(cfg);
        for (int i = 0; i < 20; i++) {
            bus.signal("in").set(i % 2 == 0);
            bus.exchange();
        }
        assertEquals(1, bus.pollEvents((signal, value, time) -> bus.close()));
    }

    /** Ends a JVM in the middle of a tick, with its driver open. */
    private String recordedAtTheEnd(String how) throws Exception {
        Path recording = directory.resolve(how + ".csv");
        Path cfg = DriverCfg.mirror(1).signal("in", "%IW0").signal("out", "%QX0.0").write(directory);
        ChildJvm.Outcome outcome = new ChildJvm().with("--enable-native-access=ALL-UNNAMED")
            .with("-Dtickbus.native.dir=" + System.getProperty("tickbus.native.dir"))
            .with("-cp", ChildJvm.classPath(), EndInATick.class.getName(), cfg.toString(), recording.toString(), how).run();
        assertEquals(new ChildJvm.Outcome(how.equals("hook") ? 3 : 0, how.equals("hook") ? "closed\n" : ""), outcome);
        List<String> lines = Files.readAllLines(recording);
        return lines.get(lines.size() - 1);
    }

    @Test
    void theEndOfTheJvmClosesWhatIsOpen() throws Exception {
        for (String how : List.of("return", "exit", "hook")) {
            String last = recordedAtTheEnd(how);
            assertTrue(last.contains("4711"), how + ": " + last);
        }
    }

    @Test
    void aWrongDriverCfgIsShownWithEveryMistakeAtItsPlace() throws IOException {
        Path cfg = Files.writeString(directory.resolve("wrong.cfg"), """
            [driver]
            name = "No id"

            [fieldbus]
            kind = "loopback"
            program = "mirror"

            [[signal]]
            name = "too high a bit"
            address = "%QX1.9"

            [[signal]]
            name = "not an address"
            address = "%ZW1"
            """);
        FieldbusException wrong = assertStatus(Status.BAD_CONFIG, () -> Tickbus.open(cfg));
        List<String> places = wrong.getMessage().lines().filter(line -> line.matches(".*wrong\\.cfg:\\d+:\\d+: .+; .+")).toList();
        assertEquals(3, places.size(), wrong::getMessage);
    }

    @Test
    void aMissingFileIsNamed() {
        Path missing = directory.resolve("missing.cfg");
        FieldbusException wrong = assertStatus(Status.BAD_CONFIG, () -> Tickbus.open(missing));
        assertTrue(wrong.getMessage().contains(missing.toString()), wrong::getMessage);
    }

    @Test
    void aFailedOpenLeavesThePlaceFree() {
        Path missing = directory.resolve("missing.cfg");
        for (int i = 0; i < 200; i++) {
            assertStatus(Status.BAD_CONFIG, () -> Tickbus.open(missing));
        }
        Tickbus.open(mirror()).close();
    }
}
