package controlinterface;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;

import java.util.List;
import java.util.Map;
import org.junit.jupiter.api.Test;

class ControlInterfaceDeviceDriverTest {
    /** Answers with the values it was given, negated. */
    private static final class Negating extends ControlInterfaceDeviceDriver {
        @Override
        public void updateComponentValues(double[] value) {
            deliverHardwareInputs(new double[] {-value[0]});
        }

        @Override
        public List<HardwareComponent> components() {
            return List.of(
                    new HardwareComponent("in", Direction.WRITTEN_BY_SIMULATION, "REAL", "mm"),
                    new HardwareComponent("out", Direction.READ_BY_SIMULATION, "REAL", "mm"));
        }

        @Override
        public int id() {
            return 1;
        }

        @Override
        public String name() {
            return "negating";
        }

        @Override
        public void exit() {
        }
    }

    @Test
    void theListenerGetsTheAnswer() {
        Negating driver = new Negating();
        double[] got = new double[1];
        driver.connect(inputs -> got[0] = inputs[0]);
        driver.updateComponentValues(new double[] {3});
        assertArrayEquals(new double[] {-3}, got);
    }

    @Test
    void aLaterListenerReplacesTheFirst() {
        Negating driver = new Negating();
        driver.connect(inputs -> {
            throw new AssertionError("replaced");
        });
        double[] got = new double[1];
        driver.connect(inputs -> got[0] = inputs[0]);
        driver.updateComponentValues(new double[] {2});
        assertEquals(-2, got[0]);
    }

    @Test
    void anUnconnectedDriverTicksAndTheHooksDoNothing() {
        Negating driver = new Negating();
        driver.simulationTime(5);
        driver.updateComponentValues(new double[] {1});
        assertEquals(Map.of(), driver.statistics());
        assertThrows(NullPointerException.class, () -> driver.connect(null));
    }

    @Test
    void aComponentNeedsAName() {
        assertThrows(
                IllegalArgumentException.class,
                () -> new HardwareComponent(" ", Direction.READ_BY_SIMULATION, "BOOL", ""));
    }
}
