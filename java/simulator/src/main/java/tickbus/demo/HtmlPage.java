package tickbus.demo;

import java.io.IOException;
import java.io.PrintStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;

/** The page about the run, made by {@code tickbus report} from the driver's complete recording. */
public final class HtmlPage {
    /** The PLC's output with the number of its step. */
    private static final String STEPS = "Step";

    /** The PLC's output that is on while there is a fault. */
    private static final String FAULT = "Fault lamp";

    private HtmlPage() {
    }

    /** Saves the statistics of the driver for the page: they are not available after it is closed. */
    static void keepStatistics(DemoOptions options, Map<String, String> statistics) throws IOException {
        keepStatistics(statistics(options), statistics);
    }

    /**
     * Saves the statistics of a driver for a page.
     *
     * @param file the destination
     * @param statistics as reported by the driver
     * @throws IOException if the file cannot be written
     */
    public static void keepStatistics(Path file, Map<String, String> statistics) throws IOException {
        Files.writeString(file, StatisticsLines.write(statistics));
    }

    /**
     * Makes the page.
     *
     * @param options has all paths
     * @param out gets a line with the page's location
     * @return the error, or null
     */
    static String make(DemoOptions options, PrintStream out) {
        Path page = options.report().resolveSibling("report.html");
        String trouble = make(options.plc(), List.of(options.recording().toString(), "--out", page.toString(), "--steps",
                STEPS, "--fault", FAULT, "--stats", statistics(options).toString(), "--text",
                options.report().toString()));
        if (trouble == null) {
            out.println("demo: page=" + page);
        }
        return trouble;
    }

    /**
     * Makes a page.
     *
     * @param tickbus the tickbus command
     * @param arguments the arguments of {@code tickbus report}
     * @return the error, or null
     */
    public static String make(Path tickbus, List<String> arguments) {
        List<String> command = new ArrayList<>(List.of(tickbus.toString(), "report"));
        command.addAll(arguments);
        try {
            Process process = new ProcessBuilder(command).redirectErrorStream(true).start();
            process.getOutputStream().close();
            String told = new String(process.getInputStream().readAllBytes(), StandardCharsets.UTF_8).strip();
            if (process.waitFor() == 0) {
                return null;
            }
            return "the page about the run could not be made: " + told.replace("\n", "; ");
        } catch (IOException e) {
            return "the page about the run could not be made: " + e.getMessage();
        } catch (InterruptedException e) {
            Thread.currentThread().interrupt();
            return "interrupted";
        }
    }

    private static Path statistics(DemoOptions options) {
        return options.report().resolveSibling("statistics.txt");
    }
}
