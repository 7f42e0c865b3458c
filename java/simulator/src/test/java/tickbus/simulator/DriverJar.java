package tickbus.simulator;

import java.io.IOException;
import java.io.OutputStream;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import java.util.jar.Attributes;
import java.util.jar.JarEntry;
import java.util.jar.JarOutputStream;
import java.util.jar.Manifest;
import javax.tools.ToolProvider;

/** Compiles drivers into jars that a test puts into a folder. They log what they do in a system property. */
public final class DriverJar {
    /** The property. */
    static final String LOG = "tickbus.test.log";

    private static final Map<String, String> SOURCES = Map.of(
            "drivers.Good", """
            package drivers;

            import controlinterface.*;
            import java.nio.file.*;
            import java.util.List;

            public class Good extends ControlInterfaceDeviceDriver {
                private final String file;
                private final int id;

                public Good(Path cfg) throws Exception {
                    file = cfg.getFileName().toString();
                    String text = Files.readString(cfg);
                    id = text.contains("# mine") ? 10 : text.contains("id = 2") ? 2 : 1;
                    if (text.contains("# fail")) {
                        throw new IllegalStateException("the card is missing");
                    }
                    log("open ");
                }

                private void log(String what) {
                    System.setProperty("tickbus.test.log",
                            System.getProperty("tickbus.test.log", "") + what + file + ",");
                }

                public void updateComponentValues(double[] value) {
                    deliverHardwareInputs(new double[] {value[0]});
                }

                public List<HardwareComponent> components() {
                    return List.of(new HardwareComponent("level", Direction.WRITTEN_BY_SIMULATION, "REAL", "mm"),
                            new HardwareComponent("lamp", Direction.READ_BY_SIMULATION, "BOOL", ""));
                }

                public int id() {
                    return id;
                }

                public String name() {
                    return "good";
                }

                public void exit() {
                    log("exit ");
                }
            }
            """,
            "drivers.Shy", "package drivers; import java.nio.file.Path; public class Shy extends Good {"
                    + " public Shy(Path p) throws Exception { super(p); }"
                    + " public static Good look(Path p) throws Exception { Good looked = new Good(p);"
                    + " System.setProperty(\"tickbus.test.log\", \"look \"); return looked; } }",
            "drivers.Unrelated", "package drivers; public class Unrelated { public Unrelated(java.nio.file.Path p) {} }",
            "drivers.Shapeless", "package drivers; public abstract class Shapeless extends Good {"
                    + " public Shapeless(java.nio.file.Path p) throws Exception { super(p); } }",
            "drivers.NoPath", "package drivers; public class NoPath extends Good {"
                    + " public NoPath() throws Exception { super(null); } }");

    private DriverJar() {
    }

    /** Writes a jar with some of the classes; no manifest entry if {@code driverClass} is null. */
    public static void write(Path work, Path jar, String driverClass, String... classes) throws IOException {
        List<String> arguments = new ArrayList<>(List.of("-d", work.toString(), "-cp",
                System.getProperty("java.class.path")));
        for (String name : classes) {
            Path source = work.resolve(name.replace('.', '/') + ".java");
            Files.createDirectories(source.getParent());
            Files.writeString(source, SOURCES.get(name));
            arguments.add(source.toString());
        }
        if (classes.length > 0) {
            int code = ToolProvider.getSystemJavaCompiler().run(null, null, null, arguments.toArray(String[]::new));
            if (code != 0) {
                throw new IllegalStateException("the driver does not compile");
            }
        }
        Manifest manifest = new Manifest();
        manifest.getMainAttributes().put(Attributes.Name.MANIFEST_VERSION, "1.0");
        if (driverClass != null) {
            manifest.getMainAttributes().putValue(DeviceDriverFolder.DRIVER_CLASS, driverClass);
        }
        try (OutputStream file = Files.newOutputStream(jar);
                JarOutputStream out = new JarOutputStream(file, manifest)) {
            for (String name : classes) {
                String entry = name.replace('.', '/') + ".class";
                out.putNextEntry(new JarEntry(entry));
                out.write(Files.readAllBytes(work.resolve(entry)));
                out.closeEntry();
            }
        }
    }
}
