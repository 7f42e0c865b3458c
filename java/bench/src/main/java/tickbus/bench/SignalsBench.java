package tickbus.bench;

import java.util.concurrent.TimeUnit;
import org.openjdk.jmh.annotations.Benchmark;
import org.openjdk.jmh.annotations.BenchmarkMode;
import org.openjdk.jmh.annotations.Fork;
import org.openjdk.jmh.annotations.Measurement;
import org.openjdk.jmh.annotations.Mode;
import org.openjdk.jmh.annotations.OutputTimeUnit;
import org.openjdk.jmh.annotations.Param;
import org.openjdk.jmh.annotations.Scope;
import org.openjdk.jmh.annotations.Setup;
import org.openjdk.jmh.annotations.State;
import org.openjdk.jmh.annotations.TearDown;
import org.openjdk.jmh.annotations.Warmup;
import tickbus.Tickbus;

/** The cost of a tick with increasing numbers of REAL signals: its fixed part and its slope. */
@BenchmarkMode(Mode.AverageTime)
@OutputTimeUnit(TimeUnit.NANOSECONDS)
@Fork(value = 3, jvmArgsAppend = "--enable-native-access=ALL-UNNAMED")
@Warmup(iterations = 5, time = 1)
@Measurement(iterations = 5, time = 1)
@State(Scope.Thread)
public class SignalsBench {
    /** Signals each way. */
    @Param({"10", "100", "1000", "10000"})
    public int eachWay;

    private double[] values;
    private double[] inputs;
    private Tickbus bus;
    private long now;

    /** Made by JMH. */
    public SignalsBench() {
    }

    /** Opens the driver. */
    @Setup
    public void open() {
        values = new double[eachWay];
        inputs = new double[eachWay];
        bus = Tickbus.open(BenchCfg.reals("stepped", eachWay));
    }

    /** Closes the driver. */
    @TearDown
    public void close() {
        bus.close();
    }

    /**
     * Set all, exchange with a fresh frame, get all.
     *
     * @return for JMH
     */
    @Benchmark
    public double realsEachWay() {
        now += BenchCfg.TICK_NANOS;
        values[(int) (now % eachWay)] = now;
        bus.setAll(values);
        bus.exchange(now);
        bus.getAll(inputs);
        return inputs[0];
    }
}
