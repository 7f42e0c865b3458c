package tickbus.simulator;

import controlinterface.ControlInterfaceDeviceDriver;
import java.io.IOException;
import java.lang.reflect.InvocationTargetException;
import java.lang.reflect.Method;
import java.lang.reflect.Modifier;
import java.net.MalformedURLException;
import java.net.URL;
import java.net.URLClassLoader;
import java.nio.file.DirectoryStream;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.LinkedHashMap;
import java.util.List;
import java.util.Map;
import java.util.function.Function;
import java.util.jar.JarFile;
import java.util.jar.Manifest;

/**
 * A folder of device drivers, as the simulation program of the 2003 thesis scans at its start.
 *
 * <p>All {@code *.jar} files go into one class loader below the simulator's own; the manifest of one of
 * them names the driver class by its main attribute {@code Device-Driver-Class}. Every {@code *.cfg} file
 * is one driver: an instance of that class, made by its public constructor that takes the file's
 * {@link Path}. Files are taken in alphabetical order.
 */
public final class DeviceDriverFolder {
    /** The manifest attribute that names the driver class. */
    public static final String DRIVER_CLASS = "Device-Driver-Class";

    private final List<Path> jars;
    private final Map<Integer, Path> configurations;
    private final String driverClass;

    private DeviceDriverFolder(List<Path> jars, Map<Integer, Path> configurations, String driverClass) {
        this.jars = jars;
        this.configurations = configurations;
        this.driverClass = driverClass;
    }

    /**
     * Reads the contents of a folder, without opening any driver.
     *
     * @param folder the folder
     * @return the contents
     * @throws WrongInput if the folder is missing, has no jar or no {@code .cfg}, if no jar or more than one
     *     names a driver class, or if two files claim one id
     */
    public static DeviceDriverFolder scan(Path folder) {
        if (!Files.isDirectory(folder)) {
            throw new WrongInput(folder + ": there is no such folder; name the folder that holds the driver's jar"
                    + " and its .cfg files");
        }
        List<Path> jars = files(folder, "*.jar");
        if (jars.isEmpty()) {
            throw new WrongInput(folder + ": there is no .jar file in this folder; put the driver's jar there");
        }
        List<Path> files = files(folder, "*.cfg");
        if (files.isEmpty()) {
            throw new WrongInput(folder + ": there is no .cfg file in this folder; put one there for each driver");
        }
        Map<Integer, Path> configurations = new LinkedHashMap<>();
        for (Path cfg : files) {
            int id = DriverId.read(cfg);
            Path other = configurations.putIfAbsent(id, cfg);
            if (other != null) {
                throw new WrongInput(other.getFileName() + " and " + cfg.getFileName() + " in " + folder
                        + " have the same id " + id + "; give every driver an id of its own");
            }
        }
        return new DeviceDriverFolder(jars, configurations, driverClass(folder, jars));
    }

    private static List<Path> files(Path folder, String pattern) {
        List<Path> files = new ArrayList<>();
        try (DirectoryStream<Path> stream = Files.newDirectoryStream(folder, pattern)) {
            stream.forEach(files::add);
        } catch (IOException e) {
            throw new WrongInput(folder + ": the folder cannot be read: " + e, e);
        }
        files.sort(null);
        return files;
    }

    private static String driverClass(Path folder, List<Path> jars) {
        String found = null;
        Path where = null;
        for (Path jar : jars) {
            String name = driverClass(jar);
            if (name != null && found != null && !name.equals(found)) {
                throw new WrongInput(where.getFileName() + " names the driver class " + found + " and "
                        + jar.getFileName() + " names " + name + "; a folder holds one kind of driver,"
                        + " so give each a folder");
            }
            if (name != null) {
                found = name;
                where = jar;
            }
        }
        if (found == null) {
            throw new WrongInput(folder + ": no jar in this folder has the manifest entry " + DRIVER_CLASS
                    + ", which names the driver class; looked into "
                    + String.join(", ", jars.stream().map(jar -> jar.getFileName().toString()).toList()));
        }
        return found;
    }

    private static String driverClass(Path jar) {
        try (JarFile file = new JarFile(jar.toFile())) {
            Manifest manifest = file.getManifest();
            String name = manifest == null ? null : manifest.getMainAttributes().getValue(DRIVER_CLASS);
            return name == null ? null : name.strip();
        } catch (IOException e) {
            throw new WrongInput(jar + ": this is no readable jar file: " + e.getMessage(), e);
        }
    }

    /**
     * The drivers' files.
     *
     * @return ids and files in the order of the files' names
     */
    public Map<Integer, Path> configurations() {
        return Map.copyOf(configurations);
    }

