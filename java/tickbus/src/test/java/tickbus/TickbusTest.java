package tickbus;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertNotEquals;
import static org.junit.jupiter.api.Assertions.assertSame;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.net.URI;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.function.BooleanSupplier;
import java.util.stream.IntStream;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.condition.EnabledOnOs;
import org.junit.jupiter.api.condition.OS;
import org.junit.jupiter.api.function.Executable;
import org.junit.jupiter.api.io.TempDir;

@Tag("native")
class TickbusTest {
    private static final long TICK = 1_000_000;

    @TempDir
    Path directory;

    private long now;

    /** In stepped mode the mirror's answer arrives within at most a few scans. */
    private void tick(Tickbus bus) {
        for (int i = 0; i < 4; i++) {
            now += TICK;
            assertTrue(bus.exchange(now) >= 0);
        }
    }

    /** Exchanges until this is true; fails if it never is. */
    private static void exchangeUntil(BooleanSupplier reached, Tickbus... buses) {
        long deadline = System.nanoTime() + 20_000_000_000L;
        while (!reached.getAsBoolean()) {
            assertTrue(System.nanoTime() < deadline, "did not come in 20 s");
            for (Tickbus bus : buses) {
                bus.exchange();
            }
            Thread.onSpinWait();
        }
    }

    /** The times of a recording's rows. */
    private List<String> times(Path recording) throws IOException {
        return Files.readAllLines(recording).stream().filter(line -> line.startsWith("#")).toList();
    }

    @Test
    void theLineTakesTheChangesOfItsFileWhileTheSimulationTicks() throws IOException {
        String first = DriverCfg.freshLink();
        String second = DriverCfg.freshLink();
        Path file = DriverCfg.link(1, first, "device").signal("in", "%IB0").signal("out", "%QB0").write(directory);
        try (Tickbus machine = Tickbus.open(file);
                Tickbus plc = DriverCfg.link(2, second, "controller").signal("in", "%IB0").signal("out", "%QB0")
                    .open(directory)) {
            assertFalse(machine.reload(), "nothing has changed");
            Files.writeString(file, Files.readString(file).replace(first, second));
            assertTrue(machine.reload());
            plc.signal("out").set(9);
            exchangeUntil(() -> machine.signal("out").get() == 9, machine, plc);
            Files.writeString(file, Files.readString(file).replace("%QB0", "%QB1"));
            String refused = assertThrows(FieldbusException.class, machine::reload).getMessage();
            assertTrue(refused.contains("signal 2 \"out\" has another address"), refused);
            plc.signal("out").set(10);
            exchangeUntil(() -> machine.signal("out").get() == 10, machine, plc);
        }
    }

    @Test
    void aTickThatWasReceivedAndNotAnsweredIsRecordedWhenTheDriverCloses() throws IOException {
        List<List<String>> runs = new ArrayList<>();
        for (boolean answered : new boolean[] {true, false}) {
            DriverCfg cfg = DriverCfg.mirror(1).fieldbus("[record]\nfile = \"" + answered + ".vcd\"").signal("a", "%QX0.0");
            try (Tickbus bus = cfg.open(directory)) {
                assertTrue(bus.exchange(TICK) >= 0);
                assertTrue(bus.receive(2 * TICK) >= 0);
                if (answered) {
                    bus.send();
                }
            }
            runs.add(times(directory.resolve(answered + ".vcd")));
        }
        assertEquals(2, runs.get(0).size());
        assertEquals(runs.get(0), runs.get(1));
    }

    /** A name in Latin-1, on a system that names its files in UTF-8. */
    @Test
    @EnabledOnOs(OS.LINUX)
    void aFolderWhoseNameIsNoTextIsOpened() throws IOException {
        Path folder = Files.createDirectory(Path.of(URI.create(directory.toUri() + "pr%FCfung")));
        try (Tickbus bus = DriverCfg.mirror(1).signal("a", "%QX0.0").open(folder)) {
            assertTrue(bus.exchange(TICK) >= 0);
        }
    }

