import java.nio.file.Path;
import tickbus.Tickbus;

/** Opens the driver.cfg that is named, exchanges once, and ends; without an argument it only ends. */
class FirstExchange {
    public static void main(String[] arguments) {
        if (arguments.length == 0) {
            return;
        }
        try (Tickbus bus = Tickbus.open(Path.of(arguments[0]))) {
            bus.exchange(0);
        }
    }
}
