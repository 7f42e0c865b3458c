package tickbus.machines.demo;

import controlinterface.ControlInterfaceDeviceDriver;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.concurrent.locks.LockSupport;
import tickbus.simulator.text.Durations;

/** Runs a PLC program as a process: the command, and the address that it connects to. */
public final class PlcCommand {
    /** How often the process reports its counts. */
    private static final long STATISTICS_NANOS = 100_000_000L;

    /** After this time the process ends on its own, in case nothing else ends it. */
    private static final String LONGEST = "30min";

    /** The limit until the driver must listen. */
    private static final long LISTENING_NANOS = 10_000_000_000L;

    private PlcCommand() {
    }

    /**
     * A PLC as a process that has a driver.cfg of its own.
     *
     * @param executable the tickbus command
     * @param arguments the arguments that make it the PLC
     * @param log gets the process's standard error
     * @return the process, not started yet
     */
    public static PlcProcess process(Path executable, List<String> arguments, Path log) {
        List<String> command = new ArrayList<>(List.of(executable.toString()));
        command.addAll(arguments);
        command.addAll(hosting());
        return new PlcProcess(() -> command, STATISTICS_NANOS, log);
    }

    /**
     * A PLC program as a process that connects to a driver.
     *
     * @param executable the tickbus command
     * @param program the program's name
     * @param cfg the driver's configuration file, which serves both ends
     * @param driver the driver, which must be listening when the process starts
     * @param log gets the process's standard error
     * @return the process, not started yet
     */
    public static PlcProcess process(Path executable, String program, Path cfg, ControlInterfaceDeviceDriver driver,
            Path log) {
        return new PlcProcess(() -> command(executable, program, cfg, address(driver)), STATISTICS_NANOS, log);
    }

    private static List<String> command(Path executable, String program, Path cfg, String address) {
        List<String> command = new ArrayList<>(List.of(executable.toString(), "plc", program, "--config",
                cfg.toString(), "--address", address));
        command.addAll(hosting());
        return command;
    }

    /** The arguments of every PLC process. */
    private static List<String> hosting() {
        return List.of("--stats", Durations.text(STATISTICS_NANOS), "--duration", LONGEST);
    }

    /**
     * The address on which a driver listens; driver.cfg can leave the port to the system.
     *
     * @param driver open
     * @return such as {@code 127.0.0.1:20030}
     */
    public static String address(ControlInterfaceDeviceDriver driver) {
        return statistic(driver, "address", "the driver does not listen at any address, so no PLC process can connect to it; its"
                + " driver.cfg needs a kind that listens, such as \"socket\"");
    }

    /**
     * The serial port that a driver creates.
     *
     * @param driver open, of kind {@code ivi-reader}
     * @return the port's name
     */
    public static String device(ControlInterfaceDeviceDriver driver) {
        return statistic(driver, "device", "the driver makes no serial port, so no PLC process can open it; its driver.cfg needs"
                + " kind = \"ivi-reader\" and device = \"pty:/…\", and a system with pseudo-terminals");
    }

    private static String statistic(ControlInterfaceDeviceDriver driver, String key, String complaint) {
        long limit = System.nanoTime() + LISTENING_NANOS;
        while (true) {
            var statistics = driver.statistics();
            String value = statistics.get(key);
            if (value != null) {
                return value;
            }
            if (System.nanoTime() - limit > 0 || statistics.getOrDefault("state", "").equals("failed")) {
                throw new DemoFailure(complaint + ". The driver says: "
                        + statistics.getOrDefault("reason", "nothing"));
            }
            LockSupport.parkNanos(5_000_000);
        }
    }

    /**
     * The age at which a driver's data are stale.
     *
     * @param driver open
     * @return nanoseconds
     */
    public static long maxAgeNanos(ControlInterfaceDeviceDriver driver) {
        String text = driver.statistics().get("max_age");
        if (text == null) {
            throw new DemoFailure("the driver's statistics do not tell its max_age");
        }
        return Durations.parse(text);
    }
}
