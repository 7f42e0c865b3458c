package tickbus.machines.board;

import java.nio.file.Path;
import java.util.List;
import tickbus.simulator.Arguments;

/**
 * The options of the demo.
 *
 * @param drivers the DeviceDriver folder with board.cfg; the dispatcher's address is written into it
 * @param control the control table
 * @param programs the folder with the programs and connections of the controllers
 * @param report the report's file
 * @param tickbus the tickbus executable
 * @param recording the driver's recording, null for none
 * @param stepNanos simulation step size
 * @param page true if the dispatcher serves its patch bay, and the board stays after its script
 */
record LabOptions(Path drivers, Path control, Path programs, Path report, Path tickbus, Path recording, long stepNanos,
        boolean page) {
    static final String USAGE = """
            usage: demo-lab --drivers DIR --control FILE --programs DIR --report FILE --tickbus FILE [options]

            Starts a dispatcher and two controllers as processes, joins them with the testing board in the simulator, and
            works its switches; half-way one controller is killed and started again.

              --drivers DIR      the DeviceDriver folder with board.cfg
              --control FILE     control table that connects the driver and the board
              --programs DIR     the programs tanks.toml and panel.toml, and what they are connected to, *.patch
              --report FILE      the report is written here
              --tickbus FILE     the tickbus executable
              --recording FILE   where the driver records to ([record] in its .cfg): an HTML page about it is made
                                 beside the report
              --step TIME        simulation step size (default 2ms)
              --page             the dispatcher serves its patch bay, whose address is printed; after the script
                                 everything stays until Ctrl-C

            The last line is "demo-lab: ok …" with exit code 0, or "demo-lab: failed reason=…" with exit code 1; 2 if
            the command line was wrong, 130 after Ctrl-C.
            """;

    static LabOptions read(String[] args) {
        Arguments arguments = new Arguments(args, List.of("--drivers", "--control", "--programs", "--report", "--tickbus",
                "--recording", "--step"), List.of("--page"));
        return new LabOptions(arguments.path("--drivers"), arguments.path("--control"), arguments.path("--programs"),
                arguments.path("--report"), arguments.path("--tickbus"),
                arguments.has("--recording") ? arguments.path("--recording") : null,
                arguments.duration("--step", "2ms"), arguments.has("--page"));
    }
}
