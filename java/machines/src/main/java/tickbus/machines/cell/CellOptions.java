package tickbus.machines.cell;

import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import tickbus.simulator.Arguments;

/**
 * The options of the demo.
 *
 * @param drivers the DeviceDriver folder with the driver.cfg of the cell, and that of its reader
 * @param control the control table
 * @param report the report's file
 * @param nets the class path of the nets
 * @param identification the driver.cfg of the nets' line to the reader
 * @param plc the tickbus executable, which makes the page; null for no page
 * @param recording the driver's recording; null for no page
 * @param stepNanos simulation step size
 * @param cylinders cylinders to make
 * @param timeLimitNanos longest simulation time
 * @param page where the nets are shown live, as host and port; null for no live page
 */
record CellOptions(Path drivers, Path control, Path report, String nets, Path identification, Path plc, Path recording,
        long stepNanos, int cylinders, long timeLimitNanos, String page) {
    /** This computer alone, at any port. */
    private static final String ANY_PORT = "127.0.0.1:0";

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
              --page [HOST:PORT] shows the nets live in a browser, and makes as many cylinders again and again,
                                 each time with its mishaps, until Ctrl-C (default 127.0.0.1, any port)

            The last line is "demo-cell: ok …" with exit code 0, or "demo-cell: failed reason=…" with exit
            code 1; 2 if the command line was wrong, 130 after Ctrl-C.
            """;

    static CellOptions read(String[] args) {
        Arguments arguments = new Arguments(withPort(args), List.of("--drivers", "--control", "--report", "--nets",
                "--identification", "--plc", "--recording", "--step", "--cylinders", "--time-limit", "--page"), List.of());
        return new CellOptions(arguments.path("--drivers"), arguments.path("--control"), arguments.path("--report"),
                String.valueOf(arguments.path("--nets")), arguments.path("--identification"),
                arguments.has("--plc") ? arguments.path("--plc") : null,
                arguments.has("--recording") ? arguments.path("--recording") : null,
                arguments.duration("--step", "2ms"), arguments.count("--cylinders", 12),
                arguments.duration("--time-limit", "1min"), arguments.has("--page") ? String.join(" ", arguments.words("--page")) : null);
    }

    /** {@code --page} needs no value. */
    private static String[] withPort(String[] args) {
        List<String> words = new ArrayList<>(List.of(args));
        int page = words.indexOf("--page");
        if (page >= 0 && (page + 1 == words.size() || words.get(page + 1).startsWith("--"))) {
            words.add(page + 1, ANY_PORT);
        }
        return words.toArray(String[]::new);
    }
}
