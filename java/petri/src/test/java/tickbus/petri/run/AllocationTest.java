package tickbus.petri.run;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assumptions.assumeTrue;

import com.sun.management.ThreadMXBean;
import java.lang.management.ManagementFactory;
import org.junit.jupiter.api.Test;
import tickbus.petri.net.Delay;
import tickbus.petri.net.NetBuilder;
import tickbus.petri.net.PetriNet;

class AllocationTest {
    private static final int SCANS = 20_000;

    @Test
    void scansMakeNoGarbage() {
        assumeTrue(ManagementFactory.getThreadMXBean() instanceof ThreadMXBean, "this JVM counts no allocations");
        ThreadMXBean threads = (ThreadMXBean) ManagementFactory.getThreadMXBean();
        NetBuilder net = PetriNet.named("line").place("belt").delay(3_000_000).place("free", 4);
        net.transition("feed").input("free").output("belt").transition("pick").input("belt").output("free").delay(Delay.uniform(1, 9));
        for (int i = 0; i < 10; i++) {
            net.place("idle" + i, 1).place("busy" + i);
            net.transition("start" + i).input("idle" + i).output("busy" + i).inhibitor("free", 5);
            net.transition("end" + i).input("busy" + i).output("idle" + i).test("free", 1).delay(Delay.exponential(2_000_000));
        }
        PetriNet built = net.build();
        double[] written = new double[1];
        long[] ticks = {0};
        CoordinatorBuilder builder = Coordinator.of(built).inputs("tick").reader(values -> values[0] = ticks[0]++ % 7)
            .output("lamp", 0).writer(values -> written[0] += values[0]).listener(new FiringLog(built, 100));
        for (int i = 0; i < 10; i++) {
            int least = i % 5;
            builder.when("start" + i, in -> in.get("tick") > least).during("busy" + i, (in, out) -> out.set("lamp", in.get(0)));
        }
        Coordinator coordinator = builder.build();
        // The watch asks at every scan, which is more often than a page does.
        NetWatch watch = NetWatch.of(coordinator);
        long looks = 0;
        long now = 0;
        long fired = 0;
        long allocated = Long.MAX_VALUE;
        // The JVM itself allocates a little as it compiles; a scan that allocates would do so in every round.
        for (int round = 0; round < 5; round++) {
            long before = threads.getCurrentThreadAllocatedBytes();
            for (int i = 0; i < SCANS; i++) {
                now += 1_000_000;
                watch.ask();
                fired += coordinator.scan(now);
                looks += watch.isThere() ? 1 : 0;
            }
            allocated = Math.min(allocated, threads.getCurrentThreadAllocatedBytes() - before);
        }
        assertEquals(0, allocated, "bytes in " + SCANS + " scans; " + fired + " firings, " + written[0]);
        assertEquals(5 * SCANS, looks);
        assertEquals(java.util.Optional.empty(), coordinator.stop());
    }
}
