package tickbus.simulator;

import java.io.IOException;
import java.io.OutputStream;
import java.nio.charset.StandardCharsets;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.jar.JarEntry;
import java.util.jar.JarOutputStream;
import javax.tools.ToolProvider;

/** Compiles a machine into a jar, as a user would. */
final class MachineJar {
    /** A whole machine. */
    static final String PRESS = """
            package mine;

            import java.util.List;
            import tickbus.simulator.Machine;
            import tickbus.simulator.ModelVariable;

            public class Press implements Machine {
                private boolean down;
                private double force;
                private int strokes;

                public String name() {
                    return "my press";
                }

                public List<String> inputs() {
                    return List.of("down");
                }

                public List<String> outputs() {
                    return List.of("force");
                }

                public List<ModelVariable> variables() {
                    return List.of(new ModelVariable("strokes", "", () -> strokes));
                }

                public void input(int index, double value) {
                    strokes += !down && value >= 0.5 ? 1 : 0;
                    down = value >= 0.5;
                }

                public double output(int index) {
                    return force;
                }

                public void step(long nanos) {
                    force = down ? force + nanos * 1e-9 : 0;
                }
            }
            """;

    private MachineJar() {
    }

    /** Compiles a class {@code mine.Press} into a jar that names it as a machine. */
    static void write(Path work, Path jar, String source, String... options) throws IOException {
        Path classes = Files.createTempDirectory(work, "classes");
        Path file = classes.resolve("mine/Press.java");
        Files.createDirectories(file.getParent());
        Files.writeString(file, source);
        List<String> arguments = new ArrayList<>(List.of("-d", classes.toString(), "-cp",
                System.getProperty("java.class.path")));
        arguments.addAll(List.of(options));
        arguments.add(file.toString());
        if (ToolProvider.getSystemJavaCompiler().run(null, null, null, arguments.toArray(String[]::new)) != 0) {
            throw new IllegalStateException("the machine does not compile");
        }
        write(jar, "mine.Press\n", Files.readAllBytes(classes.resolve("mine/Press.class")));
    }

    /** Writes a jar with a list of machines, unless it is null, and a class {@code mine.Press}, unless it is null. */
    static void write(Path jar, String service, byte[] press) throws IOException {
        try (OutputStream file = Files.newOutputStream(jar); JarOutputStream out = new JarOutputStream(file)) {
            if (service != null) {
                out.putNextEntry(new JarEntry(MachineFolder.SERVICE));
                out.write(service.getBytes(StandardCharsets.UTF_8));
                out.closeEntry();
            }
            out.putNextEntry(new JarEntry("mine/Press.class"));
            if (press != null) {
                out.write(press);
            }
            out.closeEntry();
        }
    }
}
