package example;

import static tickbus.junit.Condition.off;
import static tickbus.junit.Condition.on;

import org.junit.jupiter.api.Tag;
import tickbus.junit.FaultSweep;
import tickbus.junit.Plc;
import tickbus.junit.PlcTest;

@PlcTest(config = "../../driver.cfg", program = "rig", step = "2ms", machine = CellTest.Cell.class)
@Tag("native")
class CellSweepTest {
    @FaultSweep("""
        signals = ["LA1 bottom", "Not OK"]
        kinds   = ["stuck-on", "stuck-off", "line-down"]
        moments = "Step"
        told    = "Fault lamp"
        within  = "2s"

        [never]
        "wheel 1 turns into lift 1" = ["IM1 index", "not LA1 bottom"]
        """)
    void theLiftRises(Plc plc) {
        plc.await(on("Ready lamp")).within("25s");
        plc.press("Start button");
        plc.await(off("LA1 bottom")).within("10s");
    }
}
