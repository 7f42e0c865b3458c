package tickbus.bench;

import DeviceDrivers.FieldbusDriver;
import java.util.concurrent.TimeUnit;
import org.openjdk.jmh.annotations.Benchmark;
import org.openjdk.jmh.annotations.BenchmarkMode;
import org.openjdk.jmh.annotations.Fork;
import org.openjdk.jmh.annotations.Measurement;
import org.openjdk.jmh.annotations.Mode;
import org.openjdk.jmh.annotations.OutputTimeUnit;
import org.openjdk.jmh.annotations.Scope;
import org.openjdk.jmh.annotations.Setup;
import org.openjdk.jmh.annotations.State;
import org.openjdk.jmh.annotations.TearDown;
import org.openjdk.jmh.annotations.Warmup;
import tickbus.Signal;
import tickbus.Tickbus;

/** The rig's tick, 16 bits in each direction. Comparisons with it are in {@link ByTurns}. */
@BenchmarkMode(Mode.AverageTime)
@OutputTimeUnit(TimeUnit.NANOSECONDS)
@Fork(value = 3, jvmArgsAppend = "--enable-native-access=ALL-UNNAMED")
@Warmup(iterations = 5, time = 1)
@Measurement(iterations = 5, time = 1)
public class RigTickBench {
    private static final int BITS = 16;

    /** Made by JMH. */
    public RigTickBench() {
    }

    /** An open driver with 16 BOOL signals each way. */
    public abstract static class Bits {
        private final Signal[] in = new Signal[BITS];
        private final Signal[] out = new Signal[BITS];
        private final double[] values = new double[BITS];
        private final double[] inputs = new double[BITS];
        private Tickbus bus;
        private long now;
        private int pattern;

        /** For the subclasses below. */
        protected Bits() {
        }

        /**
         * How the bus is clocked.
         *
         * @return as in driver.cfg
         */
        protected abstract String mode();

        /** Opens the driver. */
        @Setup
        public void open() {
            bus = Tickbus.open(BenchCfg.bits(mode(), BITS));
            for (int i = 0; i < BITS; i++) {
                in[i] = bus.signal("in " + i);
                out[i] = bus.signal("out " + i);
            }
        }

        /** Closes the driver. */
        @TearDown
        public void close() {
            bus.close();
        }

        int exchange() {
            now += BenchCfg.TICK_NANOS;
            return bus.exchange(now);
        }

        int receiveAndSend() {
            now += BenchCfg.TICK_NANOS;
            int status = bus.receive(now);
            bus.send();
            return status;
        }

        double tickByArray() {
            // Two of sixteen bits change at every tick.
            int at = pattern++ & BITS - 1;
            values[at] = 1 - values[at];
            values[at ^ 1] = 1 - values[at ^ 1];
            bus.setAll(values);
            int status = exchange();
            bus.getAll(inputs);
            return status + inputs[at];
        }

        int tick() {
            pattern++;
            for (int i = 0; i < BITS; i++) {
                in[i].setBoolean((pattern >> i & 1) != 0);
            }
            int result = exchange() << BITS;
            for (int i = 0; i < BITS; i++) {
                if (out[i].getBoolean()) {
                    result |= 1 << i;
                }
            }
            return result;
        }
    }

    /** Each tick runs a bus cycle and a scan of the mirror PLC, on the ticking thread. */
    @State(Scope.Thread)
    public static class Stepped extends Bits {
        /** Made by JMH. */
        public Stepped() {
        }

        @Override
        protected String mode() {
            return "stepped";
        }
    }

    /** The bus and the PLC run on their own threads. */
    @State(Scope.Thread)
    public static class Free extends Bits {
        /** Made by JMH. */
        public Free() {
        }

        @Override
        protected String mode() {
            return "free";
        }
    }

    /** The drop-in driver over the free bus. */
    @State(Scope.Thread)
    public static class DropIn {
        private final double[] values = new double[BITS];
        private double[] inputs;
        private FieldbusDriver driver;
        private int pattern;

        /** Made by JMH. */
        public DropIn() {
        }

        /** Opens the driver. */
        @Setup
        public void open() {
            driver = new FieldbusDriver(BenchCfg.bits("free", BITS));
            driver.connect(delivered -> inputs = delivered);
        }

        /** Closes the driver. */
        @TearDown
        public void close() {
            driver.exit();
        }

        double tick() {
            pattern++;
            for (int i = 0; i < BITS; i++) {
                values[i] = pattern >> i & 1;
            }
            driver.updateComponentValues(values);
            double sum = 0;
            for (int i = 0; i < BITS; i++) {
                sum += inputs[i];
            }
            return sum;
        }
    }

    /**
     * Set 16 bits, exchange, get 16 bits; the bus is free-running, so hardly any tick finds a new frame.
     *
     * @param bits the signals
     * @return for JMH
     */
    @Benchmark
    public int rigTickFree(Free bits) {
        return bits.tick();
    }

    /**
     * The same with a fresh frame in every tick: the time includes the bus cycle and the PLC's scan.
     *
     * @param bits the signals
     * @return for JMH
     */
    @Benchmark
    public int rigTickFresh(Stepped bits) {
        return bits.tick();
    }

    /**
     * The same through {@code updateComponentValues} and {@code deliverHardwareInputs}.
     *
     * @param dropIn the driver
     * @return for JMH
     */
    @Benchmark
    public double fieldbusDriverTick(DropIn dropIn) {
        return dropIn.tick();
    }
}
