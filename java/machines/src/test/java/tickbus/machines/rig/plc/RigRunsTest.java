package tickbus.machines.rig.plc;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static tickbus.junit.Condition.falls;
import static tickbus.junit.Condition.is;
import static tickbus.junit.Condition.near;
import static tickbus.junit.Condition.off;
import static tickbus.junit.Condition.on;
import static tickbus.junit.Condition.rises;
import static tickbus.junit.Condition.when;

import org.junit.jupiter.api.BeforeEach;
import org.junit.jupiter.api.DisplayName;
import org.junit.jupiter.api.Nested;
import org.junit.jupiter.api.Test;
import tickbus.junit.Plc;

/** The rig's PLC program without faults. To be read from top to bottom. */
@RigTest
@DisplayName("The rig")
class RigRunsTest {
    @Test
    void lowersItsLiftsAndTurnsItsWheelsHomeAtPowerUp(Plc plc) {
        plc.never(on("Not OK")).never(on("Fault lamp"));
        plc.expect(off("Homing sensor 2"));

        plc.await(on("LA1 run")).within("50ms");
        plc.await(on("LA1 bottom")).within("10s");
        plc.await(on("IM2 jog")).within("2s");
        plc.await(on("Homing sensor 2")).within("10s");
        plc.expect(off("Ready lamp"));

        // Lift 1 brings down a bottle that may be in the sleeve above it since before the power cut.
        plc.await(on("LA1 run").and(on("SC1"))).within("3s");
        plc.await(on("Step 2 complete")).within("1s");
        plc.await(on("LA1 bottom")).within("2s");
        plc.await(on("Ready lamp")).within("1s");

        plc.expect(is("Phase", 2).and(off("SC1")).and(off("SC2"))).during("1min");
    }

    @Test
    void waitsForTheStartButton(Plc plc) {
        plc.await(on("Ready lamp")).within("25s");
        plc.expect(off("IM1 index")).during("5s");

        plc.press("Start button");

        plc.expect(on("Running lamp"));
        plc.expect(off("Ready lamp"));
        plc.expect(is("Step", 1));
        assertEquals(1, plc.rises("IM1 index"));
    }

    @Test
    void ignoresStartWhileItHomes(Plc plc) {
        plc.press("Start button");
        plc.await(on("Ready lamp")).within("25s");
        plc.expect(off("Running lamp")).during("2s");
    }

    @Nested
    class WhileItRuns {
        @BeforeEach
        void start(Plc plc) {
            plc.await(on("Ready lamp")).within("25s");
            plc.press("Start button");
            plc.expect(on("Running lamp"));
            plc.never(on("Not OK"));
        }

        @Test
        void step1IndexesWheel1(Plc plc) {
            plc.expect(on("IM1 index"));
            plc.await(on("Step 1 complete")).within("1s");
            plc.await(is("Step", 2)).within("30ms");
            plc.expect(off("IM1 index"));
        }

        @Test
        void step2LiftsABottleIntoTheChamber(Plc plc) {
            plc.await(is("Step", 2)).within("2s");
            plc.expect(on("LA1 run").and(on("SC1")).and(off("LA1 code low")).and(off("LA1 code high")));
            plc.await(rises("Package sensor 1")).within("1s");
            plc.await(on("Step 2 complete")).within("1s");
            plc.expect(near("LA1 position", 180, 0.1));
        }

        @Test
        void step3LetsGoAndDrawsBack(Plc plc) {
            plc.await(is("Step", 3)).within("3s");
            plc.expect(on("LA1 run").and(on("LA1 code low")).and(off("SC1")));
            plc.await(on("Step 3 complete")).within("1s");
            plc.expect(near("LA1 position", 160, 0.1));
        }

        @Test
        void step4SwapsTheBottlesInTheChamber(Plc plc) {
            plc.await(is("Step", 4)).within("4s");
            plc.expect(on("IM2 index"));
            plc.await(falls("Homing sensor 2")).within("1s");
            plc.await(on("Step 4 complete")).within("1s");
            plc.expect(on("Homing sensor 2"));
        }

        @Test
        void step5TakesABottleUpToTheLamp(Plc plc) {
            plc.await(is("Step", 5)).within("5s");
            plc.expect(on("LA2 run").and(on("LA2 up")).and(on("SC2")).and(on("Lamp")));
            plc.await(on("Step 5 complete")).within("1s");
            plc.expect(near("LA1 position", 180, 0.1));
            plc.expect(near("LA2 position", 180, 0.1));
        }

        @Test
        void step6BringsBothLiftsDown(Plc plc) {
            plc.await(is("Step", 6)).within("6s");
            plc.expect(on("LA1 run").and(on("LA2 run")).and(off("LA2 up")).and(on("Lamp")));
            plc.await(on("LA1 bottom").and(on("LA2 bottom"))).within("1s");
            plc.await(is("Step", 1)).within("100ms");
            plc.expect(is("Cycles", 1));
        }

        @Test
        void itLightsTheLampOnlyWhileLift2Moves(Plc plc) {
            plc.always(on("Lamp").and(on("LA2 run")).or(off("Lamp").and(off("LA2 run"))));
            plc.await(is("Cycles", 3)).within("20s");
        }

        @Test
        void itTurnsNoWheelThroughALift(Plc plc) {
            plc.never(on("IM1 index").and(off("LA1 bottom").or(off("LA2 bottom"))));
            plc.never(on("IM2 index").and(off("LA2 bottom")));
            plc.await(is("Cycles", 3)).within("20s");
        }

        @Test
        void itDeliversATreatedBottleInEveryCycle(Plc plc, SimulatedRig machine) {
            var rig = machine.rig();
            plc.await(is("Cycles", 10)).within("1min");
            plc.await(when("a ninth bottle is delivered", () -> rig.counters().delivered() == 9)).within("1s");
            assertEquals(9, rig.counters().treated());
            assertEquals(0, rig.counters().fallen() + rig.counters().collisions() + rig.counters().lampErrors());
        }

        @Test
        void stopEndsTheCycleAndParksTheRig(Plc plc) {
            plc.await(is("Step", 2)).within("2s");
            plc.press("Stop button");
            plc.await(is("Cycles", 1)).within("6s");
            plc.await(on("Parked lamp")).within("20s");
            plc.expect(off("Running lamp").and(off("SC1")).and(off("SC2")));
            plc.expect(is("Phase", 7)).during("1min");

            plc.press("Start button");
            plc.await(on("Ready lamp")).within("20s");
        }
    }

    @Test
    void takesTheSameNumberOfTicksEveryTime(Plc plc) {
        plc.await(on("Ready lamp")).within("25s");
        plc.press("Start button");
        plc.await(is("Cycles", 2)).within("20s");
        // The number is specific to this program, machine and step: any change to them shows here.
        assertEquals(7_256, plc.ticks());
    }
}
