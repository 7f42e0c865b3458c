package tickbus.machines.peeler;

import controlinterface.ControlInterfaceDeviceDriver;
import java.nio.file.Path;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import tickbus.machines.demo.DemoFailure;
import tickbus.machines.demo.PlcCommand;
import tickbus.machines.demo.PlcProcess;
import tickbus.machines.demo.Timeline;
import tickbus.simulator.DeviceDriverFolder;

/** The two PLCs, each a process that connects to its driver. */
final class Plcs implements AutoCloseable {
    /** The programs; each one's driver has the same name. */
    static final List<String> PROGRAMS = List.of("charger", "lathe");

    private final Map<String, PlcProcess> processes = new LinkedHashMap<>();

    /** Starts the PLCs. */
    Plcs(PeelingOptions options, List<ControlInterfaceDeviceDriver> drivers) {
        Map<Integer, Path> files = DeviceDriverFolder.scan(options.drivers()).configurations();
        try {
            for (String program : PROGRAMS) {
                ControlInterfaceDeviceDriver driver = drivers.stream()
                        .filter(one -> one.name().toLowerCase(Locale.ROOT).equals(program)).findFirst()
                        .orElseThrow(() -> new DemoFailure("the driver folder has no driver named " + program));
                PlcProcess process = PlcCommand.process(options.plc(), program, files.get(driver.id()), driver,
                        options.report().resolveSibling(program + ".log"));
                processes.put(program, process);
                process.start();
            }
        } catch (RuntimeException | Error e) {
            close();
            throw e;
        }
    }

    /** Collects the PLCs' output for people. */
    void listen(long now, Timeline timeline) {
        processes.forEach((program, process) ->
                process.news().forEach(line -> timeline.add(now, program, line.replaceFirst("^plc: ", ""))));
    }

    /**
     * Fails if a PLC has ended.
     *
     * @throws DemoFailure with the PLC's name and last output
     */
    void check() {
        processes.forEach((program, process) -> {
            try {
                process.check();
            } catch (DemoFailure e) {
                throw new DemoFailure(program + ": " + e.getMessage());
            }
        });
    }

    /** The last statistics that a program printed. */
    Map<String, String> statistics(String program) {
        return processes.get(program).statistics();
    }

    long longestSilenceNanos() {
        return processes.values().stream().mapToLong(PlcProcess::longestSilenceNanos).max().orElse(0);
    }

    @Override
    public void close() {
        processes.values().forEach(PlcProcess::close);
    }
}
