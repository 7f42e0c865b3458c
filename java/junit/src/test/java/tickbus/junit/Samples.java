package tickbus.junit;

import static org.junit.jupiter.api.Assertions.assertThrows;
import static tickbus.junit.Condition.above;
import static tickbus.junit.Condition.is;
import static tickbus.junit.Condition.near;
import static tickbus.junit.Condition.nothingSwallowed;
import static tickbus.junit.Condition.off;
import static tickbus.junit.Condition.on;
import static tickbus.junit.Condition.rises;
import static tickbus.junit.Condition.when;

import java.lang.annotation.Retention;
import java.lang.annotation.RetentionPolicy;
import org.junit.jupiter.api.BeforeAll;
import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.Nested;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.ValueSource;
import tickbus.InjectedFault;

/** Tests run by {@link PlcTestTest}; many of them are expected to fail. */
final class Samples {
    private Samples() {
    }

    /** A user-defined annotation. */
    @Retention(RetentionPolicy.RUNTIME)
    @PlcTest(config = "line.cfg", step = "2ms")
    @interface LineTest {
    }

    /** A machine that rises while Run is on. */
    static final class Lift implements Machine {
        private double height;
        private long last;

        @Override
        public void connect(Plc plc) {
            plc.set("Height", 100);
            height = 100;
        }

        @Override
        public void step(Plc plc, long simulationNanos) {
            if (simulationNanos != last + plc.stepNanos()) {
                throw new AssertionError("a step to " + simulationNanos + " after " + last);
            }
            last = simulationNanos;
            height += plc.isOn("Run") ? 1 : 0;
            plc.set("Height", height);
        }
    }

    @LineTest
    static class Green {
        private boolean began;

        @BeforeEach
        void begin(Plc plc) {
            began = plc.ticks() == 0;
        }

        @Test
        void everyTestBeginsAtTickNull(Plc plc) {
            check(began && plc.ticks() == 0 && plc.simulationNanos() == 0 && !plc.isOn("Start"));
            plc.set("Start", true).tick();
            plc.expect(on("Run"));
        }

        @Test
        void againAtTickNull(Plc plc) {
            check(began && plc.ticks() == 0);
            plc.expect(off("Start").and(off("Run")));
        }

        @ParameterizedTest
        @ValueSource(ints = {-300, 7, 32_767})
        void valuesComeBack(int value, Plc plc) {
            plc.set("Height", value);
            check(plc.await(is("Speed", value)).within(3) == 1);
            plc.expect(near("Speed", value + 0.5, 0.5));
        }

        @Test
        void durationsAreWholeTicks(Plc plc) {
            check(plc.run("3ms").ticks() == 2 && plc.run("4ms").ticks() == 4 && plc.tick(0).ticks() == 4);
            check(plc.simulationNanos() == 8_000_000 && plc.id() == 7);
        }

        @Test
        void forcedSignalsStayWhatTheMachineSays(Plc plc) {
            plc.connect(new Lift());
            plc.force("Height", 5).tick(10);
            plc.expect(is("Height", 5).and(is("Speed", 5)));
            plc.force("Height", 6).tick();
            plc.expect(is("Speed", 6));
            plc.release("Height").tick();
            plc.expect(is("Speed", 100));
        }

        @Test
        void pressedButtonsAreReleased(Plc plc) {
            plc.press("Start");
            plc.expect(on("Run"));
            plc.await(off("Run")).within(2);
            check(plc.ticks() == 101 && plc.rises("Run") == 1 && plc.falls("Run") == 1 && plc.falls("Start") == 1);
        }

        @Test
        void faultsAreInjectedAndEnded(Plc plc) {
            plc.set("Start", true).tick();
            InjectedFault wire = plc.inject("kind = \"stuck\"\nsignal = \"Start\"\nvalue = false");
            plc.await(off("Run")).within(3);
            check(wire.isActive() && plc.faults().size() == 1);
            wire.end();
            plc.await(on("Run")).within(3);
        }

        @Test
        void aMachineHasFaultsByName(Plc plc) {
            plc.connect(new SweepSamples.Wired()).tick();
            plc.inject("kind = \"model\"\nname = \"wire\"");
            plc.tick().expect(is("Height", 0));
            plc.tick().expect(is("Height", 99));
            Exception twice = assertThrows(IllegalArgumentException.class, () -> plc.connect(new SweepSamples.Wired()));
            check(twice.getMessage().contains("two faults of the machines are called \"wire\""));
        }

        @Test
        void conditionsJoin(Plc plc) {
            plc.expect(on("Run").or(off("Run")));
            plc.expect(on("Run").negated().and(above("Speed", -1)));
            plc.expect(off("Run")).during("20ms").expect(off("Start")).during(5);
            check(plc.ticks() == 15);
        }

        @PlcTest(step = "5ms", machine = Lift.class)
        void aMethodAddsToItsClass(Plc plc, Lift lift, Machine same) {
            check(plc.stepNanos() == 5_000_000 && lift == same);
            plc.force("Start", true).tick(11);
            // The first exchange delivers Run, so the lift has taken ten steps with it.
            check(lift.height == 110);
        }

