package tickbus.junit;

import java.net.URISyntaxException;
import java.net.URL;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.List;
import java.util.Optional;
import java.util.function.Function;
import org.junit.jupiter.api.extension.ExtensionConfigurationException;
import org.junit.jupiter.api.extension.ExtensionContext;
import org.junit.platform.commons.support.AnnotationSupport;
import tickbus.Tickbus;

/** The combined annotations of one test. */
final class Setup {
    private static final long DEFAULT_STEP = 1_000_000;

    private final Class<?> testClass;
    /** From the method outwards: the first one that states an element wins. */
    private final List<PlcTest> annotations;

    private Setup(Class<?> testClass, List<PlcTest> annotations) {
        this.testClass = testClass;
        this.annotations = annotations;
    }

    /** The annotations of a test: on its method, its class, and the enclosing classes. */
    static Setup of(ExtensionContext context) {
        List<PlcTest> found = new ArrayList<>();
        find(context.getElement().orElse(null)).ifPresent(found::add);
        Class<?> testClass = context.getRequiredTestClass();
        for (Class<?> at = testClass; at != null; at = at.getEnclosingClass()) {
            find(at).filter(one -> !found.contains(one)).ifPresent(found::add);
        }
        return new Setup(testClass, found);
    }

    private static Optional<PlcTest> find(java.lang.reflect.AnnotatedElement element) {
        return AnnotationSupport.findAnnotation(element, PlcTest.class);
    }

    /** Opens driver.cfg with the program at its other end, and with further tables. */
    Tickbus open(String moreTables) {
        return Tickbus.open(config(), fieldbus() + moreTables);
    }

    long stepNanos() {
        String text = text(PlcTest::step);
        long nanos;
        try {
            nanos = text.isEmpty() ? DEFAULT_STEP : Durations.parse(text);
        } catch (IllegalArgumentException e) {
            throw new ExtensionConfigurationException("@PlcTest(step = …): " + e.getMessage(), e);
        }
        if (nanos == 0) {
            throw new ExtensionConfigurationException(
                "@PlcTest(step = \"" + text + "\"): a tick takes more than no time; write such as \"2ms\"");
        }
        return nanos;
    }

    /** The class of the machine; {@link Machine} itself for no machine. */
    Class<? extends Machine> machine() {
        return annotations.stream().<Class<? extends Machine>>map(PlcTest::machine)
            .filter(machine -> machine != Machine.class).findFirst().orElse(Machine.class);
    }

    Recording recording() {
        return annotations.stream().map(PlcTest::recording).filter(list -> list.length > 0).map(list -> list[0])
            .findFirst().orElse(Recording.ON_FAILURE);
    }

    private Path config() {
        String name = text(PlcTest::config);
        if (name.isEmpty()) {
            throw new ExtensionConfigurationException(
                "@PlcTest names no driver.cfg; write @PlcTest(config = \"driver.cfg\", …) on the test or its class");
        }
        Path file = Path.of(name);
        if (Files.exists(file)) {
            return file.toAbsolutePath().normalize();
        }
        URL resource = testClass.getResource(name);
        if (resource != null && resource.getProtocol().equals("file")) {
            try {
                return Path.of(resource.toURI());
            } catch (URISyntaxException e) {
                throw new ExtensionConfigurationException("@PlcTest(config = …): " + resource + " is no file", e);
            }
        }
        throw new ExtensionConfigurationException("@PlcTest(config = \"" + name + "\"): there is no file "
            + file.toAbsolutePath().normalize() + ", nor one of that name beside " + testClass.getName()
            + " on the class path; paths begin at the working directory, which is that of the Maven module");
    }

    /** The [fieldbus] table that puts the line into simulation time. */
    private String fieldbus() {
        String program = text(PlcTest::program);
        if (program.isEmpty()) {
            return "[fieldbus]\nmode = \"stepped\"\n";
        }
        StringBuilder table = new StringBuilder("[fieldbus]\nkind = \"loopback\"\nrole = \"device\"\nmode = \"stepped\"\n");
        table.append("program = ").append(Toml.text(isFile(program) ? absolute(program) : program)).append("\n");
        String scan = text(PlcTest::scan);
        if (!scan.isEmpty()) {
            table.append("scan = ").append(Toml.text(scan)).append("\n");
        }
        String[] options = annotations.stream().map(PlcTest::options).filter(list -> list.length > 0).findFirst()
            .orElse(new String[0]);
        List<String> pairs = new ArrayList<>();
        for (String option : options) {
            int equals = option.indexOf('=');
            if (equals < 1) {
                throw new ExtensionConfigurationException(
                    "@PlcTest(options = \"" + option + "\"): write each option as \"key=value\"");
            }
            pairs.add(Toml.text(option.substring(0, equals).strip()) + " = "
                + Toml.text(option.substring(equals + 1).strip()));
        }
        if (!pairs.isEmpty()) {
            table.append("program_options = { ").append(String.join(", ", pairs)).append(" }\n");
        }
        return table.toString();
    }

    /** True if the program is a file rather than a name. */
    private static boolean isFile(String program) {
        return program.contains("/") || program.contains("\\") || program.matches(".*\\.(so|dll|dylib)");
    }

    /** A file relative to the working directory, as an absolute path; driver.cfg can be elsewhere. */
    private static String absolute(String file) {
        return Path.of(file).toAbsolutePath().normalize().toString();
    }

    private String text(Function<PlcTest, String> attribute) {
        return annotations.stream().map(attribute).filter(text -> !text.isEmpty()).findFirst().orElse("");
    }
}
