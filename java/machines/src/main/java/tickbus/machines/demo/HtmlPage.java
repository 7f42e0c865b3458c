package tickbus.machines.demo;

import java.io.IOException;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;

/** The page about the run, made by {@code tickbus report} from the driver's complete recording. */
public final class HtmlPage {
    private HtmlPage() {
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
}
