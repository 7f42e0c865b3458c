package tickbus.simulator.control;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assumptions.assumeTrue;

import com.sun.management.ThreadMXBean;
import java.lang.management.ManagementFactory;
import java.util.List;
import org.junit.jupiter.api.Test;
import tickbus.simulator.FakeDriver;

class AllocationTest {
    private static final int TICKS = 20_000;

    @Test
    void aTickOfTheTableMakesNoGarbage() {
        assumeTrue(ManagementFactory.getThreadMXBean() instanceof ThreadMXBean, "this JVM counts no allocations");
        ThreadMXBean threads = (ThreadMXBean) ManagementFactory.getThreadMXBean();
        Endpoints endpoints = new Endpoints(List.of(new FakeDriver(1, List.of("w", "v", "u"), List.of("r", "s"))),
                List.of("valve", "motor"), List.of("level", "on"));
        ControlTable table = ControlTable.parse("t.table", """
                1:r          | big   | IN > 5.0 AND NOT (IN = 7.0) |
                1:r, 1:s     | sum   | LIMIT(-100.0, IN1 * 2.5 - IN2 / 3.0, 100.0) |
                             | slow  | TON(big, T#20ms) OR TOF(big, T#10ms) OR TP(IN := big, PT := T#6ms) |
                             | count | CTU(R_TRIG(big), F_TRIG(slow), 1000).CV |
                             |       | SR(big, slow) XOR RS(slow, "machine:on") | machine:valve
                             |       | MUX(count MOD 3, sum, ABS(sum), MIN(sum, MAX(sum, 0.0, 1.0))) | machine:motor
                             |       | SEL(slow, TO_LREAL(count), TO_LREAL(TO_LINT(sum))) | 1:w
                             |       | TO_LREAL(TON(slow, T#50ms).ET) + "machine:level" | 1:v
                1:r          |       | scale(2, 0) | 1:u
                """, endpoints, 2_000_000);
        double[] read = new double[2];
        double[] written = new double[3];
        double sum = 0;
        long allocated = Long.MAX_VALUE;
        // The JVM itself allocates a little as it compiles; a tick that allocates would do so in every round.
        for (int round = 0; round < 5; round++) {
            long before = threads.getCurrentThreadAllocatedBytes();
            for (int i = 0; i < TICKS; i++) {
                read[0] = i % 17;
                read[1] = i % 5;
                table.setSources(0, read);
                table.computeBeforeStep();
                table.setSource(2, i % 100);
                table.setSource(3, i % 2);
                table.computeAfterStep();
                table.getDestinations(0, written);
                sum += written[0] + written[1] + table.destination(3) + table.destination(4);
            }
            allocated = Math.min(allocated, threads.getCurrentThreadAllocatedBytes() - before);
        }
        assertEquals(0, allocated, "bytes in " + TICKS + " ticks; sum " + sum);
    }
}