    @Test
    void everyTypeGoesThereAndBack() {
        DriverCfg cfg = DriverCfg.mirror(1);
        String[][] types = {{"BYTE", "B0"}, {"SINT", "B1"}, {"USINT", "B2"}, {"WORD", "W4"}, {"INT", "W6"},
            {"UINT", "W8"}, {"DWORD", "D12"}, {"DINT", "D16"}, {"UDINT", "D20"}, {"REAL", "D24"}, {"LWORD", "L32"},
            {"LINT", "L40"}, {"ULINT", "L48"}, {"LREAL", "L56"}};
        double[] values = {255, -128, 200, 0xABCD, -12345, 54321, 4e9, -2e9, 3e9, 0.5, 7, -9, 0x1p63, Math.PI};
        for (String[] type : types) {
            cfg.signal(type[0] + " in", "%I" + type[1], "type = \"" + type[0] + "\"");
            cfg.signal(type[0] + " out", "%Q" + type[1], "type = \"" + type[0] + "\"");
        }
        try (Tickbus bus = cfg.open(directory)) {
            for (int i = 0; i < types.length; i++) {
                bus.signal(types[i][0] + " in").set(values[i]);
            }
            tick(bus);
            for (int i = 0; i < types.length; i++) {
                assertEquals(values[i], bus.signal(types[i][0] + " out").get(), types[i][0]);
            }
        }
    }

    @Test
    void sixtyFourBitsAreExact() {
        long odd = 0x7EDC_BA98_7654_3211L;
        try (Tickbus bus = DriverCfg.mirror(1).signal("in", "%IL0", "type = \"LINT\"")
            .signal("out", "%QL0", "type = \"LINT\"").signal("unsigned", "%IL8", "type = \"ULINT\"")
            .signal("back", "%QL8", "type = \"ULINT\"").signal("int", "%IW16", "type = \"INT\"").open(directory)) {
            bus.signal("in").setLong(-odd);
            bus.signal("unsigned").setLong(-1);
            tick(bus);
            assertEquals(-odd, bus.signal("out").getLong());
            assertEquals((double) -odd, bus.signal("out").get());
            assertEquals(-1, bus.signal("back").getLong());
            assertEquals(0x1p64, bus.signal("back").get());
            assertTrue(bus.signal("back").getBoolean());
            assertThrows(IllegalArgumentException.class, () -> bus.signal("int").setLong(odd));
            bus.signal("int").setLong(-77);
            assertEquals(-77, bus.signal("int").getLong());
        }
    }

    @Test
    void bitsAndScaledValuesGoThereAndBack() {
        String scale = "scale = { raw = [0, 27648], value = [0.0, 250.0] }";
        try (Tickbus bus = DriverCfg.mirror(1).signal("bit", "%IX0.3").signal("bit back", "%QX0.3")
            .signal("height", "%IW2", "type = \"INT\"", "unit = \"mm\"", scale)
            .signal("height back", "%QW2", "type = \"INT\"", "unit = \"mm\"", scale).open(directory)) {
            bus.signal("bit").setBoolean(true);
            bus.signal("height").set(125);
            tick(bus);
            assertTrue(bus.signal("bit back").getBoolean());
            assertEquals(1, bus.signal("bit back").get());
            assertEquals(1, bus.signal("bit back").getLong());
            assertEquals(125, bus.signal("height back").get());
            bus.signal("bit").set(0);
            tick(bus);
            assertFalse(bus.signal("bit back").getBoolean());
        }
    }

    @Test
    void signalsKnowWhatTheyAre() {
        try (Tickbus bus = DriverCfg.mirror(4711).signal("LA1 position", "%IW4", "type = \"INT\"", "unit = \"mm\"")
            .signal("LA1 run", "%QX5.2", "latch = \"rising\"").open(directory)) {
            assertEquals(4711, bus.id());
            assertEquals("Driver 4711", bus.name());
            assertEquals("Driver 4711 (4711)", bus.toString());
            Signal position = bus.signal("LA1 position");
            Signal run = bus.signal("LA1 run");
            assertEquals(List.of(position, run), bus.signals());
            assertSame(position, bus.signal("LA1 position"));
            assertEquals("LA1 position (%IW4 INT)", position.toString());
            assertEquals("mm", position.unit());
            assertEquals("", position.station());
            assertTrue(position.isWritten());
            assertFalse(position.isLatched());
            assertEquals("%QX5.2", run.address());
            assertEquals("BOOL", run.type());
            assertEquals("", run.unit());
            assertFalse(run.isWritten());
            assertTrue(run.isLatched());
        }
    }

