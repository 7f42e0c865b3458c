package tickbus.simulator.demo;

import controlinterface.ControlInterfaceDeviceDriver;
import java.util.LinkedHashMap;
import java.util.Map;

/** The PLC end as it shows in its driver's statistics: {@code plc.scans} and {@code plc.rises.<signal>}. */
final class StatisticsPeer implements PeerCounts {
    private static final String RISES = "plc.rises.";
    private static final String SCANS = "plc.scans";

    private final ControlInterfaceDeviceDriver driver;

    StatisticsPeer(ControlInterfaceDeviceDriver driver) {
        this.driver = driver;
    }

    @Override
    public Map<String, Long> rises() {
        Map<String, Long> rises = new LinkedHashMap<>();
        driver.statistics().forEach((key, value) -> {
            if (key.startsWith(RISES)) {
                rises.put(key.substring(RISES.length()), number(key, value));
            }
        });
        return rises;
    }

    /** Scans of the PLC program so far, -1 if the driver does not say. */
    long scans() {
        String scans = driver.statistics().get(SCANS);
        return scans == null ? -1 : number(SCANS, scans);
    }

    private static long number(String key, String value) {
        try {
            return Long.parseLong(value);
        } catch (NumberFormatException e) {
            throw new DemoFailure("the driver's statistics say " + key + "=" + value + ", which is no count");
        }
    }
}
