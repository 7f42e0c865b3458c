package tickbus.simulator;

import java.io.PrintStream;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.HashSet;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.Set;
import java.util.function.Supplier;
import tickbus.simulator.control.ControlTable;
import tickbus.simulator.control.ControlTableException;
import tickbus.simulator.control.Endpoints;
import tickbus.simulator.control.TransferFunctions;
import tickbus.simulator.expression.Expression;
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
                   simulator --drivers DIR [--control FILE] --list
                   simulator --machine NAME --model-cfg FILE

            Runs a machine model against the device drivers in a folder.

              --drivers DIR    the DeviceDriver folder: driver jars, and one .cfg file per driver
              --control FILE   control table that connects hardware components and machine
              --machine NAME   %s
              --machines DIR   a folder of jars with machines of one's own
              --step TIME      simulation step size (default 2ms)
              --mode MODE      real-time (default), or best-effort: as fast as possible
              --duration TIME  how much simulation time to run (default: until Ctrl-C)
              --list           list the drivers, their hardware components, the machine's variables and faults, with
                               --control also those inputs and outputs that no row uses, and end
              --model-cfg FILE write a driver.cfg with the variables of the machine's model, and end: beside the others in
                               DIR it shows them on the live page, and records them
              --help           this text, and end

            Times are numbers with a unit: 500us, 2ms, 10s, 1min.

            A row of the control table is: source | variable | transfer function | destination.
            Transfer functions:
            """;

    private static final String EXPRESSIONS = """

            Any other text is an expression in Structured Text, such as: a AND NOT "4711:Enable"
            Operators: - NOT, * / MOD, + -, < > <= >=, = <>, AND &, XOR, OR. IN, or IN1, IN2, ... are the row's sources.
            Functions and blocks:
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
     * always exists. Machines in the folder of {@code --machines} come after these.
     * @param out gets results
     * @param err gets error messages
     * @return the exit code
     */
    public static int run(String[] args, Map<String, Supplier<Machine>> machines, PrintStream out, PrintStream err) {
        Map<String, Supplier<Machine>> all = new LinkedHashMap<>(machines);
        try {
            Arguments arguments = new Arguments(args,
                    List.of("--drivers", "--control", "--machine", "--machines", "--model-cfg", "--step", "--mode",
                            "--duration"),
                    List.of("--list", "--help"));
            Set<String> taken = new HashSet<>(machines.keySet());
            taken.add(NONE);
            try (MachineFolder folder = arguments.has("--machines")
                    ? MachineFolder.load(arguments.path("--machines"), taken) : null) {
                if (folder != null) {
                    folder.machines().forEach((name, machine) -> all.put(name, () -> machine));
                }
                all.putIfAbsent(NONE, NoMachine::new);
                return run(arguments, all, out);
            }
        } catch (Arguments.UsageException e) {
            all.putIfAbsent(NONE, NoMachine::new);
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

    private static int run(Arguments arguments, Map<String, Supplier<Machine>> all, PrintStream out) {
        if (arguments.has("--help")) {
            out.print(usage(all.keySet()));
        } else if (arguments.has("--list")) {
            try (DriverSet drivers = DeviceDriverFolder.scan(arguments.path("--drivers")).look()) {
                Machine machine = machine(arguments, all);
                out.print(drivers.list());
                out.print(describe(machine));
                if (arguments.has("--control")) {
                    out.print(unused(arguments, drivers, machine));
                }
            }
        } else if (arguments.has("--model-cfg")) {
            Path file = arguments.path("--model-cfg");
            ModelCfg.write(machine(arguments, all), file);
            out.println("wrote " + file);
        } else {
            simulate(arguments, all, out);
        }
        return 0;
    }

    private static String usage(Set<String> machines) {
        List<String> names = new ArrayList<>(machines);
        names.set(0, names.get(0) + " (default)");
        String text = String.join(", ", names) + (names.size() == 1 ? ONLY_NONE : WITH_MACHINES);
        return USAGE.formatted(text) + TransferFunctions.help() + EXPRESSIONS + Expression.help();
    }

    /** Lists the inputs and outputs without a row. */
    private static String unused(Arguments arguments, DriverSet drivers, Machine machine) {
        Path control = arguments.path("--control");
        ControlTable table = ControlTable.load(control, Simulator.endpoints(drivers.drivers(), machine), step(arguments));
        if (table.unconnected().isEmpty() && table.unread().isEmpty()) {
            return "\nrows of " + control + " use every input and output\n";
        }
        Columns columns = new Columns("component or variable", "no row of " + control);
        table.unread().forEach(name -> columns.row(name, "reads it"));
        table.unconnected().forEach(name -> columns.row(name, "writes it; it stays 0"));
        return "\n" + columns.text("  ");
    }

    private static void note(List<String> unconnected, List<String> unread, Path control, PrintStream out) {
        unconnected.stream().limit(MOST_NOTES)
                .forEach(name -> out.println("note: no row of " + control + " writes " + name + "; it stays 0"));
        if (unconnected.size() > MOST_NOTES) {
            out.println("note: likewise " + (unconnected.size() - MOST_NOTES) + " more");
        }
        if (!unread.isEmpty()) {
            out.println("note: no row of " + control + " reads " + unread.get(0)
                    + (unread.size() == 1 ? "" : " and " + (unread.size() - 1) + " more")
                    + "; --list --control " + control + " lists what no row uses");
        }
    }

    private static Machine machine(Arguments arguments, Map<String, Supplier<Machine>> machines) {
        return arguments.choice("--machine", machines, machines.keySet().iterator().next()).get();
    }

    /** Lists the machine's variables and faults; nothing for a machine without them. */
    private static String describe(Machine machine) {
        StringBuilder text = new StringBuilder();
        if (!machine.variables().isEmpty()) {
            Columns table = new Columns("variable", "unit");
            machine.variables().forEach(one -> table.row(Endpoints.MODEL + ":" + one.name(), one.unit()));
            text.append("\nmachine ").append(machine.name()).append("\n").append(table.text("  "));
        }
        if (!machine.modelFaults().isEmpty()) {
            Columns table = new Columns("fault", "values", "effect");
            machine.modelFaults().forEach(fault -> table.row(fault.name(), fault.values(), fault.effect()));
            text.append("\nmachine ").append(machine.name()).append("\n").append(table.text("  "));
        }
        return text.toString();
    }

    private static long step(Arguments arguments) {
        return arguments.duration("--step", "2ms");
    }

    private static void simulate(Arguments arguments, Map<String, Supplier<Machine>> machines, PrintStream out) {
        Machine machine = machine(arguments, machines);
        long step = step(arguments);
        TickMode mode = arguments.choice("--mode", Arguments.MODES, "real-time");
        long duration = arguments.has("--duration") ? arguments.duration("--duration", "") : Long.MAX_VALUE;
        var control = arguments.path("--control");
        var folder = arguments.path("--drivers");
        // Closed in reverse order: the guard keeps the JVM from ending until the drivers are closed.
        try (ShutdownGuard guard = new ShutdownGuard();
                Simulator simulator = new Simulator(DeviceDriverFolder.scan(folder).open(), machine, control, step,
                        TimeSource.system())) {
            note(simulator.unconnected(), simulator.unread(), control, out);
            out.println("machine " + machine.name() + ", " + simulator.drivers().size() + " driver(s), step "
                    + Durations.text(step) + "; Ctrl-C ends the run");
            simulator.run(mode, () -> !guard.triggered() && simulator.simulationNanos() < duration);
            out.println("simulator: " + (guard.triggered() ? "stopped" : "ok") + " ticks=" + simulator.ticks()
                    + " simulated=" + Durations.text(simulator.simulationNanos()) + " late_ticks="
                    + simulator.lateTicks() + " dropped_ticks=" + simulator.droppedTicks());
        }
    }
}
