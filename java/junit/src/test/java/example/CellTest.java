package example;

import static tickbus.junit.Condition.is;
import static tickbus.junit.Condition.off;
import static tickbus.junit.Condition.on;

import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import tickbus.junit.Machine;
import tickbus.junit.Plc;
import tickbus.junit.PlcTest;

@PlcTest(config = "../../driver.cfg", program = "rig", step = "2ms", machine = CellTest.Cell.class)
@Tag("native")
class CellTest {
    /** Lift 1 and wheel 1, as far as these tests need it. */
    static final class Cell implements Machine {
        private static final double TOP = 180;
        private double height;
        private double angle;
        private boolean jammed;

        void jamNextBottle() {
            jammed = true;
        }

        @Override
        public void step(Plc plc, long simulationNanos) {
            boolean down = plc.isOn("LA1 code low");
            if (plc.isOn("LA1 run") && !jammed) {
                height = down ? Math.max(height - 0.8, 0) : Math.min(height + 0.6, TOP);
            }
            plc.set("LA1 position", height);
            plc.set("LA1 bottom", height == 0);
            angle = plc.isOn("IM1 index") ? Math.min(angle + 0.3, 90) : 0;
            plc.set("Step 1 complete", angle == 90);
            plc.set("Step 2 complete", height == TOP);
            plc.set("Not OK", jammed && height > 0);
            plc.set("LA2 bottom", true);
            plc.set("Homing sensor 1", true);
            plc.set("Homing sensor 2", true);
        }
    }

    @Test
    void startBeginsARun(Plc plc) {
        plc.await(on("Ready lamp")).within("25s");
        plc.press("Start button");
        plc.await(on("Running lamp")).within(40);
        plc.expect(is("Phase", 3));
    }

    @Test
    void aJamStopsTheRigUntilReset(Plc plc, Cell cell) {
        plc.never(on("IM1 index").and(off("LA1 bottom")));
        plc.await(on("Ready lamp")).within("25s");
        plc.press("Start button");
        plc.await(off("LA1 bottom")).within("10s");
        cell.jamNextBottle();
        plc.await(on("Fault lamp")).within("20s");
        plc.expect(off("LA1 run").and(off("LA2 run"))).during("1min");
    }
}
