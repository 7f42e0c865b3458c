package tickbus.machines.rig;

import java.nio.file.Path;
import java.util.List;
import tickbus.simulator.Arguments;
import tickbus.simulator.TickMode;

/**
 * The options of the demo.
 *
 * @param drivers the DeviceDriver folder
 * @param control the control table
 * @param report the report's file
 * @param recording the driver's recording, null for no page about it
 * @param plc the tickbus executable that is the PLC, null if the PLC is started by other means
 * @param plcCommand the arguments that make it the PLC, null for the rig's program at the driver's address
 * @param mode how ticks follow one another
 * @param stepNanos simulation step size
 * @param cycles cycles to complete
 * @param timeLimitNanos longest simulation time
 * @param page true if the rig stays after its last cycle, for the live page
 */
record DemoOptions(Path drivers, Path control, Path report, Path recording, Path plc, List<String> plcCommand,
        TickMode mode, long stepNanos, int cycles, long timeLimitNanos, boolean page) {
    static final String USAGE = """
            usage: demo --drivers DIR --control FILE --report FILE [options]

            Lets a PLC program run the simulated test rig: homing, some cycles, one jam, recovery, parking.
            With --plc, the program is a process of its own; half-way it is killed and started again.

              --drivers DIR      the DeviceDriver folder with exactly one driver
              --control FILE     control table that connects the driver and the rig
              --report FILE      the report is written here, and rig.svg beside it
              --recording FILE   what the driver records ([record] in driver.cfg): with --plc, an HTML
                                 page about it is made beside the report
              --plc FILE         the tickbus executable: it runs the PLC program, and connects to the
                                 address that the driver listens at; without it, the driver itself
                                 hosts the program (kind = "loopback" in driver.cfg)
              --plc-command LINE what follows the executable, where the PLC has a driver.cfg of its own:
                                 "plc rig --config plc.cfg"; words are separated by blanks
              --mode MODE        real-time (default), or best-effort: as fast as possible, for a PLC
                                 program that runs on simulation time (mode = "stepped" in driver.cfg)
              --step TIME        simulation step size (default 2ms)
              --cycles N         cycles to complete (default 3)
              --time-limit TIME  longest simulation time (default 2min)
              --page             after the last cycle the rig stays as it is until Ctrl-C: the live page
                                 ([page] in driver.cfg) stays, and its buttons can be forced

            The last line is "demo: ok …" with exit code 0, or "demo: failed reason=…" with exit code 1;
            2 if the command line was wrong, 130 after Ctrl-C.
            """;

    static DemoOptions read(String[] args) {
        Arguments arguments = new Arguments(args, List.of("--drivers", "--control", "--report", "--recording", "--plc",
                "--plc-command", "--mode", "--step", "--cycles", "--time-limit"), List.of("--page"));
        return new DemoOptions(arguments.path("--drivers"), arguments.path("--control"), arguments.path("--report"),
                arguments.has("--recording") ? arguments.path("--recording") : null,
                arguments.has("--plc") ? arguments.path("--plc") : null,
                arguments.has("--plc-command") ? arguments.words("--plc-command") : null,
                arguments.choice("--mode", Arguments.MODES, "real-time"), arguments.duration("--step", "2ms"),
                arguments.count("--cycles", 3), arguments.duration("--time-limit", "2min"), arguments.has("--page"));
    }

    /** The cycle in which the PLC is killed: the one in the middle. */
    int killCycle() {
        return (cycles + 1) / 2;
    }

    /** The cycle in which a bottle jams: the one before {@link #killCycle}, or the only one. */
    int jamCycle() {
        return Math.max(1, killCycle() - 1);
    }
}