    /**
     * Opens a driver for each {@code .cfg} file.
     *
     * @return all of them, open
     * @throws WrongInput if the driver class is missing or unsuitable
     * @throws DriverFailure if a driver fails to open; those opened before it are closed again
     */
    public DriverSet open() {
        return make(DeviceDriverFolder::constructor);
    }

    /**
     * Describes the driver of each {@code .cfg} file: by the public static method {@code look} of the driver class, which
     * takes the file's {@link Path} and opens nothing. A driver whose class has no such method is opened.
     *
     * @return all of them, for {@link DriverSet#list}
     * @throws WrongInput as {@link #open}
     * @throws DriverFailure as {@link #open}
     */
    public DriverSet look() {
        return make(type -> {
            try {
                Method look = type.getMethod("look", Path.class);
                return Modifier.isStatic(look.getModifiers())
                        ? cfg -> (ControlInterfaceDeviceDriver) look.invoke(null, cfg)
                        : constructor(type);
            } catch (NoSuchMethodException e) {
                return constructor(type);
            }
        });
    }

    /** Makes a driver of its file. */
    private interface Maker {
        ControlInterfaceDeviceDriver make(Path cfg) throws ReflectiveOperationException;
    }

    private DriverSet make(Function<Class<? extends ControlInterfaceDeviceDriver>, Maker> how) {
        URLClassLoader loader = new URLClassLoader("DeviceDriver folder", urls(),
                DeviceDriverFolder.class.getClassLoader());
        List<ControlInterfaceDeviceDriver> drivers = new ArrayList<>();
        try {
            Maker maker = maker(how, loader);
            for (Map.Entry<Integer, Path> one : configurations.entrySet()) {
                ControlInterfaceDeviceDriver driver = make(maker, one.getValue());
                drivers.add(driver);
                if (driver.id() != one.getKey()) {
                    throw new WrongInput(one.getValue().getFileName() + ": its driver says that it has the id "
                            + driver.id() + ", but the simulator reads " + one.getKey() + " from the file");
                }
            }
            return new DriverSet(drivers, loader);
        } catch (RuntimeException | Error e) {
            try {
                new DriverSet(drivers, loader).close();
            } catch (DriverFailure second) {
                e.addSuppressed(second);
            }
            throw e;
        }
    }

    private URL[] urls() {
        List<URL> urls = new ArrayList<>();
        for (Path jar : jars) {
            try {
                urls.add(jar.toUri().toURL());
            } catch (MalformedURLException e) {
                throw new WrongInput(jar + ": this path cannot be written as a URL", e);
            }
        }
        return urls.toArray(URL[]::new);
    }

    private Maker maker(Function<Class<? extends ControlInterfaceDeviceDriver>, Maker> how, ClassLoader loader) {
        try {
            return how.apply(driverClass(loader));
        } catch (LinkageError e) {
            throw new DriverFailure("the driver class " + driverClass + " cannot be loaded", e);
        }
    }

    private Class<? extends ControlInterfaceDeviceDriver> driverClass(ClassLoader loader) {
        try {
            return Class.forName(driverClass, true, loader).asSubclass(ControlInterfaceDeviceDriver.class);
        } catch (ClassNotFoundException e) {
            throw new WrongInput("no jar in the folder has the class " + driverClass + " that " + DRIVER_CLASS
                    + " names", e);
        } catch (ClassCastException e) {
            throw new WrongInput("the driver class " + driverClass + " does not extend "
                    + ControlInterfaceDeviceDriver.class.getName(), e);
        }
    }

    private static Maker constructor(Class<? extends ControlInterfaceDeviceDriver> type) {
        try {
            return type.getConstructor(Path.class)::newInstance;
        } catch (NoSuchMethodException e) {
            throw new WrongInput("the driver class " + type.getName()
                    + " has no public constructor that takes a java.nio.file.Path, its .cfg file", e);
        }
    }

    private ControlInterfaceDeviceDriver make(Maker maker, Path cfg) {
        try {
            return maker.make(cfg);
        } catch (InvocationTargetException e) {
            throw new DriverFailure("the driver of " + cfg.getFileName() + " failed to open", e.getCause());
        } catch (InstantiationException e) {
            throw new WrongInput("the driver class " + driverClass + " is abstract", e);
        } catch (IllegalAccessException e) {
            throw new WrongInput("the driver class " + driverClass + " is not public", e);
        } catch (ReflectiveOperationException e) {
            throw new DriverFailure("the driver of " + cfg.getFileName() + " cannot be made", e);
        }
    }
}
