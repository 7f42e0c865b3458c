package tickbus.machines.peeler;

import java.nio.file.Path;
import java.util.List;
import tickbus.simulator.Arguments;

/**
 * The options of the demo.
 *
 * @param drivers the DeviceDriver folder with charger.cfg and lathe.cfg
 * @param control the control table
 * @param report the report's file
 * @param plc the tickbus executable
 * @param recordings the folder in which each driver records into {@code <name of its .cfg>.vcd}, null for no recordings
 * @param stepNanos simulation step size
 * @param logs blocks to peel
 * @param timeLimitNanos longest simulation time
 * @param page true if the demo peels until Ctrl-C, for the live page
 */
record PeelingOptions(Path drivers, Path control, Path report, Path plc, Path recordings, long stepNanos, int logs,
        long timeLimitNanos, boolean page) {
    static final String USAGE = """
            usage: demo-peeler --drivers DIR --control FILE --report FILE --plc FILE [options]

            Lets two PLC programs, charger and lathe, each a process of its own, peel some blocks of wood on the
            simulated peeling line; then lays the times between records beside those of 2018.

              --drivers DIR      the DeviceDriver folder with charger.cfg and lathe.cfg
              --control FILE     control table that connects both drivers and the line
              --report FILE      the report is written here
              --plc FILE         the tickbus executable, which runs the PLC programs
              --recordings DIR   where the drivers record to, charger.vcd and lathe.vcd ([record] in their .cfg):
                                 an HTML page about each is made beside the report
              --step TIME        simulation step size (default 2ms)
              --logs N           blocks to peel; the first is a cylinder, the second is not (default 2)
              --time-limit TIME  longest simulation time (default 2min)
              --page             peel on until Ctrl-C, however many: for the live page ([page] in the .cfg)

            The last line is "demo-peeler: ok …" with exit code 0, or "demo-peeler: failed reason=…" with exit
            code 1; 2 if the command line was wrong, 130 after Ctrl-C.
            """;

    static PeelingOptions read(String[] args) {
        Arguments arguments = new Arguments(args, List.of("--drivers", "--control", "--report", "--plc", "--recordings",
                "--step", "--logs", "--time-limit"), List.of("--page"));
        return new PeelingOptions(arguments.path("--drivers"), arguments.path("--control"), arguments.path("--report"),
                arguments.path("--plc"), arguments.has("--recordings") ? arguments.path("--recordings") : null,
                arguments.duration("--step", "2ms"), arguments.count("--logs", 2),
                arguments.duration("--time-limit", "2min"), arguments.has("--page"));
    }
}
