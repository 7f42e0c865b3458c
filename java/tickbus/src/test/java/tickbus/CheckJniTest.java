package tickbus;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;
import static org.junit.jupiter.api.Assumptions.assumeTrue;

import java.io.File;
import java.io.IOException;
import java.io.StringReader;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.Objects;
import java.util.Optional;
import java.util.Properties;
import java.util.stream.Stream;
import org.junit.jupiter.params.ParameterizedTest;
import org.junit.jupiter.params.provider.ValueSource;

/** Runs the native tests in a JVM that checks every JNI call, on each supported JDK. */
class CheckJniTest {
    @ParameterizedTest(name = "JDK {0}")
    @ValueSource(ints = {17, 25})
    void nativeTestsPassWithoutAWarning(int version) throws IOException, InterruptedException {
        Optional<Path> home = jdk(version);
        assumeTrue(home.isPresent(), "skipped: no JDK " + version + " here; name one by JAVA_HOME_" + version
            + ", by the property tickbus.jdks, or install one below /usr/lib/jvm");
        ChildJvm.Outcome outcome = new ChildJvm(home.get())
            .with("-Xcheck:jni", "--enable-native-access=ALL-UNNAMED")
            .with("-Dtickbus.native.dir=" + System.getProperty("tickbus.native.dir"))
            .with("-Dtickbus.root=" + System.getProperty("tickbus.root"))
            .with("-cp", ChildJvm.classPath(), "org.junit.platform.console.ConsoleLauncher", "execute")
            .with("--select-package", "tickbus", "--include-tag", "native", "--fail-if-no-tests")
            .with("--disable-banner", "--disable-ansi-colors", "--details", "summary")
            .run();
        assertEquals(0, outcome.exit(), outcome::output);
        List<String> suspicious = outcome.output().lines()
            .filter(line -> line.contains("WARNING") || line.contains("FATAL") || line.contains("Warning:"))
            .toList();
        assertEquals(List.of(), suspicious, outcome::output);
        // Elsewhere some tests need what only Linux has.
        if (System.getProperty("os.name").equals("Linux")) {
            assertTrue(outcome.output().contains("[         0 tests skipped"), outcome::output);
        }
    }

    private static Optional<Path> jdk(int version) throws IOException {
        if (Runtime.version().feature() == version) {
            return Optional.of(Path.of(System.getProperty("java.home")));
        }
        Stream<Path> named = Stream.of(System.getProperty("tickbus.jdks", "").split(File.pathSeparator)).map(Path::of);
        Stream<Path> set = Stream.ofNullable(System.getenv("JAVA_HOME_" + version)).filter(Objects::nonNull).map(Path::of);
        Path shelf = Path.of("/usr/lib/jvm");
        try (Stream<Path> installed = Files.isDirectory(shelf) ? Files.list(shelf).sorted() : Stream.empty()) {
            return Stream.of(set, named, installed).flatMap(home -> home)
                .filter(home -> feature(home) == version)
                .findFirst();
        }
    }

    /** The version of the JDK in a folder; 0 if it is not a JDK. */
    private static int feature(Path home) {
        // In Wine the JDKs of the computer are there, too.
        String program = File.separatorChar == '\\' ? "java.exe" : "java";
        if (!Files.isExecutable(home.resolve("bin").resolve(program))) {
            return 0;
        }
        try {
            Properties release = new Properties();
            release.load(new StringReader(Files.readString(home.resolve("release"))));
            return Runtime.Version.parse(release.getProperty("JAVA_VERSION", "0").replace("\"", "")).feature();
        } catch (IOException | IllegalArgumentException e) {
            return 0;
        }
    }
}
