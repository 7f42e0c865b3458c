package tickbus.junit;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.Map;
import java.util.Optional;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import org.junit.jupiter.api.extension.ExtensionContext;
import tickbus.FieldbusException;
import tickbus.Tickbus;

/**
 * Keeps the recording of a test. The configuration parameter or system property {@code tickbus.reports} names the folder;
 * the default is beside the build tool's own reports.
 */
final class Keep {
    private static final String FOLDER = "tickbus.reports";
    private static final Pattern INVOCATION = Pattern.compile("test-template-invocation:#(\\d+)");

    private final Recording when;
    private final Path recording;

    private Keep(Recording when, Path recording) {
        this.when = when;
        this.recording = recording;
    }

    static Keep of(Recording when, ExtensionContext context) {
        if (when == Recording.NEVER) {
            return new Keep(when, null);
        }
        String test = context.getRequiredTestClass().getName() + "." + context.getRequiredTestMethod().getName();
        Matcher invocation = INVOCATION.matcher(context.getUniqueId());
        String number = invocation.find() ? "-" + invocation.group(1) : "";
        // Dollar signs of nested classes are inconvenient in shells.
        return new Keep(when, folder(context).resolve(test.replace('$', '.') + number + ".vcd"));
    }

    /** The folder for everything that tests leave. */
    static Path folder(ExtensionContext context) {
        return context.getConfigurationParameter(FOLDER).map(Path::of).orElseGet(() -> {
            if (Files.isDirectory(Path.of("target"))) {
                return Path.of("target", "surefire-reports", "tickbus");
            }
            Path build = Path.of("build");
            return Files.isDirectory(build) ? build.resolve("reports").resolve("tickbus") : Path.of("tickbus-reports");
        }).toAbsolutePath().normalize();
    }

    /** Replaces driver.cfg's own table: tests must not write to the plant's recording. */
    String table() {
        if (recording == null) {
            return "[record]\nfile = \"none.vcd\"\nwhen = \"never\"\n";
        }
        try {
            Files.createDirectories(recording.getParent());
        } catch (IOException e) {
            throw new IllegalStateException("there is no room for recordings: " + recording.getParent()
                + " cannot be made; name another folder with -D" + FOLDER + "=…, or say recording = NEVER", e);
        }
        return "[record]\nfile = " + Toml.text(recording.toString()) + "\n";
    }

    /** The page about the recording, should the test fail. */
    Optional<Path> page() {
        return Optional.ofNullable(recording)
            .map(file -> file.resolveSibling(file.getFileName().toString().replaceAll("\\.vcd$", ".html")));
    }

    /**
     * Keeps or deletes the recording after the driver is closed, and returns a description.
     *
     * @param failure of the test; null if it passed
     */
    String finish(Throwable failure, Map<String, String> statistics, ExtensionContext context) {
        if (recording == null) {
            return "";
        }
        if (failure != null || when == Recording.ALWAYS) {
            context.publishReportEntry("tickbus.recording", recording.toString());
            String told = "; recording: " + recording;
            try {
                String what = failure == null ? "" : String.valueOf(failure.getMessage());
                Path page = Tickbus.report(recording, title(context), statistics, "What failed", what);
                context.publishReportEntry("tickbus.report", page.toString());
                return told + "; report: " + page;
            } catch (FieldbusException e) {
                // The test's own failure matters more; this one is only mentioned.
                return told + "; no report: " + e.getMessage();
            }
        }
        try {
            Files.deleteIfExists(recording);
            // The page of an earlier run that has failed.
            Files.deleteIfExists(page().orElse(recording));
        } catch (IOException e) {
            // A superfluous file does no harm, and the next run overwrites it.
            context.publishReportEntry("tickbus.recording", recording + " could not be deleted: " + e);
        }
        return "";
    }

    private static String title(ExtensionContext context) {
        return context.getRequiredTestClass().getSimpleName() + ": " + context.getDisplayName();
    }
}