    @Test
    void wrongUseOfASignalSaysWhatIsWrong() {
        try (Tickbus bus = DriverCfg.mirror(1).signal("LA1 position", "%IW4", "type = \"INT\"")
            .signal("LA1 run", "%QX5.2").open(directory)) {
            Signal position = bus.signal("LA1 position");
            Signal run = bus.signal("LA1 run");
            assertEquals("driver 'Driver 1' has no signal 'la1 rum'; did you mean 'LA1 run'?",
                assertThrows(IllegalArgumentException.class, () -> bus.signal("la1 rum")).getMessage());
            assertEquals("signal 'LA1 run' at %QX5.2 is written by the other end;"
                    + " only signals that this end writes can be set",
                assertThrows(IllegalStateException.class, () -> run.set(1)).getMessage());
            assertThrows(IllegalStateException.class, () -> run.setBoolean(true));
            assertThrows(IllegalStateException.class, () -> run.setLong(1));
            for (double value : new double[] {Double.NaN, Double.POSITIVE_INFINITY, Double.NEGATIVE_INFINITY}) {
                assertEquals("signal 'LA1 position' cannot be set to " + value + "; a finite number is needed",
                    assertThrows(IllegalArgumentException.class, () -> position.set(value)).getMessage());
            }
            assertEquals("signal 'LA1 run' counts no edges; add `latch = \"rising\"` to it in driver.cfg",
                assertThrows(IllegalStateException.class, run::edges).getMessage());
            assertThrows(IllegalStateException.class, position::edges);
        }
    }

    @Test
    void edgesAreCountedOnce() {
        String latch = "latch = \"rising\"";
        try (Tickbus bus = DriverCfg.mirror(1).signal("in", "%IX0.0", latch).signal("out", "%QX0.0", latch)
            .open(directory)) {
            long edges = 0;
            for (int pulse = 0; pulse < 5; pulse++) {
                for (boolean level : new boolean[] {true, false}) {
                    bus.signal("in").setBoolean(level);
                    for (int i = 0; i < 4; i++) {
                        now += TICK;
                        bus.exchange(now);
                        edges += bus.signal("out").edges();
                    }
                }
            }
            assertEquals(5, edges);
        }
    }

    @Test
    void allSignalsMoveAtOnce() {
        try (Tickbus bus = DriverCfg.mirror(1).signal("first", "%IX0.0").signal("second back", "%QL8", "type = \"LINT\"")
            .signal("second", "%IL8", "type = \"LINT\"").signal("first back", "%QX0.0").open(directory)) {
            double[] inputs = new double[3];
            bus.setAll(new double[] {1, -9});
            tick(bus);
            assertEquals(2, bus.getAll(inputs));
            assertArrayEquals(new double[] {-9, 1, 0}, inputs);
            bus.setAll(new double[] {Double.NaN, Double.NaN});
            tick(bus);
            assertEquals("driver 'Driver 1' has 2 signals to write, but was given 3 values",
                assertThrows(IllegalArgumentException.class, () -> bus.setAll(new double[3])).getMessage());
            assertEquals("driver 'Driver 1' has 2 signals to read, but the array has 1 places",
                assertThrows(IllegalArgumentException.class, () -> bus.getAll(new double[1])).getMessage());
        }
    }

    @Test
    void whatA64BitIntegerCannotHoldIsCountedAndNanIsItsFailSafeValue() {
        try (Tickbus bus = DriverCfg.mirror(1).signal("in", "%IL0", "type = \"LINT\"\nfail_safe = -7")
                .signal("back", "%QL0", "type = \"LINT\"").open(directory)) {
            bus.setAll(new double[] {Double.NaN});
            tick(bus);
            assertEquals(-7, bus.signal("back").getLong());
            bus.setAll(new double[] {1e300});
            tick(bus);
            assertEquals(Long.MAX_VALUE, bus.signal("back").getLong());
            bus.signal("in").set(-1e300);
            tick(bus);
            assertEquals(Long.MIN_VALUE, bus.signal("back").getLong());
            assertEquals("1", bus.statistics().get("not_a_number"));
            assertEquals("2", bus.statistics().get("saturated"));
        }
    }

    @Test
    void aLinkWithNobodyAtItsOtherEndIsStale() {
        try (Tickbus bus = DriverCfg.link(1, DriverCfg.freshLink(), "device").signal("in", "%IX0.0").open(directory)) {
            assertEquals(Status.STALE.code(), bus.exchange());
            assertEquals(0, bus.sequence());
            assertEquals(Long.MAX_VALUE, bus.ageNanos());
            assertEquals("1", bus.statistics().get("stale"));
        }
    }

