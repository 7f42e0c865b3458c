package tickbus.junit;

import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.junit.jupiter.api.Assumptions.assumeTrue;
import static tickbus.junit.Condition.is;
import static tickbus.junit.Condition.on;

import java.util.List;
import org.junit.jupiter.api.BeforeEach;

/** Sweeps run by {@link FaultSweepTest}; many of their runs are expected to fail. */
final class SweepSamples {
    /** The sweep of tests/it/sweep.rs. */
    static final String KEYS = """
        signals   = ["Start", "Height"]
        kinds     = ["stuck-on", "stuck-off", { kind = "late", by = "6ms" }, "frozen", "line-down",
                     { kind = "noise", amplitude = 200, chance = 0.5 }]
        moments   = { "at rest" = "not Run", runs = "Run", moves = "Speed == 5" }
        told      = "Speed == 99"
        never     = "Speed < 0"
        within    = "100ms"
        tolerance = "4ms"
        """;

    private SweepSamples() {
    }

    /** A machine whose fault shows a height of 99, which is taken for the alarm. */
    static final class Wired implements Machine {
        private boolean broken;

        @Override
        public List<String> faults() {
            return List.of("wire");
        }

        @Override
        public void fault(String name, double value) {
            broken = value != 0;
        }

        @Override
        public void step(Plc plc, long simulationNanos) {
            if (broken) {
                plc.set("Height", 99);
            }
        }
    }

    /** When Run falls, Height jumps to 99 after 4 ms, which is taken for the alarm. */
    static final class Alarm implements Machine {
        private static final long AFTER = 4_000_000;
        private long falls;
        private long due = Long.MAX_VALUE;

        @Override
        public void step(Plc plc, long simulationNanos) {
            if (plc.falls("Run") > falls) {
                falls = plc.falls("Run");
                due = simulationNanos + AFTER;
            }
            if (simulationNanos >= due) {
                due = Long.MAX_VALUE;
                plc.set("Height", 99);
            }
        }
    }

    private static void rise(Plc plc) {
        plc.tick(5).set("Start", true).tick(10).expect(on("Run"));
        plc.set("Height", 5).tick(10).set("Height", 6).tick(10);
    }

    @PlcTest(config = "line.cfg", program = "mirror", scan = "2ms", step = "2ms", machine = Alarm.class,
        recording = Recording.NEVER)
    static class Lift {
        @FaultSweep(KEYS)
        void rises(Plc plc) {
            rise(plc);
        }

        @FaultSweep("""
            signals = ["Start"]
            kinds   = [{ kind = "late", by = "6ms" }]
            moments = { "at rest" = "not Run" }
            told    = "Speed == 99"
            within  = "100ms"
            """)
        void watches(Plc plc) {
            plc.tick(5).set("Start", true).await(Condition.rises("Start")).within(1);
            plc.set("Height", 5).tick(10);
        }
    }

    @PlcTest(config = "line.cfg", program = "mirror", scan = "2ms", step = "2ms", machine = Alarm.class,
        recording = Recording.NEVER)
    static class Careless {
        /** The same sweep: its own assertions and its waits do not count under a fault. */
        @FaultSweep(KEYS)
        void rises(Plc plc) {
            plc.tick(5).set("Start", true).tick(10).expect(on("Run")).during(1);
            assertTrue(plc.isOn("Run"), "it runs");
            plc.set("Height", 5).await(is("Speed", 5)).within(10);
            plc.tick(8).set("Height", 6).tick(10);
        }
    }

    @PlcTest(config = "line.cfg", program = "mirror", scan = "2ms", step = "2ms", machine = Alarm.class,
        recording = Recording.NEVER)
    static class Prepared {
        @BeforeEach
        void start(Plc plc) {
            plc.tick(5).set("Start", true).await(on("Run")).within(10);
        }

        @FaultSweep("""
            signals = ["Start"]
            kinds   = ["stuck-off", "stuck-on"]
            moments = { "at rest" = "not Run", runs = "Run" }
            told    = "Speed == 99"
            within  = "100ms"
            """)
        void rises(Plc plc) {
            plc.tick(10).set("Height", 5).tick(10);
        }

        @FaultSweep(KEYS)
        void assumes(Plc plc) {
            assumeTrue(plc.tick(10).isOn("Run"), "it runs");
            plc.set("Height", 5).tick(10).set("Height", 6).tick(10);
        }
    }

    @PlcTest(config = "line.cfg", program = "mirror", scan = "2ms", step = "2ms", machine = Wired.class,
        recording = Recording.NEVER)
    static class Model {
        private static final String REST = "moments = \"Run\"\ntold = \"Speed == 99\"\nwithin = \"100ms\"\n";

        @FaultSweep("kinds = [\"model\"]\n" + REST)
        void rises(Plc plc) {
            rise(plc);
        }

        @FaultSweep("kinds = [{ kind = \"model\", name = \"wier\" }]\n" + REST)
        void unknownFault(Plc plc) {
            rise(plc);
        }
    }

    @PlcTest(config = "line.cfg", program = "mirror", scan = "2ms", step = "2ms", machine = Alarm.class)
    static class Recorded {
        @FaultSweep("""
            kinds   = ["late", "frozen"]
            moments = { "at rest" = "not Run", runs = "Run", moves = "Speed == 5" }
            signals = ["Height"]
            told    = "Speed == 99"
            within  = "100ms"
            """)
        void rises(Plc plc) {
            rise(plc);
        }
    }

    @PlcTest(config = "line.cfg", program = "mirror", scan = "2ms", step = "2ms", recording = Recording.NEVER)
    static class Wrong {
        private static final String REST = "told = \"Speed == 99\"\nwithin = \"20ms\"\n";

        @FaultSweep("signals = [\"Strat\"]\nmoments = \"Run\"\n" + REST)
        void unknownSignal(Plc plc) {
            rise(plc);
        }

        @FaultSweep("kinds = [\"stuck\"]\nmoments = \"Run\"\n" + REST)
        void unknownKind(Plc plc) {
            rise(plc);
        }

        @FaultSweep("kinds = [\"model\"]\nmoments = \"Run\"\n" + REST)
        void noFaultsOfTheModel(Plc plc) {
            rise(plc);
        }

        @FaultSweep("moments = { \"far up\" = \"Speed == 7\" }\n" + REST)
        void momentThatNeverComes(Plc plc) {
            rise(plc);
        }

        @FaultSweep("moments = \"Run\"\nscenario = \"rises\"\n" + REST)
        void scenarioInTheKeys(Plc plc) {
            rise(plc);
        }

        @FaultSweep("moments = \"Run\"\ntold = \"Speed == 5\"\nwithin = \"20ms\"\n")
        void toldWithoutAFault(Plc plc) {
            rise(plc);
        }

        @FaultSweep("moments = \"Run\"\n" + REST)
        void failsWithoutAFault(Plc plc) {
            rise(plc);
            plc.expect(is("Speed", 7));
        }
    }
}
