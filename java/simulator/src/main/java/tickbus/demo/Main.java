package tickbus.demo;

import java.io.PrintStream;
import java.nio.file.Path;
import java.util.List;
import java.util.Map;
import java.util.function.Supplier;
import tickbus.demo.board.TestingBoard;
import tickbus.demo.cell.ManufacturingCell;
import tickbus.demo.peeler.Peeler;
import tickbus.demo.rig.Rig;
import tickbus.simulator.Arguments;
import tickbus.simulator.DeviceDriverFolder;
import tickbus.simulator.DriverFailure;
import tickbus.simulator.DriverSet;
import tickbus.simulator.Machine;
import tickbus.simulator.NoMachine;
import tickbus.simulator.ShutdownGuard;
import tickbus.simulator.Simulator;
import tickbus.simulator.TickMode;
import tickbus.simulator.TimeSource;
import tickbus.simulator.WrongInput;
import tickbus.simulator.control.ControlTableException;
import tickbus.simulator.control.TransferFunctions;
import tickbus.simulator.text.Durations;

/**
 * The simulator's command line.
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
              --machine NAME   rig (default), peeler, board, cell, or none: only link drivers with one
                               another
              --step TIME      simulation step size (default 2ms)
              --mode MODE      real-time (default), or best-effort: as fast as possible
              --duration TIME  how much simulation time to run (default: until Ctrl-C)
              --list           list the drivers and their hardware components, and end
              --help           this text, and end

            Times are numbers with a unit: 500us, 2ms, 10s, 1min.

            A row of the control table is: source | variable | transfer function | destination.
            Transfer functions:
            """;

    private static final Map<String, Supplier<Machine>> MACHINES = Map.of("rig", Rig::new, "peeler", Peeler::new,
            "board", TestingBoard::new, "cell", ManufacturingCell::new, "none", NoMachine::new);

    /** A machine can have many variables that a plant does not use; only the first ones are listed. */
    private static final int MOST_NOTES = 10;

    private Main() {
    }

    /**
     * Runs the simulator and ends the JVM with its exit code.
     *
     * @param args the command line
     */
    public static void main(String[] args) {
        System.exit(run(args, System.out, System.err));
    }

    /**
     * Runs the simulator.
     *
     * @param args the command line
     * @param out gets results
     * @param err gets error messages
     * @return the exit code
     */
    public static int run(String[] args, PrintStream out, PrintStream err) {
        try {
            Arguments arguments = new Arguments(args,
                    List.of("--drivers", "--control", "--machine", "--step", "--mode", "--duration"),
                    List.of("--list", "--help"));
            if (arguments.has("--help")) {
                out.print(USAGE + TransferFunctions.help());
                return 0;
            }
            if (arguments.has("--list")) {
                try (DriverSet drivers = DeviceDriverFolder.scan(arguments.path("--drivers")).look()) {
                    out.print(drivers.list());
                }
                return 0;
            }
            simulate(arguments, out);
            return 0;
        } catch (Arguments.UsageException e) {
            err.println("simulator: " + e.getMessage() + "\n");
            err.print(USAGE + TransferFunctions.help());
            return 2;
        } catch (WrongInput | ControlTableException e) {
            err.println(e.getMessage());
            return 1;
        } catch (DriverFailure e) {
            err.println(e.getMessage());
            return 3;
        }
    }

    private static void note(List<String> unconnected, Path control, PrintStream out) {
        unconnected.stream().limit(MOST_NOTES)
                .forEach(name -> out.println("note: no row of " + control + " writes " + name + "; it stays 0"));
        if (unconnected.size() > MOST_NOTES) {
            out.println("note: likewise " + (unconnected.size() - MOST_NOTES) + " more");
        }
    }

    private static void simulate(Arguments arguments, PrintStream out) {
        Machine machine = arguments.choice("--machine", MACHINES, "rig").get();
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
