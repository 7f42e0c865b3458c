package tickbus;

import java.lang.reflect.InvocationTargetException;
import java.lang.reflect.Method;
import java.net.URI;
import java.net.URL;
import java.net.URLClassLoader;

/** Program of a child JVM: loads the library, in a second class loader as well if the property says so. */
final class LoadLibrary {
    private LoadLibrary() {
    }

    public static void main(String[] arguments) throws Exception {
        try {
            NativeLibrary.load();
            System.out.println("loaded");
            String second = System.getProperty("second");
            if (second != null) {
                loadIn(URI.create(second).toURL());
                System.out.println("loaded");
            }
        } catch (RuntimeException e) {
            System.out.println(e.getMessage());
            System.exit(1);
        }
    }

    private static void loadIn(URL jar) throws Exception {
        try (URLClassLoader loader = new URLClassLoader(new URL[] {jar}, ClassLoader.getPlatformClassLoader())) {
            Method load = loader.loadClass("tickbus.NativeLibrary").getDeclaredMethod("load");
            load.setAccessible(true);
            load.invoke(null);
        } catch (InvocationTargetException e) {
            throw (RuntimeException) e.getCause();
        }
    }
}
