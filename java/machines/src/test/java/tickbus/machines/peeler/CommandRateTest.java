package tickbus.machines.peeler;

import static org.junit.jupiter.api.Assertions.assertEquals;

import org.junit.jupiter.api.Test;

/** Commands per second. */
class CommandRateTest {
    private static final long MILLI = 1_000_000L;

    private final Peeler line = new Peeler();
    private final CommandRate rate = new CommandRate(line);
    private long now;

    /** A command to an axis, followed by a pause. */
    private void command(AxisName axis, int millis) {
        int execute = line.inputs().indexOf(axis.label() + ".Execute");
        line.input(line.inputs().indexOf(axis.label() + ".Enable"), 1);
        for (int i = 0; i < millis; i++) {
            line.input(execute, i == 0 ? 1 : 0);
            line.step(MILLI);
            now += MILLI;
            rate.look(now);
        }
    }

    @Test
    void itCountsFromTheFirstCommandAndFindsTheBusiestSecond() {
        assertEquals(0, rate.mean());
        command(AxisName.NOSEBAR, 1000);
        for (int i = 0; i < 5; i++) {
            command(AxisName.TOP_ROLL, 100);
        }
        command(AxisName.TOP_ROLL, 8501);
        assertEquals(AxisName.TOP_ROLL, rate.busiest());
        assertEquals(0.6, rate.mean(AxisName.TOP_ROLL), 1e-3);
        assertEquals(0.7 / 25, rate.mean(), 1e-4);
        assertEquals(6, rate.most(AxisName.TOP_ROLL));
        assertEquals(1, rate.most(AxisName.NOSEBAR));
        assertEquals(0, rate.most(AxisName.CORE_DROP));
    }
}
