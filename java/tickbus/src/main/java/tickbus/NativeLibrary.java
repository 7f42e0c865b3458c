package tickbus;

import java.io.IOException;
import java.io.InputStream;
import java.io.OutputStream;
import java.net.URISyntaxException;
import java.nio.file.DirectoryIteratorException;
import java.nio.file.DirectoryStream;
import java.nio.file.Files;
import java.nio.file.InvalidPathException;
import java.nio.file.Path;
import java.time.Duration;
import java.time.Instant;
import java.util.ArrayList;
import java.util.List;
import java.util.Locale;
import java.util.stream.Collectors;

/**
 * Finds and loads the native library, once per class loader.
 *
 * <p>Searches, in this order: the file named by the system property {@code tickbus.library} (and then nowhere else); the
 * directory named by {@code tickbus.native.dir}; the directory named by the variable {@code TICKBUS_NATIVE_DIR}; the folder
 * of the jar; the jar itself.
 */
final class NativeLibrary {
    static final String LIBRARY = "tickbus.library";
    static final String DIRECTORY = "tickbus.native.dir";
    static final String COPY = "tickbus.copy";
    static final String VARIABLE = "TICKBUS_NATIVE_DIR";

    private static final String PREFIX = "tickbus-";
    /** Much longer than the time from a file's creation until it is loaded. */
    private static final Duration RECENT = Duration.ofMinutes(10);

    private static final List<String> PLATFORMS =
        List.of("linux-x86_64", "linux-aarch64", "windows-x86_64", "macos-aarch64", "macos-x86_64");

    private static boolean loaded;

    private final String file = System.mapLibraryName("tickbus");
    private final String platform = platform(System.getProperty("os.name"), System.getProperty("os.arch"));
    private final List<String> tried = new ArrayList<>();
    /** True if the library was to be extracted to the temporary folder. */
    private boolean extracts;

    private NativeLibrary() {
    }

    /** Loads the library unless it is loaded. A later call can try again after a failure. */
    static synchronized void load() {
        if (!loaded) {
            new NativeLibrary().search();
            loaded = true;
        }
    }

    /** Operating system and processor as named by the jar's folders, such as linux-x86_64. */
    static String platform(String osName, String osArch) {
        String os = osName.toLowerCase(Locale.ROOT);
        String system = os.startsWith("windows") ? "windows" : os.startsWith("mac") ? "macos" : os.replace(' ', '-');
        String processor = switch (osArch.toLowerCase(Locale.ROOT)) {
            case "amd64", "x86_64", "x64" -> "x86_64";
            case "aarch64", "arm64" -> "aarch64";
            default -> osArch;
        };
        return system + "-" + processor;
    }

    private void search() {
        String library = System.getProperty(LIBRARY);
        if (library != null) {
            if (!fromFile("property " + LIBRARY, library, Boolean.getBoolean(COPY))) {
                tried.add("nowhere else, since " + LIBRARY + " is set");
                throw failure();
            }
            return;
        }
        tried.add("property " + LIBRARY + ": not set");
        if (!fromDirectory("property " + DIRECTORY, System.getProperty(DIRECTORY))
            && !fromDirectory("variable " + VARIABLE, System.getenv(VARIABLE)) && !besideTheJar() && !insideTheJar()) {
            throw failure();
        }
    }

    private boolean fromDirectory(String place, String directory) {
        if (directory == null || directory.isEmpty()) {
            tried.add(place + ": not set");
            return false;
        }
        return fromFile(place, directory + java.io.File.separator + file, Boolean.getBoolean(COPY));
    }

    private boolean besideTheJar() {
        String place = "beside the jar";
        try {
            Path classes = Path.of(NativeLibrary.class.getProtectionDomain().getCodeSource().getLocation().toURI());
            Path directory = Files.isDirectory(classes) ? classes : classes.getParent();
            // Each class loader that has the jar gets the library, as from inside the jar.
            return fromFile(place, directory.resolve(file).toString(), true);
        } catch (URISyntaxException | RuntimeException e) {
            // A class loader need not give its classes a location, or gives one that is not a file.
            tried.add(place + ": the classes do not come from a file (" + e + ")");
            return false;
        }
    }

    private boolean insideTheJar() {
        String resource = resource(platform);
        String place = "inside the jar: " + resource;
        try (InputStream content = NativeLibrary.class.getResourceAsStream(resource)) {
            if (content == null) {
                tried.add(place + ": not there");
                return false;
            }
            return fromCopy(place, content);
        } catch (IOException e) {
            tried.add(place + ": cannot be read: " + e);
            return false;
        }
    }

    /** The library for a platform in the jar. */
    private static String resource(String platform) {
        String name = platform.startsWith("windows") ? "tickbus.dll" : platform.startsWith("macos") ? "libtickbus.dylib" : "libtickbus.so";
        return "/tickbus/native/" + platform + "/" + name;
    }

