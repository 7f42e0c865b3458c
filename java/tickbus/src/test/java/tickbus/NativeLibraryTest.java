package tickbus;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertFalse;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.nio.file.attribute.FileTime;
import java.time.Duration;
import java.time.Instant;
import java.util.List;
import java.util.jar.JarEntry;
import java.util.jar.JarOutputStream;
import java.util.stream.Stream;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.io.TempDir;

/** The library is loaded once per process, so that each case gets its own JVM. */
class NativeLibraryTest {
    private static final String FILE = System.mapLibraryName("tickbus");
    private static final Path BUILT = Path.of(System.getProperty("tickbus.native.dir"), FILE).toAbsolutePath();
    private static final String PLATFORM =
        NativeLibrary.platform(System.getProperty("os.name"), System.getProperty("os.arch"));

    @TempDir
    Path directory;

    /** Loads the library in a separate JVM, which prints "loaded" or why it could not. */
    private static ChildJvm.Outcome load(Path classes, String... arguments) throws IOException, InterruptedException {
        return new ChildJvm().with("--enable-native-access=ALL-UNNAMED").with(arguments)
            .with("-cp", classes + java.io.File.pathSeparator + ChildJvm.classes(NativeLibraryTest.class),
                LoadLibrary.class.getName())
            .run();
    }

    private Path jar(Path nativeLibrary) throws IOException {
        Path jar = directory.resolve("tickbus.jar");
        Path classes = ChildJvm.classes(Tickbus.class).resolve("tickbus");
        try (JarOutputStream out = new JarOutputStream(Files.newOutputStream(jar)); Stream<Path> files = Files.list(classes)) {
            for (Path file : files.filter(file -> file.toString().endsWith(".class")).toList()) {
                out.putNextEntry(new JarEntry("tickbus/" + file.getFileName()));
                Files.copy(file, out);
            }
            if (nativeLibrary != null) {
                out.putNextEntry(new JarEntry("tickbus/native/" + PLATFORM + "/" + FILE));
                Files.copy(nativeLibrary, out);
            }
        }
        return jar;
    }

    private static void assertLoaded(ChildJvm.Outcome outcome) {
        assertEquals(new ChildJvm.Outcome(0, "loaded\n"), outcome);
    }

    private static void assertLines(ChildJvm.Outcome outcome, String... patterns) {
        List<String> lines = outcome.output().lines().toList();
        for (String pattern : patterns) {
            assertTrue(lines.stream().anyMatch(line -> line.strip().matches(pattern)), pattern + " in\n" + outcome.output());
        }
    }

    @Test
    void theFileThatAPropertyNamesIsLoaded() throws Exception {
        assertLoaded(load(jar(null), "-Dtickbus.library=" + BUILT));
    }

    @Test
    void theDirectoryThatAPropertyNamesIsSearched() throws Exception {
        assertLoaded(load(jar(null), "-Dtickbus.native.dir=" + BUILT.getParent()));
    }

    @Test
    void theLibraryBesideTheJarIsLoaded() throws Exception {
        Files.copy(BUILT, directory.resolve(FILE));
        assertLoaded(load(jar(null)));
    }

    @Test
    void theLibraryInsideTheJarIsLoadedAndLeavesNothingBehind() throws Exception {
        Path temporary = Files.createDirectory(directory.resolve("temporary"));
        // Of a process that was killed.
        Path old = Files.createFile(temporary.resolve("tickbus-1-" + FILE));
        Files.setLastModifiedTime(old, FileTime.from(Instant.now().minus(Duration.ofHours(1))));
        assertLoaded(load(jar(BUILT), "-Djava.io.tmpdir=" + temporary));
        try (Stream<Path> left = Files.list(temporary)) {
            // Windows deletes no library in use: the next process does it.
            int own = PLATFORM.startsWith("windows") ? 1 : 0;
            List<Path> files = left.toList();
            assertEquals(own, files.size(), files::toString);
            assertFalse(files.contains(old));
        }
    }

    @Test
    void aJarForOtherPlatformsTellsWhichAndA32BitJvmIsTold() throws Exception {
        ChildJvm.Outcome outcome = load(jar(BUILT), "-Dos.arch=x86");
        assertEquals(1, outcome.exit());
        assertLines(outcome, "This is a 32-bit JVM; run a 64-bit one\\.", "The jar has the library for " + PLATFORM + "\\.");
    }

