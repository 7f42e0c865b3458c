package tickbus.simulator.demo;

import java.nio.file.Path;
import java.util.List;
import tickbus.simulator.Arguments;
import tickbus.simulator.TickMode;

/**
 * What the demo is asked to do.
 *
 * @param drivers the DeviceDriver folder
 * @param control the control table
 * @param report where the report goes
 * @param mode how ticks follow one another
 * @param stepNanos simulation step size
 * @param cycles cycles to complete
 * @param timeLimitNanos longest simulation time
 */
record DemoOptions(Path drivers, Path control, Path report, TickMode mode, long stepNanos, int cycles,
        long timeLimitNanos) {
    static final String USAGE = """
            usage: demo --drivers DIR --control FILE --report FILE [options]

            Lets a PLC program run the simulated test rig: homing, some cycles, one jam, recovery, parking.

              --drivers DIR      the DeviceDriver folder with exactly one driver
              --control FILE     control table that connects the driver and the rig
              --report FILE      the report is written here, and rig.svg beside it
              --mode MODE        real-time (default), or best-effort: as fast as possible, for a PLC
                                 program that runs on simulation time (mode = "stepped" in driver.cfg)
              --step TIME        simulation step size (default 2ms)
              --cycles N         cycles to complete (default 3)
              --time-limit TIME  longest simulation time (default 60s)

            The last line is "demo: ok …" with exit code 0, or "demo: failed reason=…" with exit code 1;
            2 if the command line was wrong, 130 after Ctrl-C.
            """;

    static DemoOptions read(String[] args) {
        Arguments arguments = new Arguments(args, List.of("--drivers", "--control", "--report", "--mode", "--step",
                "--cycles", "--time-limit"), List.of());
        return new DemoOptions(arguments.path("--drivers"), arguments.path("--control"), arguments.path("--report"),
                arguments.choice("--mode", Arguments.MODES, "real-time"), arguments.duration("--step", "2ms"),
                arguments.count("--cycles", 3), arguments.duration("--time-limit", "60s"));
    }

    /** The cycle in which a bottle jams: the second, or the only one. */
    int jamCycle() {
        return Math.min(2, cycles);
    }
}