    @Test
    void twoDriversTalkToEachOther() {
        String link = DriverCfg.freshLink();
        try (Tickbus machine = DriverCfg.link(1, link, "device").signal("sensor", "%ID0", "type = \"REAL\"")
                .signal("motor", "%QX0.0", "latch = \"rising\"").open(directory);
            Tickbus plc = DriverCfg.link(2, link, "controller").signal("sensor", "%ID0", "type = \"REAL\"")
                .signal("motor", "%QX0.0").open(directory)) {
            assertFalse(plc.signal("sensor").isWritten());
            machine.signal("sensor").set(0.25);
            plc.signal("motor").setBoolean(true);
            Signal motor = machine.signal("motor");
            long[] edges = new long[1];
            exchangeUntil(() -> {
                edges[0] += motor.edges();
                return motor.getBoolean();
            }, machine, plc);
            exchangeUntil(() -> plc.signal("sensor").get() == 0.25, machine, plc);
            exchangeUntil(() -> machine.exchange() == Status.UNCHANGED.code(), plc);
            assertEquals(0, motor.edges());
            assertEquals(1, edges[0]);
            assertNotEquals(0, machine.sequence());
            assertTrue(machine.ageNanos() < 20_000_000_000L);
        }
    }

    @Test
    void aModelBetweenTheHalvesAnswersWithinTheTick() {
        String link = DriverCfg.freshLink();
        try (Tickbus machine = DriverCfg.link(1, link, "device").signal("sensor", "%IX0.0", "latch = \"rising\"")
                .signal("motor", "%QX0.0", "latch = \"rising\"").open(directory);
            Tickbus plc = DriverCfg.link(2, link, "controller").signal("sensor", "%IX0.0", "latch = \"rising\"")
                .signal("motor", "%QX0.0", "latch = \"rising\"").open(directory)) {
            Signal motor = machine.signal("motor");
            plc.signal("motor").setBoolean(true);
            exchangeUntil(() -> {
                assertTrue(machine.receive() >= 0);
                if (motor.edges() == 0) {
                    machine.send();
                    return false;
                }
                assertTrue(motor.getBoolean());
                machine.signal("sensor").setBoolean(true);
                machine.send();
                return true;
            }, plc);
            // The machine no longer ticks: its answer is on the line.
            exchangeUntil(() -> plc.signal("sensor").getBoolean(), plc);
            assertEquals(1, plc.signal("sensor").edges());
        }
    }

    @Test
    void halvesAreOneTickOnASteppedBus() {
        try (Tickbus bus = DriverCfg.mirror(1).signal("in", "%IW0", "type = \"INT\"")
            .signal("out", "%QW0", "type = \"INT\"").open(directory)) {
            for (int tick = 0; tick < 20; tick++) {
                assertEquals(Status.FRESH.code(), bus.receive(tick * TICK));
                assertEquals(tick, bus.signal("out").get());
                assertEquals((tick + 1) * TICK, bus.grantedNanos());
                bus.signal("in").set(tick + 1);
                bus.send();
            }
            assertEquals("20", bus.statistics().get("ticks"));
        }
    }

    @Test
    void timeThatGoesBackIsRefusedOnASteppedBus() {
        try (Tickbus bus = DriverCfg.mirror(1).signal("in", "%IX0.0").open(directory)) {
            bus.exchange(5 * TICK);
            List<Executable> back = List.of(() -> bus.exchange(TICK), () -> bus.receive(TICK), bus::send);
            for (Executable call : back) {
                FieldbusException refused = assertThrows(FieldbusException.class, call);
                assertEquals(Status.BUS_FAILED, refused.status());
                assertTrue(refused.getMessage().contains("simulation time went back from 5ms to 1ms"),
                    refused::getMessage);
            }
            assertEquals(Status.FRESH.code(), bus.exchange(6 * TICK));
        }
    }

    @Test
    void withoutATimeAnExchangeIsOneStep() {
        try (Tickbus bus = DriverCfg.mirror(1).signal("in", "%IX0.0").open(directory)) {
            for (int tick = 1; tick <= 3; tick++) {
                bus.exchange();
                assertEquals(tick * TICK, bus.grantedNanos());
            }
            assertEquals("3", bus.statistics().get("plc.scans"));
        }
    }

    @Test
    void simulationTimeIsGranted() {
        try (Tickbus bus = DriverCfg.mirror(1).signal("in", "%IX0.0").open(directory)) {
            bus.exchange(5 * TICK);
            assertTrue(bus.grantedNanos() >= 5 * TICK, "granted " + bus.grantedNanos());
        }
    }

