package tickbus.machines.rig.plc;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;
import static tickbus.junit.Condition.is;
import static tickbus.junit.Condition.off;
import static tickbus.junit.Condition.on;
import static tickbus.junit.Condition.when;

import java.util.List;
import org.junit.jupiter.api.DisplayName;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.CsvSource;
import org.junit.jupiter.params.provider.ValueSource;
import tickbus.InjectedFault;
import tickbus.junit.Plc;
import tickbus.junit.PlcTest;
import tickbus.machines.rig.Lift;

/** How the rig's PLC program reacts to faults, and how an operator restarts it. */
@RigTest
@DisplayName("The rig, when something fails,")
class RigFailsTest {
    private static void start(Plc plc) {
        plc.await(on("Ready lamp")).within("25s");
        plc.press("Start button");
        plc.expect(on("Running lamp"));
    }

    /** The fault lamp is on, and no drive is commanded to move. */
    private static void expectAborted(Plc plc) {
        plc.expect(on("Fault lamp").and(is("Phase", 4)).and(off("Running lamp")));
        plc.expect(off("LA1 run").and(off("LA2 run")).and(off("IM1 index")).and(off("IM2 index")).and(off("IM1 jog"))
                .and(off("IM2 jog")));
    }

    private static void recover(Plc plc) {
        plc.press("Reset button");
        plc.await(on("Running lamp")).within("30s");
        plc.expect(off("Fault lamp"));
    }

    @ParameterizedTest(name = "{0} in step {1}")
    @CsvSource({"LA1, 2", "LA2, 5"})
    void stopsAtAJamUntilItIsClearedAndReset(Lift lift, int step, Plc plc, SimulatedRig machine) {
        start(plc);
        plc.await(is("Step", step)).within("10s");
        machine.rig().jamNext(lift);

        plc.await(when("a bottle is stuck", machine.rig()::jammed)).within("10s");
        plc.expect(off("Not OK")).during("900ms");
        plc.await(on("Not OK")).within("200ms");
        plc.await(on("Fault lamp")).within("20ms");
        expectAborted(plc);
        plc.expect(is("Phase", 4)).during("1min");

        machine.rig().clearJam();
        plc.expect(on("Not OK")).during("1s");
        recover(plc);
        plc.expect(off("Not OK"));
        double cycles = plc.get("Cycles");
        plc.await(is("Cycles", cycles + 2)).within("30s");
        assertEquals(1, machine.rig().counters().faults());
    }

    @Test
    void stopsAtAJamThatIsInjectedByItsName(Plc plc, SimulatedRig machine) {
        start(plc);
        plc.await(is("Step", 5)).within("10s");
        InjectedFault jam = plc.inject("kind = \"model\"\nname = \"jam at lift 2\"");
        plc.await(on("Not OK")).within("10s");
        plc.await(on("Fault lamp")).within("20ms");
        expectAborted(plc);
        jam.end();
        plc.tick(2);
        recover(plc);
        assertEquals(1, machine.rig().counters().jams());
    }

    @Test
    void findsThatALiftHasBacklash(Plc plc, SimulatedRig machine) {
        start(plc);
        plc.inject("kind = \"model\"\nname = \"backlash of lift 1\"\nvalue = 8");
        plc.await(on("Fault lamp")).within("20s");
        expectAborted(plc);
        assertTrue(machine.rig().notOk(), "a bottle has missed its sleeve");
    }

    @Test
    void goesBackToTheFaultWhenResetComesBeforeTheJamIsCleared(Plc plc, SimulatedRig machine) {
        start(plc);
        machine.rig().jamNext(Lift.LA2);
        plc.await(on("Fault lamp")).within("20s");

        plc.press("Reset button");
        plc.expect(is("Phase", 5));
        plc.await(on("Fault lamp")).within("5s");

        machine.rig().clearJam();
        recover(plc);
    }

    @ParameterizedTest
    @ValueSource(strings = {"Package sensor 1", "Package sensor 2"})
    void takesABeamThatStaysDarkForAJamOfItsOwnAccord(String beam, Plc plc) {
        start(plc);
        plc.force(beam, true);
        plc.expect(on("Running lamp")).during("1.4s");
        plc.await(on("Fault lamp")).within("200ms");
        expectAborted(plc);

        plc.release(beam);
        recover(plc);
    }

    @ParameterizedTest
    @ValueSource(ints = {1, 2, 3, 4, 5, 6})
    void givesAStepUpThatIsNotCompleteAfterFiveSeconds(int step, Plc plc) {
        start(plc);
        plc.force("Step " + step + " complete", false);
        plc.await(is("Step", step)).within("10s");
        plc.expect(on("Running lamp")).during("4.7s");
        plc.await(on("Fault lamp")).within("400ms");
        expectAborted(plc);

        plc.release("Step " + step + " complete");
        recover(plc);
    }

