package tickbus.junit;

import java.lang.annotation.Documented;
import java.lang.annotation.ElementType;
import java.lang.annotation.Retention;
import java.lang.annotation.RetentionPolicy;
import java.lang.annotation.Target;
import org.junit.jupiter.api.TestTemplate;
import org.junit.jupiter.api.extension.ExtendWith;
import org.junit.jupiter.api.parallel.Execution;
import org.junit.jupiter.api.parallel.ExecutionMode;

/**
 * A sweep of faults: runs the method, which is the scenario of a normal run, first without a fault and then with each fault
 * at each moment. Each run is a test with its own name.
 *
 * <pre>{@code
 * @PlcTest(config = "driver.cfg", program = "rig", step = "2ms", machine = Cell.class)
 * class CellSweep {
 *     @FaultSweep("""
 *         moments = "Step"
 *         told    = "Fault lamp"
 *         within  = "12s"
 *         """)
 *     void oneCycle(Plc plc) {
 *         plc.await(on("Ready lamp")).within("25s");
 *         plc.press("Start button");
 *         plc.await(is("Cycles", 1)).within("20s");
 *     }
 * }
 * }</pre>
 *
 * <p>Under a fault the method's expectations do not count, and its waits have no limit: the run ends when it is judged. An
 * assertion of the method's own that fails ends its actions, and time goes on.
 *
 * <p>A run passes if the program tells the fault or continues as without it, or if its verdict was accepted:
 * {@code -Dtickbus.accept=true} accepts all verdicts, and writes the file. {@code -Dtickbus.only=TEXT} makes only the runs
 * whose name contains the text.
 */
@Documented
@Target(ElementType.METHOD)
@Retention(RetentionPolicy.RUNTIME)
@TestTemplate
@Execution(ExecutionMode.SAME_THREAD)
@ExtendWith({PlcExtension.class, SweepExtension.class})
public @interface FaultSweep {
    /**
     * The sweep's keys: the faults and moments, and how a run is judged.
     *
     * @return the keys of a {@code [sweep]} section of a test file but for {@code scenario}, one per line; the file of
     *     accepted verdicts is as seen from the working directory, and by default {@code accepted/CLASS.METHOD.toml}
     */
    String value();
}
