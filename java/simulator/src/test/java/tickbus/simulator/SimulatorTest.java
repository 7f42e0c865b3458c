package tickbus.simulator;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import com.sun.management.ThreadMXBean;
import java.io.IOException;
import java.lang.management.ManagementFactory;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;
import tickbus.simulator.control.ControlTableException;

class SimulatorTest {
    private static final long STEP = 2_000_000;

    /** Adds its input to its output at each step. */
    private static final class Integrator implements Machine {
        private final ModelFaults faults = new ModelFaults();
        private double input;
        private double sum;
        private double slip;

        Integrator() {
            faults.add("slip", 1, "", "this part of the rate is lost", value -> slip = value);
            faults.add("reset", "the sum is 0", on -> sum = on ? 0 : sum);
        }

        @Override
        public List<ModelFault> modelFaults() {
            return faults.list();
        }

        @Override
        public void fault(String name, double value) {
            faults.set(name, value);
        }

        @Override
        public List<ModelVariable> variables() {
            return List.of(new ModelVariable("input", "1/tick", () -> input), new ModelVariable("slip", "", () -> slip));
        }

        @Override
        public String name() {
            return "integrator";
        }

        @Override
        public List<String> inputs() {
            return List.of("rate");
        }

        @Override
        public List<String> outputs() {
            return List.of("sum");
        }

        @Override
        public void input(int index, double value) {
            input = value;
        }

        @Override
        public double output(int index) {
            return sum;
        }

        @Override
        public void step(long nanos) {
            sum += (1 - slip) * input * nanos / STEP;
        }
    }

    private static final String TABLE = """
            1:speed        |      | scale(2, 0)  | machine:rate
            machine:sum    |      |              | 1:position
            machine:sum    | high | gt(100)      | 2:full
            """;

    @TempDir
    Path folder;

    private final FakeDriver first = new FakeDriver(1, List.of("position", "spare"), List.of("speed"));
    private final FakeDriver second = new FakeDriver(2, List.of("full"), List.of());

    private Simulator simulator(String table, long step, TimeSource time) throws IOException {
        Path file = folder.resolve("control.table");
        Files.writeString(file, table);
        return new Simulator(new DriverSet(List.of(first, second)), new Integrator(), file, step, time);
    }

    @Test
    void aRowReadsTheModelsVariablesAsOfTheStep() throws IOException {
        String table = """
                1:speed       | | | machine:rate
                model:input   | | | 1:position
                              | | SEL("model:input" * 2 + "model:slip" > 15, 0, 1) | 2:full
                """;
        try (Simulator simulator = simulator(table, STEP, TimeSource.system())) {
            first.deliversFirst = true;
            first.answer[0] = 10;
            simulator.tick();
            assertEquals(10, first.got[0]);
            assertEquals(1, second.got[0]);
            assertEquals(0, simulator.probe("model:slip").getAsDouble());
            first.faultListener.machineFault("slip", 0.25);
            assertEquals(0.25, simulator.probe("model:slip").getAsDouble());
            assertEquals(List.of("machine:sum"), simulator.unread(), "nobody needs to read the model's variables");
        }
    }

    @Test
    void aComponentWithTheNameOfAModelsVariableNeedsNoRow() throws IOException {
        FakeDriver sheet = new FakeDriver(9, List.of("model:input", "model:slip", "model:no"), List.of());
        Path file = Files.writeString(folder.resolve("control.table"), "model:input | | scale(0.5, 0) | 9:model:slip\n"
                + " | | const(3) | machine:rate\n");
        try (Simulator simulator = new Simulator(new DriverSet(List.of(sheet)), new Integrator(), file, STEP,
                TimeSource.system())) {
            simulator.tick();
            assertArrayEquals(new double[] {3, 1.5, 0}, sheet.got);
            assertEquals(List.of("9:model:no"), simulator.unconnected());
        }
    }

    @Test
    void twoEqualNamesAreTheUsersMistake() {
        FakeDriver twice = new FakeDriver(1, List.of("a", "a"), List.of());
        assertEquals("drivers and machine integrator: there are two \"1:a\"; names must be unique",
                assertThrows(WrongInput.class, () -> Simulator.endpoints(List.of(twice), new Integrator())).getMessage());
    }

    @Test
    void oneTickAppliesWhatCameLastStepsAndCollects() throws IOException {
        try (Simulator simulator = simulator(TABLE, STEP, TimeSource.system())) {
            first.answer[0] = 10;
            simulator.tick();
            assertArrayEquals(new double[] {0, 0}, first.got, "nothing had been delivered yet");
            assertEquals(STEP, first.time);
            simulator.tick();
            assertArrayEquals(new double[] {20, 0}, first.got, "delivered, applied, stepped and collected");
            for (int i = 0; i < 5; i++) {
                simulator.tick();
            }
            assertEquals(1, second.got[0]);
            assertEquals(7 * STEP, second.time);
            assertEquals(7, simulator.ticks());
            assertEquals(7 * STEP, simulator.simulationNanos());
            assertEquals(120, simulator.probe("machine:sum").getAsDouble());
            assertEquals(1, simulator.probe("high").getAsDouble());
            assertEquals(List.of("1:spare"), simulator.unconnected());
        }
        assertEquals(1, first.exits);
        assertEquals(1, second.exits);
    }

