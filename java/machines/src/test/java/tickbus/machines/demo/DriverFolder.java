package tickbus.machines.demo;

import java.io.IOException;
import java.io.OutputStream;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import java.util.function.UnaryOperator;
import java.util.jar.Attributes;
import java.util.jar.JarOutputStream;
import java.util.jar.Manifest;
import tickbus.simulator.DeviceDriverFolder;

/** A DeviceDriver folder for tests with the real driver. */
public final class DriverFolder {
    private DriverFolder() {
    }

    /**
     * Creates one without a .cfg. The driver's classes are on the test's class path; the folder's jar only names
     * them.
     */
    public static Path make(Path folder) throws IOException {
        Manifest manifest = new Manifest();
        manifest.getMainAttributes().put(Attributes.Name.MANIFEST_VERSION, "1.0");
        manifest.getMainAttributes().putValue(DeviceDriverFolder.DRIVER_CLASS, "DeviceDrivers.FieldbusDriver");
        Files.createDirectories(folder);
        try (OutputStream file = Files.newOutputStream(folder.resolve("driver.jar"));
                JarOutputStream jar = new JarOutputStream(file, manifest)) {
            jar.finish();
        }
        return folder;
    }

    /** The same with the two drivers of the peeling line; these lines replace their {@code [fieldbus]}. */
    public static Path ofPeelingLine(Path folder, UnaryOperator<String> fieldbus) throws IOException {
        make(folder);
        for (String name : List.of("charger", "lathe")) {
            String cfg = Files.readString(Path.of("../../plc/peeler", name + ".cfg"));
            int begin = cfg.indexOf("[fieldbus]\n");
            int end = cfg.indexOf("\n\n", begin);
            Files.writeString(folder.resolve(name + ".cfg"),
                    cfg.substring(0, begin) + "[fieldbus]\n" + fieldbus.apply(name) + cfg.substring(end));
        }
        return folder;
    }

    /** Unchanged, except for ports chosen by the system. */
    public static Path ofPeelingLine(Path folder) throws IOException {
        return ofPeelingLine(folder, name -> "kind = \"socket\"\naddress = \"127.0.0.1:0\"\ncycle = \"10ms\"");
    }

    /** The same with the driver of the testing board. */
    public static Path ofTestingBoard(Path folder) throws IOException {
        make(folder);
        Files.copy(Path.of("../../plc/lab/board.cfg"), folder.resolve("board.cfg"));
        return folder;
    }

    /** The tickbus command beside the native library. */
    public static Path tickbus() {
        boolean windows = System.getProperty("os.name").startsWith("Windows");
        return Path.of(System.getProperty("tickbus.native.dir"), windows ? "tickbus.exe" : "tickbus");
    }
}