    @Test
    void aLibraryThatIsNowhereIsReportedWithEveryPlace() throws Exception {
        ChildJvm.Outcome outcome = load(jar(null), "-Dtickbus.native.dir=" + directory.resolve("empty"));
        assertEquals(1, outcome.exit());
        assertLines(outcome,
            "LIBRARY \\(-9\\): the native library " + FILE + " for " + PLATFORM + " cannot be loaded. Looked at, in this order:",
            "1\\. property tickbus\\.library: not set",
            "2\\. property tickbus\\.native\\.dir: .*empty.*" + FILE + ": no such file",
            "3\\. variable TICKBUS_NATIVE_DIR: not set",
            "4\\. beside the jar: .*" + FILE + ": no such file",
            "5\\. inside the jar: /tickbus/native/" + PLATFORM + "/" + FILE + ": not there",
            "Name the folder that has " + FILE + " by -Dtickbus\\.native\\.dir=FOLDER or the variable TICKBUS_NATIVE_DIR.*");
    }

    @Test
    void aTemporaryFolderThatIsOfNoUseIsNamedWithTheCure() throws Exception {
        Path none = directory.resolve("none");
        ChildJvm.Outcome outcome = load(jar(BUILT), "-Djava.io.tmpdir=" + none);
        assertEquals(1, outcome.exit());
        assertLines(outcome, "If the temporary folder .*none is full or read-only, .* by -Djava\\.io\\.tmpdir=FOLDER\\.");
    }

    @Test
    void aWrongPropertyIsNotPassedOver() throws Exception {
        ChildJvm.Outcome outcome = load(jar(BUILT), "-Dtickbus.library=" + directory.resolve("no.so"));
        assertEquals(1, outcome.exit());
        assertLines(outcome, "1\\. property tickbus\\.library: .*no\\.so: no such file",
            "2\\. nowhere else, since tickbus\\.library is set");
    }

    @Test
    void aFileThatIsNoLibraryIsReportedWithTheSystemsReason() throws Exception {
        Path broken = Files.writeString(directory.resolve("broken.so"), "not a library");
        ChildJvm.Outcome outcome = load(jar(null), "-Dtickbus.library=" + broken);
        assertEquals(1, outcome.exit());
        assertLines(outcome, "1\\. property tickbus\\.library: .*broken\\.so: .*(header|short|valid|format).*");
        ChildJvm.Outcome inside = load(jar(broken));
        assertEquals(1, inside.exit());
        assertLines(inside, "5\\. inside the jar: .*: extracted to .*: .+");
    }

    @Test
    void aSecondClassLoaderIsToldWhatToDoOrGetsACopy() throws Exception {
        Path jar = jar(null);
        String[] arguments = {"-Dtickbus.library=" + BUILT, "-Dsecond=" + jar.toUri()};
        ChildJvm.Outcome refused = load(jar, arguments);
        assertEquals(1, refused.exit());
        assertLines(refused, "loaded", ".*" + FILE + " is already loaded in another class loader of this process.*",
            ".*-Dtickbus\\.copy=true.*");
        ChildJvm.Outcome copied = load(jar, arguments[0], arguments[1], "-Dtickbus.copy=true");
        assertEquals(new ChildJvm.Outcome(0, "loaded\nloaded\n"), copied);
    }

    @Test
    void aSecondClassLoaderOfTheJarGetsACopyOfTheLibraryBesideIt() throws Exception {
        Files.copy(BUILT, directory.resolve(FILE));
        Path jar = jar(null);
        assertEquals(new ChildJvm.Outcome(0, "loaded\nloaded\n"), load(jar, "-Dsecond=" + jar.toUri()));
    }

    @Test
    void platformsHaveOneNameEach() {
        assertEquals("linux-x86_64", NativeLibrary.platform("Linux", "amd64"));
        assertEquals("linux-aarch64", NativeLibrary.platform("Linux", "aarch64"));
        assertEquals("windows-x86_64", NativeLibrary.platform("Windows 11", "amd64"));
        assertEquals("macos-aarch64", NativeLibrary.platform("Mac OS X", "aarch64"));
        assertFalse(NativeLibrary.platform("Some Unix", "riscv64").contains(" "));
    }
}