    @Test
    void theMachineHasItsFaultsFromEachDriver() throws IOException {
        try (Simulator simulator = simulator(TABLE, STEP, TimeSource.system())) {
            assertEquals(List.of("slip", "reset"), first.faults);
            assertEquals(first.faults, second.faults);
            first.deliversFirst = true;
            first.answer[0] = 10;
            simulator.tick();
            assertEquals(20, first.got[0]);
            second.faultListener.machineFault("slip", 0.5);
            simulator.tick();
            assertEquals(30, first.got[0]);
            first.faultListener.machineFault("slip", 7);
            simulator.tick();
            assertEquals(30, first.got[0], "1 is the most");
            first.faultListener.machineFault("slip", 0);
            simulator.tick();
            assertEquals(50, first.got[0]);
            IllegalArgumentException wrong = assertThrows(IllegalArgumentException.class,
                    () -> first.faultListener.machineFault("slop", 1));
            assertEquals("the machine has no fault \"slop\"; did you mean \"slip\"?", wrong.getMessage());
        }
    }

    @Test
    void aDriverThatIsToInjectAnUnknownFaultEndsTheRunBeforeItBegins() {
        second.failFaults = new IllegalStateException("the model has no fault \"slop\"");
        WrongInput wrong = assertThrows(WrongInput.class, () -> simulator(TABLE, STEP, TimeSource.system()));
        assertEquals("driver 2, machine integrator: the model has no fault \"slop\"", wrong.getMessage());
        assertEquals(1, first.exits);
        assertEquals(1, second.exits);
    }

    @Test
    void theMachineAnswersADriverThatDeliversFirstWithinTheTick() throws IOException {
        try (Simulator simulator = simulator(TABLE, STEP, TimeSource.system())) {
            first.deliversFirst = true;
            first.answer[0] = 10;
            simulator.tick();
            assertArrayEquals(new double[] {20, 0}, first.got, "delivered, applied, stepped and collected");
            assertEquals(STEP, first.time, "the time at the end of the tick");
        }
    }

    @Test
    void aTickAllocatesNothing() throws IOException {
        ThreadMXBean bean = (ThreadMXBean) ManagementFactory.getThreadMXBean();
        try (Simulator simulator = simulator(TABLE + "1:speed | d | delay(1s) |\nd | r | rising |\n", STEP,
                TimeSource.system())) {
            first.answer[0] = 1;
            long least = Long.MAX_VALUE;
            for (int round = 0; round < 20 && least > 0; round++) {
                long before = bean.getCurrentThreadAllocatedBytes();
                for (int i = 0; i < 1000; i++) {
                    simulator.tick();
                }
                least = Math.min(least, bean.getCurrentThreadAllocatedBytes() - before);
            }
            assertEquals(0, least, "bytes in a thousand ticks");
        }
    }

    @Test
    void runsUntilToldOtherwise() throws IOException {
        try (Simulator simulator = simulator(TABLE, STEP, TimeSource.system())) {
            simulator.run(TickMode.BEST_EFFORT, () -> simulator.ticks() < 10);
            assertEquals(10, simulator.ticks());
            simulator.run(TickMode.BEST_EFFORT, () -> {
                if (simulator.ticks() == 15) {
                    simulator.stop();
                }
                return true;
            });
            assertEquals(16, simulator.ticks(), "a tick that was allowed is finished");
            simulator.run(TickMode.BEST_EFFORT, () -> true);
            assertEquals(16, simulator.ticks());
            assertTrue(simulator.stopped());
        }
    }

    @Test
    void realTimeTicksAtItsDeadlines() throws IOException {
        ManualTime time = new ManualTime();
        try (Simulator simulator = simulator(TABLE, STEP, time)) {
            simulator.run(TickMode.REAL_TIME, () -> simulator.ticks() < 101);
            assertEquals(100 * STEP, time.nanoTime(), "the first tick is at once");
            assertEquals(0, simulator.lateTicks());
            time.advance(5 * STEP + 1);
            simulator.run(TickMode.REAL_TIME, () -> simulator.ticks() < 103);
            assertEquals(0, simulator.lateTicks(), "a pause between runs is no stall");
        }
    }

    @Test
    void aFailingDriverEndsTheRunAndAllAreClosed() throws IOException {
        Simulator simulator = simulator(TABLE, STEP, TimeSource.system());
        try (simulator) {
            simulator.tick();
            second.failTick = new IllegalStateException("no more bus");
            DriverFailure failure = assertThrows(DriverFailure.class,
                    () -> simulator.run(TickMode.BEST_EFFORT, () -> true));
            assertEquals("driver 2 failed in tick 2: no more bus", failure.getMessage());
        }
        simulator.close();
        assertEquals(1, first.exits);
        assertEquals(1, second.exits);
    }

    @Test
    void aDriverThatFailsToCloseDoesNotKeepTheOthersOpen() throws IOException {
        first.failExit = new IllegalStateException("stuck");
        second.failExit = new IllegalStateException("stuck too");
        Simulator simulator = simulator(TABLE, STEP, TimeSource.system());
        DriverFailure failure = assertThrows(DriverFailure.class, simulator::close);
        assertEquals("driver 1 failed to close: stuck", failure.getMessage());
        assertEquals("driver 2 failed to close: stuck too", failure.getSuppressed()[0].getMessage());
        assertEquals(1, second.exits);
    }

    @Test
    void driversAreClosedIfTheTableIsWrong() {
        assertThrows(ControlTableException.class, () -> simulator("nonsense", STEP, TimeSource.system()));
        assertEquals(1, first.exits);
        assertEquals(1, second.exits);
        assertThrows(IllegalArgumentException.class, () -> simulator(TABLE, 0, TimeSource.system()));
    }

    @Test
    void aDriverMustDeliverAsManyValuesAsItHasComponents() throws IOException {
        try (Simulator simulator = simulator(TABLE, STEP, TimeSource.system())) {
            first.answer = new double[] {1, 2};
            assertEquals("driver 1 failed in tick 1: driver 1 delivered 2 values; it has 1 components that the"
                    + " simulation reads", assertThrows(DriverFailure.class, simulator::tick).getMessage());
        }
    }
}
