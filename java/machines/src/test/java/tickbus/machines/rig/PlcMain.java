package tickbus.machines.rig;

import java.nio.file.Path;
import java.util.List;
import tickbus.simulator.DriverSet;
import tickbus.simulator.TickMode;

/** The demo with {@link PlcDriver} in a separate JVM, so that a test can interrupt it. */
final class PlcMain {
    private PlcMain() {
    }

    /** Takes the control table and the report's path. */
    public static void main(String[] args) throws Exception {
        PlcDriver plc = new PlcDriver(Path.of(args[0])) {
            @Override
            public void exit() {
                System.out.println("driver closed");
            }
        };
        DemoOptions options = new DemoOptions(Path.of("none"), Path.of(args[0]), Path.of(args[1]), null, null, null,
                TickMode.REAL_TIME, 2_000_000, 1000, Long.MAX_VALUE, false);
        System.exit(Demo.run(options, () -> new DriverSet(List.of(plc)), HostedPlc::new, System.out, System.err));
    }
}
