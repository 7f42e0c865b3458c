import java.nio.file.Path;
import java.time.Duration;
import tickbus.Pace;
import tickbus.Tickbus;

/** {{name}}: the simulated machine. */
class Machine {
    public static void main(String[] args) throws InterruptedException {
        try (var plc = Tickbus.open(Path.of("driver.cfg"))) {
{{signals}}            Pace pace = Pace.every(Duration.ofMillis(10));
            for (int turn = 0; !plc.isOver(); turn++) {
                int status = plc.receive(pace.await());     // 0 fresh, 1 unchanged, 2 stale
{{model}}                plc.send();                                 // the PLC is answered within the turn
                if (turn % 100 == 0) {
                    System.out.printf("%s%n", {{shown}});
                }
            }
        }
    }
}
