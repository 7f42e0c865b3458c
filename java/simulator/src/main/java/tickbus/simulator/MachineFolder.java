package tickbus.simulator;

import java.io.IOException;
import java.net.MalformedURLException;
import java.net.URL;
import java.net.URLClassLoader;
import java.nio.file.DirectoryStream;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.Collections;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.ServiceConfigurationError;
import java.util.ServiceLoader;
import java.util.Set;
import java.util.jar.JarFile;

/**
 * A folder of jars with machines of one's own.
 *
 * <p>Each jar names its machines, one class in a line, in {@code META-INF/services/tickbus.simulator.Machine}, as {@link
 * ServiceLoader} requires: public classes with a public constructor without parameters. A machine's name for {@code
 * --machine} is {@link Machine#name()}, so the folder makes an instance of each. Each jar has a class loader
 * of its own below the simulator's; further jars that it needs are named by {@code Class-Path} in its manifest, and are in
 * another folder. Jars are taken in alphabetical order.
 */
public final class MachineFolder implements AutoCloseable {
    /** The file in a jar that names its machines. */
    public static final String SERVICE = "META-INF/services/" + Machine.class.getName();

    private final Map<String, Machine> machines = new LinkedHashMap<>();
    /** The jars of the machines by name. */
    private final Map<String, Path> owners = new LinkedHashMap<>();
    private final List<URLClassLoader> loaders = new ArrayList<>();
    private final List<String> mistakes = new ArrayList<>();

    private MachineFolder() {
    }

    /**
     * Loads the machines of a folder.
     *
     * @param folder the folder
     * @param taken names that the folder's machines must not have
     * @return the machines
     * @throws WrongInput with a sentence for each jar that cannot be used, or if the folder is missing or has no jar
     */
    public static MachineFolder load(Path folder, Set<String> taken) {
        MachineFolder made = new MachineFolder();
        try {
            List<Path> jars = jars(folder);
            jars.forEach(jar -> made.add(jar, taken));
            if (!made.mistakes.isEmpty()) {
                throw new WrongInput(String.join("\n", made.mistakes));
            }
            return made;
        } catch (RuntimeException | Error e) {
            made.close();
            throw e;
        }
    }

    private static List<Path> jars(Path folder) {
        if (!Files.isDirectory(folder)) {
            throw new WrongInput(folder + ": there is no such folder; name the folder that holds the machines' jars");
        }
        List<Path> jars = new ArrayList<>();
        try (DirectoryStream<Path> stream = Files.newDirectoryStream(folder, "*.jar")) {
            stream.forEach(jars::add);
        } catch (IOException e) {
            throw new WrongInput(folder + ": the folder cannot be read: " + e, e);
        }
        if (jars.isEmpty()) {
            throw new WrongInput(folder + ": there is no .jar file in this folder; put the machine's jar there");
        }
        jars.sort(null);
        return jars;
    }

    private void add(Path jar, Set<String> taken) {
        int before = mistakes.size() + machines.size();
        try (JarFile readable = new JarFile(jar.toFile())) {
            // A class loader passes over a file that is no jar.
            if (readable.getEntry(SERVICE) == null) {
                mistakes.add(jar + ": the jar has no machine; it needs a file " + SERVICE
                        + " with the name of a class that implements " + Machine.class.getName());
                return;
            }
        } catch (IOException e) {
            mistakes.add(jar + ": this is no readable jar file: " + e.getMessage());
            return;
        }
        try {
            URLClassLoader loader = new URLClassLoader(jar.getFileName().toString(), new URL[] {jar.toUri().toURL()},
                    Machine.class.getClassLoader());
            loaders.add(loader);
            var providers = ServiceLoader.load(Machine.class, loader).stream().iterator();
            while (providers.hasNext()) {
                ServiceLoader.Provider<Machine> provider = providers.next();
                // The class path of the simulator itself can have machines, too.
                if (provider.type().getClassLoader() == loader) {
                    add(jar, provider, taken);
                }
            }
        } catch (MalformedURLException e) {
            mistakes.add(jar + ": this path cannot be written as a URL");
        } catch (UnsupportedClassVersionError e) {
            mistakes.add(jar + ": the machine is compiled for a newer Java than this one, "
                    + Runtime.version().feature() + "; run a newer Java, or compile it with --release "
                    + Runtime.version().feature() + " (" + e.getMessage() + ")");
        } catch (ServiceConfigurationError | LinkageError e) {
            mistakes.add(jar + ": the machine cannot be loaded: " + reason(e));
        }
        if (mistakes.size() + machines.size() == before) {
            mistakes.add(jar + ": " + SERVICE + " names no class; it needs the name of a class that implements "
                    + Machine.class.getName());
        }
    }

    private void add(Path jar, ServiceLoader.Provider<Machine> provider, Set<String> taken) {
        Machine machine;
        String name;
        try {
            machine = provider.get();
            name = machine.name();
        } catch (ServiceConfigurationError e) {
            // The constructor's own exception is the cause.
            mistakes.add(jar + ": the constructor of " + provider.type().getName() + " failed: "
                    + (e.getCause() == null ? reason(e) : e.getCause().toString()));
            return;
        } catch (RuntimeException e) {
            mistakes.add(jar + ": " + provider.type().getName() + " cannot say its name: " + e);
            return;
        }
        if (name == null || name.isBlank()) {
            mistakes.add(jar + ": " + provider.type().getName() + " has no name; its method name() must return one");
        } else if (taken.contains(name) || owners.containsKey(name)) {
            mistakes.add(jar + ": the name \"" + name + "\" of " + provider.type().getName() + " is taken by "
                    + (taken.contains(name) ? "a machine of the simulator" : owners.get(name).getFileName())
                    + "; its method name() must return another one");
        } else {
            owners.put(name, jar);
            machines.put(name, machine);
        }
    }

    private static String reason(Throwable e) {
        String message = e.getMessage() == null ? e.toString() : e.getMessage();
        String prefix = Machine.class.getName() + ": ";
        return message.startsWith(prefix) ? message.substring(prefix.length()) : e instanceof LinkageError ? e.toString()
                : message;
    }

    /**
     * The machines by name.
     *
     * @return in the order of the jars' names
     */
    public Map<String, Machine> machines() {
        return Collections.unmodifiableMap(machines);
    }

    /** Closes the jars; machines that are made already can load no further classes. */
    @Override
    public void close() {
        for (URLClassLoader loader : loaders) {
            try {
                loader.close();
            } catch (IOException e) {
                // The JVM closes the open jar files; nothing depends on that.
            }
        }
    }
}
