package tank;

import static tickbus.junit.Condition.off;
import static tickbus.junit.Condition.on;

import tickbus.junit.Machine;
import tickbus.junit.Plc;
import tickbus.junit.PlcTest;

class TankTest {
    /** A tank that fills while the valve is open. */
    static final class Tank implements Machine {
        private double level = 100;

        @Override
        public void step(Plc plc, long simulationNanos) {
            level += plc.isOn("Valve") ? 2 : -1;
            plc.set("Level", level);
            plc.set("Level low", level < 150);
        }
    }

    @PlcTest(config = "tank.cfg", machine = Tank.class)
    void theValveClosesAt150Millimetres(Plc plc) {
        plc.await(on("Valve")).within("1s");
        plc.await(off("Valve")).within("1s");
    }
}
