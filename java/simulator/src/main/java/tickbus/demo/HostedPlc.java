package tickbus.demo;

import controlinterface.ControlInterfaceDeviceDriver;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;

/**
 * A PLC that the demo cannot start or stop: hosted by the driver itself, which reports its counts in its statistics,
 * or independent.
 */
final class HostedPlc implements Plc {
    private final ControlInterfaceDeviceDriver driver;

    HostedPlc(ControlInterfaceDeviceDriver driver) {
        this.driver = driver;
    }

    @Override
    public boolean restartable() {
        return false;
    }

    @Override
    public void start() {
        // The driver switches the PLC.
    }

    @Override
    public void kill() {
        throw new UnsupportedOperationException("this PLC lives in the simulator's process");
    }

    @Override
    public Counts counts() {
        return counts(driver.statistics(), System.nanoTime());
    }

    /** Extracts the PLC's lines, {@code plc.scans} and {@code plc.rises.<signal>}, from statistics. */
    static Counts counts(Map<String, String> statistics, long nanoTime) {
        String prefix = "plc.rises.";
        Map<String, Long> rises = new LinkedHashMap<>();
        statistics.forEach((key, value) -> {
            if (key.startsWith(prefix)) {
                rises.put(key.substring(prefix.length()), number(key, value));
            }
        });
        String scans = statistics.get("plc.scans");
        return new Counts(scans == null ? -1 : number("plc.scans", scans), rises, nanoTime);
    }

    private static long number(String key, String value) {
        try {
            return Long.parseLong(value);
        } catch (NumberFormatException e) {
            throw new DemoFailure("the PLC's statistics say " + key + "=" + value + ", which is no count");
        }
    }

    @Override
    public List<String> news() {
        return List.of();
    }

    @Override
    public long longestSilenceNanos() {
        return 0;
    }

    @Override
    public String name() {
        return "in the driver";
    }

    @Override
    public void check() {
        // The link shows if the PLC ends.
    }

    @Override
    public void close() {
        // The driver closes the PLC.
    }
}
