package tickbus.simulator;

import java.io.IOException;
import java.io.OutputStream;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.jar.Attributes;
import java.util.jar.JarOutputStream;
import java.util.jar.Manifest;

/** A DeviceDriver folder for tests that meet the real driver. */
public final class DriverFolder {
    private DriverFolder() {
    }

    /** Makes one without a .cfg. The driver's classes are on the test's class path; the folder's jar only names them. */
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

    /** The tickbus command beside the native library. */
    public static Path tickbus() {
        boolean windows = System.getProperty("os.name").startsWith("Windows");
        return Path.of(System.getProperty("tickbus.native.dir"), windows ? "tickbus.exe" : "tickbus");
    }
}