        @PlcTest(program = "mirror", scan = "10ms")
        void changesThatTheProgramSeesAreNotSwallowed(Plc plc) {
            plc.always(nothingSwallowed()).set("Start", true).run("10ms").set("Start", false).run("20ms");
            plc.expect(nothingSwallowed("Start", "Run"));
        }

        @Nested
        class Inner {
            @Test
            void hasWhatTheClassAroundItSays(Plc plc) {
                check(plc.stepNanos() == 2_000_000);
            }
        }
    }

    @LineTest
    static class Red {
        @Test
        void await(Plc plc) {
            plc.set("Height", 2).tick(3);
            plc.set("Height", 3).tick(2);
            plc.await(above("Speed", 3)).within("40ms");
        }

        @Test
        void expect(Plc plc) {
            plc.expect(on("Run"));
        }

        @Test
        void during(Plc plc) {
            plc.set("Start", true);
            plc.expect(off("Run")).during("1s");
        }

        @Test
        void never(Plc plc) {
            plc.never(on("Run"));
            plc.tick(3).press("Start");
        }

        @PlcTest(program = "mirror", scan = "10ms")
        void swallowed(Plc plc) {
            plc.tick(3);
            plc.set("Start", true).tick().set("Start", false).tick(2);
            plc.expect(nothingSwallowed("Run"));
            plc.expect(nothingSwallowed());
        }

        @PlcTest(program = "mirror", scan = "10ms")
        void alwaysUnswallowed(Plc plc) {
            plc.always(nothingSwallowed("Start"));
            plc.tick(3);
            plc.set("Start", true).tick().set("Start", false).tick(9);
        }

        @Test
        void swallowedOfNone(Plc plc) {
            plc.expect(nothingSwallowed("Strat"));
        }

        @Test
        void edge(Plc plc) {
            plc.set("Start", true).tick();
            plc.await(rises("Run")).within(5);
        }

        @Test
        void both(Plc plc) {
            plc.await(off("Run").and(is("Speed", 4))).within(1);
        }

        @Test
        void words(Plc plc) {
            plc.await(when("the cow is in the barn", () -> false)).within(2);
        }

        @Test
        void forgotten(Plc plc) {
            plc.await(on("Run"));
        }

        @Test
        void otherAssertion(Plc plc) {
            plc.tick(12);
            throw new AssertionError("of the test's own");
        }

        @Test
        void unknownSignal(Plc plc) {
            plc.expect(on("Rnu"));
        }

        @Test
        void notOurs(Plc plc) {
            plc.set("Run", true);
        }

        @Test
        void noLimit(Plc plc) {
            plc.await(on("Run")).within(0);
        }

        @Test
        void shortLimit(Plc plc) {
            plc.await(on("Run")).within("1ms");
        }

        @Test
        void backwards(Plc plc) {
            plc.tick(-1);
        }

        @Test
        void machineThatTicks(Plc plc) {
            plc.connect((same, nanos) -> same.tick()).tick();
        }

        @PlcTest(machine = Needy.class)
        void machineThatNeedsSomething(Plc plc) {
            throw new IllegalStateException("not reached");
        }

        @PlcTest(step = "0s")
        void noStep(Plc plc) {
            throw new IllegalStateException("not reached");
        }

        @PlcTest(step = "soon")
        void badStep(Plc plc) {
            throw new IllegalStateException("not reached");
        }

        @PlcTest(config = "lien.cfg")
        void noSuchFile(Plc plc) {
            throw new IllegalStateException("not reached");
        }

        @PlcTest(program = "rigg")
        void noSuchProgram(Plc plc) {
            throw new IllegalStateException("not reached");
        }

        @PlcTest(program = "mirror", options = "speed")
        void badOption(Plc plc) {
            throw new IllegalStateException("not reached");
        }

        @PlcTest(config = "socket.cfg")
        void nobodyAtTheOtherEnd(Plc plc) {
            throw new IllegalStateException("not reached");
        }

        @PlcTest(config = "socket.cfg", program = "mirror")
        void plantOnASocket(Plc plc) {
            plc.set("Start", true).tick();
            plc.expect(on("Run"));
            throw new AssertionError("reached");
        }
    }

    /** A machine without a default constructor. */
    static final class Needy implements Machine {
        Needy(int size) {
            if (size < 0) {
                throw new IllegalArgumentException();
            }
        }

        @Override
        public void step(Plc plc, long simulationNanos) {
            plc.set("Start", true);
        }
    }

    static class NoConfig {
        @PlcTest
        void test(Plc plc) {
            throw new IllegalStateException("not reached");
        }
    }

    @LineTest
    static class ForTheWholeClass {
        @BeforeAll
        static void begin(Plc plc) {
            throw new IllegalStateException("not reached");
        }

        @Test
        void test() {
            throw new IllegalStateException("not reached");
        }
    }

    private static void check(boolean fulfilled) {
        if (!fulfilled) {
            throw new AssertionError("not so");
        }
    }
}
