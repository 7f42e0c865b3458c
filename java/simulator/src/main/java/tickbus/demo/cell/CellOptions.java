package tickbus.demo.cell;

import java.nio.file.Path;
import java.util.List;
import tickbus.simulator.Arguments;

/**
 * The options of the demo.
 *
 * @param drivers the DeviceDriver folder with the driver.cfg of the cell, and that of its reader
 * @param control the control table
 * @param report where the report goes
 * @param nets the class path of the nets
 * @param identification the driver.cfg by which the nets reach the reader
 * @param plc the tickbus executable, which makes the page; null for no page
 * @param recording what the driver records; null for no page
 * @param stepNanos simulation step size
 * @param cylinders cylinders to make
 * @param timeLimitNanos longest simulation time
 */
record CellOptions(Path drivers, Path control, Path report, String nets, Path identification, Path plc, Path recording,
        long stepNanos, int cylinders, long timeLimitNanos) {
    static final String USAGE = """
            usage: demo-cell --drivers DIR --control FILE --report FILE --nets CLASSPATH --identification FILE [options]

            Lets Petri nets, a process of its own, make cylinders in the simulated manufacturing cell. A code carrier is
            missed, a loader and a pallet jam, a vacuum is lost, and a magazine runs empty on the way.

              --drivers DIR      the DeviceDriver folder with the driver.cfg of the cell and that of its reader
              --control FILE     control table that connects the driver and the cell
              --report FILE      the report is written here, and the nets with their markings beside it
              --nets CLASSPATH   where Java finds the nets' program, tickbus.cell.CellControl
              --identification FILE
                                 the driver.cfg by which the nets reach the reader
              --plc FILE         the tickbus executable, which makes an HTML page of the recording
              --recording FILE   what the driver records ([record] in driver.cfg)
              --step TIME        simulation step size (default 2ms)
              --cylinders N      cylinders to make, of all kinds in turn (default 12)
              --time-limit TIME  longest simulation time (default 1min)

            The last line is "demo-cell: ok …" with exit code 0, or "demo-cell: failed reason=…" with exit
            code 1; 2 if the command line was wrong, 130 after Ctrl-C.
            """;

    static CellOptions read(String[] args) {
        Arguments arguments = new Arguments(args, List.of("--drivers", "--control", "--report", "--nets",
                "--identification", "--plc", "--recording", "--step", "--cylinders", "--time-limit"), List.of());
        return new CellOptions(arguments.path("--drivers"), arguments.path("--control"), arguments.path("--report"),
                String.valueOf(arguments.path("--nets")), arguments.path("--identification"),
                arguments.has("--plc") ? arguments.path("--plc") : null,
                arguments.has("--recording") ? arguments.path("--recording") : null,
                arguments.duration("--step", "2ms"), arguments.count("--cylinders", 12),
                arguments.duration("--time-limit", "1min"));
    }
}
