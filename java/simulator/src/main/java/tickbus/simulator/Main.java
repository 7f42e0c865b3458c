package tickbus.simulator;

import java.io.PrintStream;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Set;
import java.util.function.Supplier;
import tickbus.simulator.control.ControlTableException;
import tickbus.simulator.control.TransferFunctions;
import tickbus.simulator.text.Columns;
import tickbus.simulator.text.Durations;

/**
 * The simulator's command line, for the machines that are handed in. The simulator itself has none: alone it lists the
 * components of drivers, and links drivers with one another.
 *
 * <p>Exit codes: 0 done, 1 the input was wrong, 2 the command line was wrong, 3 a driver failed.
 */
public final class Main {
    private static final String USAGE = """
            usage: simulator --drivers DIR --control FILE [options]
                   simulator --drivers DIR --list

            Runs a machine model against the device drivers in a folder.

              --drivers DIR    the DeviceDriver folder: driver jars, and one .cfg file per driver
              --control FILE   control table that connects hardware components and machine
              --machine NAME   %s
              --step TIME      simulation step size (default 2ms)
              --mode MODE      real-time (default), or best-effort: as fast as possible
              --duration TIME  how much simulation time to run (default: until Ctrl-C)
              --list           list the drivers, their hardware components and the machine's faults, and end
              --help           this text, and end

            Times are numbers with a unit: 500us, 2ms, 10s, 1min.

            A row of the control table is: source | variable | transfer function | destination.
            Transfer functions:
            """;

    private static final String NONE = "none";

    /** The rest of the help on {@code --machine}. */
    private static final String WITH_MACHINES = ";\n                   none only links drivers with one another";
    private static final String ONLY_NONE = ": only link drivers with one another;"
            + "\n                   tickbus-machines.jar is this program with machines";

    /** A machine can have many variables that a plant does not use; only the first ones are listed. */
    private static final int MOST_NOTES = 10;

    private Main() {
    }

    /**
     * Runs the simulator without a machine, and ends the JVM with its exit code.
     *
     * @param args the command line
     */
    public static void main(String[] args) {
        System.exit(run(args, Map.of(), System.out, System.err));
    }

    /**
     * Runs the simulator.
     *
     * @param args the command line
     * @param machines the machines by the names that {@code --machine} takes; the first one is the default, and {@code none}
     * always exists
     * @param out gets results
     * @param err gets error messages
     * @return the exit code
     */
    public static int run(String[] args, Map<String, Supplier<Machine>> machines, PrintStream out, PrintStream err) {
        Map<String, Supplier<Machine>> all = new LinkedHashMap<>(machines);
        all.putIfAbsent(NONE, NoMachine::new);
        try {
            Arguments arguments = new Arguments(args,
                    List.of("--drivers", "--control", "--machine", "--step", "--mode", "--duration"),
                    List.of("--list", "--help"));
            if (arguments.has("--help")) {
                out.print(usage(all.keySet()));
                return 0;
            }
            if (arguments.has("--list")) {
                try (DriverSet drivers = DeviceDriverFolder.scan(arguments.path("--drivers")).look()) {
                    out.print(drivers.list());
                    out.print(faults(machine(arguments, all)));
                }
                return 0;
            }
            simulate(arguments, all, out);
            return 0;
        } catch (Arguments.UsageException e) {
            err.println("simulator: " + e.getMessage() + "\n");
            err.print(usage(all.keySet()));
            return 2;
        } catch (WrongInput | ControlTableException e) {
            err.println(e.getMessage());
            return 1;
        } catch (DriverFailure e) {
            err.println(e.getMessage());
            return 3;
        }
    }

    private static String usage(Set<String> machines) {
        List<String> names = new ArrayList<>(machines);
        names.set(0, names.get(0) + " (default)");
        String text = String.join(", ", names) + (names.size() == 1 ? ONLY_NONE : WITH_MACHINES);
        return USAGE.formatted(text) + TransferFunctions.help();
    }

    private static void note(List<String> unconnected, Path control, PrintStream out) {
        unconnected.stream().limit(MOST_NOTES)
                .forEach(name -> out.println("note: no row of " + control + " writes " + name + "; it stays 0"));
        if (unconnected.size() > MOST_NOTES) {
            out.println("note: likewise " + (unconnected.size() - MOST_NOTES) + " more");
        }
    }

    private static Machine machine(Arguments arguments, Map<String, Supplier<Machine>> machines) {
        return arguments.choice("--machine", machines, machines.keySet().iterator().next()).get();
    }

    /** Lists the machine's faults; nothing for a machine without faults. */
    private static String faults(Machine machine) {
        if (machine.modelFaults().isEmpty()) {
            return "";
        }
        Columns table = new Columns("fault", "values", "effect");
        machine.modelFaults().forEach(fault -> table.row(fault.name(), fault.values(), fault.effect()));
        return "\nmachine " + machine.name() + "\n" + table.text("  ");
    }

    private static void simulate(Arguments arguments, Map<String, Supplier<Machine>> machines, PrintStream out) {
        Machine machine = machine(arguments, machines);
        long step = arguments.duration("--step", "2ms");
        TickMode mode = arguments.choice("--mode", Arguments.MODES, "real-time");
        long duration = arguments.has("--duration") ? arguments.duration("--duration", "") : Long.MAX_VALUE;
        var control = arguments.path("--control");
        var folder = arguments.path("--drivers");
        // Closed in reverse order: the guard keeps the JVM from ending until the drivers are closed.
        try (ShutdownGuard guard = new ShutdownGuard();
                Simulator simulator = new Simulator(DeviceDriverFolder.scan(folder).open(), machine, control, step,
                        TimeSource.system())) {
            note(simulator.unconnected(), control, out);
            out.println("machine " + machine.name() + ", " + simulator.drivers().size() + " driver(s), step "
                    + Durations.text(step) + "; Ctrl-C ends the run");
            simulator.run(mode, () -> !guard.triggered() && simulator.simulationNanos() < duration);
            out.println("simulator: " + (guard.triggered() ? "stopped" : "ok") + " ticks=" + simulator.ticks()
                    + " simulated=" + Durations.text(simulator.simulationNanos()) + " late_ticks="
                    + simulator.lateTicks() + " dropped_ticks=" + simulator.droppedTicks());
        }
    }
}