    /** Feedback that sticks on is told before the step begins, and so before a lift or a bottle is hurt. */
    @ParameterizedTest
    @ValueSource(ints = {1, 2, 3, 4, 5, 6})
    void beginsNoStepThatIsCompleteAlready(int step, Plc plc, SimulatedRig machine) {
        plc.await(on("Ready lamp")).within("25s");
        plc.force("Step " + step + " complete", true);
        plc.press("Start button");
        plc.await(on("Fault lamp")).within("5s");
        expectAborted(plc);
        assertEquals(0, plc.rises("Not OK"));
        assertEquals(List.of(), machine.rig().faults());

        plc.release("Step " + step + " complete");
        recover(plc);
        double cycles = plc.get("Cycles");
        plc.await(is("Cycles", cycles + 2)).within("30s");
        assertEquals(0, machine.rig().counters().faults());
    }

    @Test
    void homesWithoutBelievingALiftThatIsUpBeforeItRises(Plc plc, SimulatedRig machine) {
        plc.force("Step 2 complete", true);
        plc.await(on("Fault lamp")).within("25s");
        expectAborted(plc);
        assertEquals(List.of(), machine.rig().faults());

        plc.release("Step 2 complete");
        plc.press("Reset button");
        plc.await(on("Ready lamp")).within("30s");
    }

    @Test
    void stopsAtOnceWhenTheMachineReportsAFault(Plc plc) {
        start(plc);
        plc.await(is("Step", 2)).within("2s");
        plc.force("Not OK", true).run("20ms");
        expectAborted(plc);
    }

    @Test
    void holdsOnToItsBottlesThroughAFault(Plc plc) {
        start(plc);
        plc.await(is("Step", 2)).within("2s");
        plc.run("300ms").force("Not OK", true).run("20ms");
        plc.expect(on("SC1")).during("10s");

        plc.release("Not OK");
        plc.press("Reset button");
        plc.await(on("LA1 bottom")).within("10s");
        plc.expect(on("SC1"));
        plc.await(off("SC1")).within("1s");
    }

    @ParameterizedTest(name = "{0} stuck off")
    @CsvSource({"LA1 bottom, 11s", "LA2 bottom, 11s", "Homing sensor 1, 25s", "Homing sensor 2, 25s"})
    void givesHomingUpWhenASwitchNeverShows(String sensor, String limit, Plc plc) {
        InjectedFault brokenWire = plc.inject("kind = \"stuck\"\nvalue = false\nsignal = \"" + sensor + "\"");
        plc.never(on("Ready lamp"));
        plc.await(on("Fault lamp")).within(limit);
        expectAborted(plc);
        assertTrue(brokenWire.isActive());
    }

    @Test
    void homesOnceTheBrokenWireIsMended(Plc plc) {
        InjectedFault brokenWire = plc.inject("""
                kind   = "stuck"
                signal = "LA1 bottom"
                value  = false
                """);
        plc.await(on("Fault lamp")).within("11s");
        brokenWire.end();
        plc.press("Reset button");
        plc.await(on("Ready lamp")).within("30s");
    }

    @Test
    void runsOnThroughABeamThatFlickers(Plc plc) {
        plc.inject("""
                kind   = "noise"
                signal = "Package sensor 2"
                chance = 0.01
                seed   = 7
                """);
        plc.never(on("Fault lamp"));
        start(plc);
        plc.await(is("Cycles", 3)).within("20s");
    }

    @Test
    void startsAnewWhenTheLineComesBack(Plc plc) {
        start(plc);
        plc.await(is("Step", 2)).within("2s");
        plc.inject("""
                kind = "link-down"
                for  = "2s"
                """);
        // The machine's driver delivers fail-safe values: nothing moves, and the cups keep holding.
        plc.await(off("LA1 run")).within("1s");
        plc.expect(on("SC1").and(on("SC2")).and(off("Running lamp"))).during("500ms");
        plc.await(is("Phase", 1)).within("3s");
        plc.await(on("Running lamp")).within("30s");
    }

    @Test
    void turnsNoWheelWhenALiftIsNotWhereItShouldBe(Plc plc) {
        start(plc);
        plc.await(is("Step", 3)).within("5s");
        plc.force("LA2 bottom", false);
        plc.never(on("IM2 index"));
        plc.await(on("Fault lamp")).within("3s");
        expectAborted(plc);
    }

    @Test
    void doesNotForgetStopInAFault(Plc plc) {
        start(plc);
        plc.force("Not OK", true).run("20ms").release("Not OK");
        plc.press("Stop button");
        plc.press("Reset button");
        plc.await(on("Parked lamp")).within("40s");
        assertEquals(1, plc.rises("Running lamp"));
    }

    @PlcTest(options = "la1_code=lsb-first")
    void runsIntoAnEndStopWithTheDigitsOfTheCodeTheOtherWayRound(Plc plc, SimulatedRig machine) {
        start(plc);
        plc.await(on("Not OK")).within("5s");
        List<String> faults = machine.rig().faults();
        assertTrue(faults.get(0).contains("past its end stop"), faults::toString);
        plc.await(on("Fault lamp")).within("20ms");
    }
}