    /** Loads a file, or if another class loader has loaded it, a copy of it where this {@code copies}. */
    private boolean fromFile(String place, String name, boolean copies) {
        Path path;
        try {
            path = Path.of(name).toAbsolutePath();
        } catch (InvalidPathException e) {
            tried.add(place + ": " + e.getMessage());
            return false;
        }
        if (!Files.isRegularFile(path)) {
            tried.add(place + ": " + path + ": no such file");
            return false;
        }
        try {
            System.load(path.toString());
            return true;
        } catch (UnsatisfiedLinkError e) {
            if (!isLoadedElsewhere(e)) {
                tried.add(place + ": " + path + ": " + e.getMessage());
                return false;
            }
            if (!copies) {
                throw new FieldbusException(Status.LIBRARY, path + " is already loaded in another class loader of"
                    + " this process, and Java allows a native library only one.\n  Load tickbus in a class loader"
                    + " that both have as a parent, or set -D" + COPY + "=true to give this one a copy of its own;"
                    + " drivers in different copies do not see each other's loopback links.");
            }
        }
        try (InputStream content = Files.newInputStream(path)) {
            return fromCopy(place + ": copy of " + path, content);
        } catch (IOException e) {
            tried.add(place + ": " + path + " cannot be copied: " + e);
            return false;
        }
    }

    private boolean fromCopy(String place, InputStream content) throws IOException {
        extracts = true;
        Path copy = Files.createTempFile(PREFIX, "-" + file);
        deleteLeftovers(copy);
        // Into the existing file, which only this user can write: a file that replaces it would have the umask's
        // permissions.
        try {
            try (OutputStream into = Files.newOutputStream(copy)) {
                content.transferTo(into);
            }
            System.load(copy.toString());
            return true;
        } catch (UnsatisfiedLinkError e) {
            tried.add(place + ": extracted to " + copy + ": " + e.getMessage());
            return false;
        } finally {
            deleteWherePossible(copy);
        }
    }

    /**
     * Deletes the copies of earlier processes. Windows deletes no library in use, so that a process cannot delete its own;
     * a recent copy may belong to a process that is about to load it.
     */
    private void deleteLeftovers(Path own) {
        Instant recent = Instant.now().minus(RECENT);
        try (DirectoryStream<Path> copies = Files.newDirectoryStream(own.getParent(), PREFIX + "*-" + file)) {
            for (Path copy : copies) {
                if (!copy.equals(own) && Files.getLastModifiedTime(copy).toInstant().isBefore(recent)) {
                    deleteWherePossible(copy);
                }
            }
        } catch (IOException | DirectoryIteratorException e) {
            // Another process deletes them too; or the folder cannot be listed, and they stay.
            return;
        }
    }

    private static void deleteWherePossible(Path copy) {
        try {
            Files.deleteIfExists(copy);
        } catch (IOException e) {
            // In use, or of another user; a later process deletes it.
            return;
        }
    }

    private static boolean isLoadedElsewhere(UnsatisfiedLinkError e) {
        return String.valueOf(e.getMessage()).contains("already loaded in another classloader");
    }

    private FieldbusException failure() {
        StringBuilder what = new StringBuilder("the native library ").append(file).append(" for ").append(platform)
            .append(" cannot be loaded. Looked at, in this order:");
        for (int i = 0; i < tried.size(); i++) {
            what.append("\n  ").append(i + 1).append(". ").append(tried.get(i));
        }
        if (platform.matches(".*-(x86|i[3-6]86|arm)")) {
            what.append("\n  This is a 32-bit JVM; run a 64-bit one.");
        }
        String there = PLATFORMS.stream().filter(name -> NativeLibrary.class.getResource(resource(name)) != null)
            .collect(Collectors.joining(", "));
        if (!there.isEmpty()) {
            what.append("\n  The jar has the library for ").append(there).append('.');
        }
        if (runsOnMusl()) {
            what.append("\n  This JVM runs on the C library musl, but the library in the jar is made for glibc;"
                + " build one on this system.");
        }
        if (extracts) {
            what.append("\n  If the temporary folder ").append(System.getProperty("java.io.tmpdir")).append(" is full or read-only, or")
                .append(" nothing may be run there (noexec), name another one by -Djava.io.tmpdir=FOLDER.");
        }
        if (tried.stream().anyMatch(text -> text.contains("`GLIBC_"))) {
            what.append("\n  This system's C library is too old for it: the library of a release needs glibc 2.28, one that you"
                + " build needs that of the computer that built it.");
        }
        what.append("\n  Name the folder that has ").append(file).append(" by -D").append(DIRECTORY).append("=FOLDER or the variable ")
            .append(VARIABLE).append(", or put the file beside the jar. The zip has it in its folder DeviceDriver, and in the sources"
                + " `cargo build --release` makes it.");
        return new FieldbusException(Status.LIBRARY, what.toString());
    }

    private static boolean runsOnMusl() {
        try {
            return Files.readString(Path.of("/proc/self/maps")).contains("/ld-musl-");
        } catch (IOException e) {
            return false;
        }
    }
}