    @Test
    void eventsTellEveryWrite() {
        try (Tickbus bus = DriverCfg.mirror(1).fieldbus("events = true").signal("in", "%IW0", "type = \"INT\"")
            .signal("out", "%QW0", "type = \"INT\"").open(directory)) {
            List<Double> values = new ArrayList<>();
            for (int value = 1; value <= 100; value++) {
                bus.signal("in").set(value);
                now += TICK;
                bus.exchange(now);
            }
            tick(bus);
            int count = bus.pollEvents((signal, value, time) -> {
                assertSame(bus.signal("out"), signal);
                values.add(value);
            });
            assertEquals(100, count);
            assertEquals(100, values.size());
            assertEquals(1, values.get(0));
            assertEquals(100, values.get(99));
            assertEquals(0, bus.pollEvents((signal, value, time) -> values.clear()));
        }
    }

    /** A bus with events whose signal counts up and down, a write by the PLC in each tick. */
    private Tickbus withEvents() {
        return DriverCfg.mirror(1).fieldbus("events = true").signal("in", "%IW0", "type = \"INT\"")
            .signal("out", "%QW0", "type = \"INT\"").open(directory);
    }

    private void writes(Tickbus bus, int from, int to) {
        for (int value = from; value <= to; value++) {
            bus.signal("in").set(value);
            now += TICK;
            bus.exchange(now);
        }
    }

    @Test
    void aHandlerThatThrowsLosesNoEventButItsOwn() {
        try (Tickbus bus = withEvents()) {
            writes(bus, 1, 100);
            List<Double> seen = new ArrayList<>();
            EventHandler throwing = (signal, value, time) -> {
                seen.add(value);
                if (value == 5 || value == 70) {
                    throw new IllegalStateException("at " + value);
                }
            };
            for (int i = 0; i < 2; i++) {
                assertThrows(IllegalStateException.class, () -> bus.pollEvents(throwing));
            }
            assertEquals(30, bus.pollEvents(throwing));
            assertEquals(IntStream.rangeClosed(1, 100).mapToObj(value -> (double) value).toList(), seen);
        }
    }

    @Test
    void eventsThatComeFasterThanTheyAreHandledHoldNobodyUp() {
        try (Tickbus bus = withEvents()) {
            writes(bus, 1, 1);
            int[] value = {1};
            // Each event causes the next one.
            int count = bus.pollEvents((signal, seen, time) -> {
                value[0]++;
                writes(bus, value[0] % 1000, value[0] % 1000);
            });
            assertEquals(4096, count);
            assertEquals(1, bus.pollEvents((signal, seen, time) -> { }));
        }
    }

    @Test
    void statisticsCountTheTicks() {
        try (Tickbus bus = DriverCfg.mirror(1).signal("in", "%IX0.0").open(directory)) {
            tick(bus);
            assertEquals("4", bus.statistics().get("ticks"));
            assertEquals("0", bus.statistics().get("stale"));
            assertTrue(bus.statistics().containsKey("state"));
            assertThrows(UnsupportedOperationException.class, () -> bus.statistics().clear());
        }
    }

    @Test
    void aSignalWithAnEqualsSignIsCountedUnderItsName() {
        try (Tickbus bus = DriverCfg.mirror(1).signal("a=b", "%IX0.0").open(directory)) {
            assertEquals("0", bus.statistics().get("plc.rises.a=b"));
        }
    }

    @Test
    void driversOpenAndCloseAgainAndAgain() {
        Path cfg = DriverCfg.link(1, DriverCfg.freshLink(), "device").signal("in", "%IX0.0").write(directory);
        for (int i = 0; i < 100; i++) {
            try (Tickbus bus = Tickbus.open(cfg)) {
                assertTrue(bus.exchange() >= 0);
            }
        }
    }

    @Test
    void manyDriversAreOpenAtOnce() {
        List<Tickbus> open = new ArrayList<>();
        Path cfg = DriverCfg.mirror(1).signal("in", "%IX0.0").signal("out", "%QX0.0").write(directory);
        try {
            for (int i = 0; i < 200; i++) {
                open.add(Tickbus.open(cfg));
            }
            for (int i = 0; i < open.size(); i++) {
                open.get(i).signal("in").setBoolean(i % 2 == 0);
            }
            open.forEach(this::tick);
            for (int i = 0; i < open.size(); i++) {
                assertEquals(i % 2 == 0, open.get(i).signal("out").getBoolean(), "driver " + i);
            }
        } finally {
            open.forEach(Tickbus::close);
        }
        Tickbus.open(cfg).close();
    }
}
