package tickbus.machines.rig;

import java.io.IOException;
import java.io.PrintStream;
import java.nio.file.Path;
import java.util.List;
import java.util.Map;
import tickbus.machines.demo.HtmlPage;

/** The HTML page about the rig's run, with the steps and the faults of its PLC program. */
final class RigPage {
    /** The PLC's output with the number of its step. */
    private static final String STEPS = "Step";

    /** The PLC's output that is on while there is a fault. */
    private static final String FAULT = "Fault lamp";

    private RigPage() {
    }

    /** Saves the statistics of the driver for the page: they are not available after it is closed. */
    static void keepStatistics(DemoOptions options, Map<String, String> statistics) throws IOException {
        HtmlPage.keepStatistics(statistics(options), statistics);
    }

    /** Makes the page, and prints a line with its location; returns the error, or null. */
    static String make(DemoOptions options, PrintStream out) {
        Path page = options.report().resolveSibling("report.html");
        String trouble = HtmlPage.make(options.plc(), List.of(options.recording().toString(), "--out", page.toString(), "--steps",
                STEPS, "--fault", FAULT, "--stats", statistics(options).toString(), "--text",
                options.report().toString()));
        if (trouble == null) {
            out.println("demo: page=" + page);
        }
        return trouble;
    }

    private static Path statistics(DemoOptions options) {
        return options.report().resolveSibling("statistics.txt");
    }
}
