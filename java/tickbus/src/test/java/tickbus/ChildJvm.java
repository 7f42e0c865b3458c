package tickbus;

import java.io.File;
import java.io.IOException;
import java.nio.charset.StandardCharsets;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.regex.Pattern;

/** A separate JVM, for tests that would disturb the current one. */
final class ChildJvm {
    /** The exit code of the JVM, and its output. */
    record Outcome(int exit, String output) {
    }

    /** Each JVM prints this in Wine. */
    private static final Pattern IN_WINE = Pattern.compile(".* warning: Attempt to get process group affinity failed.*\n");

    private final List<String> command = new ArrayList<>();

    ChildJvm(Path javaHome) {
        command.add(javaHome.resolve("bin").resolve("java").toString());
        // A JVM that finds another one's file of measurements warns on stdout.
        command.add("-XX:-UsePerfData");
    }

    /** The JDK that runs the tests. */
    ChildJvm() {
        this(Path.of(System.getProperty("java.home")));
    }

    ChildJvm with(String... arguments) {
        command.addAll(List.of(arguments));
        return this;
    }

    Outcome run() throws IOException, InterruptedException {
        Process process = new ProcessBuilder(command).redirectErrorStream(true).start();
        process.getOutputStream().close();
        String output = new String(process.getInputStream().readAllBytes(), StandardCharsets.UTF_8);
        return new Outcome(process.waitFor(), IN_WINE.matcher(output.replace("\r\n", "\n")).replaceAll(""));
    }

    /** The class path of the tests. */
    static String classPath() {
        // Surefire passes a jar that only names the class path; the class path is in this property.
        return System.getProperty("surefire.test.class.path", System.getProperty("java.class.path"));
    }

    /** The folder with the classes of this package. */
    static Path classes(Class<?> among) {
        for (String entry : classPath().split(File.pathSeparator)) {
            if (Path.of(entry).resolve(among.getName().replace('.', '/') + ".class").toFile().exists()) {
                return Path.of(entry);
            }
        }
        throw new IllegalStateException(among + " does not come from a folder of the class path " + classPath());
    }
}
