package tickbus.machines.peeler;

import static org.junit.jupiter.api.Assertions.assertArrayEquals;
import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertThrows;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.util.HashMap;
import java.util.Map;
import org.junit.jupiter.api.Test;
import tickbus.machines.demo.DemoFailure;
import tickbus.machines.peeler.Intervals.Direction;

/** Times between records, and those of 2018. */
class IntervalsTest {
    private final Map<String, String> statistics = new HashMap<>(Map.of("bus_cycle.count", "4", "bus_cycle.mean_us",
            "10010.5", "bus_cycle.max_us", "12000.0", "bus_cycle.min_us", "9000.0", "bus_cycle.stdev_us", "500.0"));

    @Test
    void theyComeFromTheStatisticsOfWhoReceives() {
        Intervals here = Intervals.of(statistics, Direction.CHARGER_TO_SIMULATION);
        assertEquals(new Intervals(4, 10.0105, 12, 9, 0.25), here);
        assertArrayEquals(new Object[] {"x", "here", 4L, "10.01", "12.00", "9.00", "0.25", "0.50"},
                here.cells("here", "x"));
    }

    /** In ms² the variances of the thesis are 17.42 and 0.94, standard deviations of 4.2 and 1.0 ms. */
    @Test
    void thePapersVariancesAreThousandthsOfSquareSeconds() {
        assertEquals(4.17, Math.sqrt(Direction.SIMULATION_TO_CHARGER.paper().variance()), 0.01);
        assertEquals(0.97, Math.sqrt(Direction.CHARGER_TO_SIMULATION.paper().variance()), 0.01);
    }

    @Test
    void withoutRecordsThereIsNothingToSay() {
        statistics.put("bus_cycle.count", "0");
        String reason = assertThrows(DemoFailure.class,
                () -> Intervals.of(statistics, Direction.SIMULATION_TO_LATHE)).getMessage();
        assertTrue(reason.contains("simulation -> lathe"), reason);
        assertThrows(DemoFailure.class, () -> Intervals.of(Map.of(), Direction.SIMULATION_TO_LATHE));
    }
}
