package tickbus.machines.rig;

import java.io.PrintStream;
import tickbus.machines.demo.Plc;
import tickbus.machines.demo.Timeline;

/** One line per event, for logs and pipes. */
final class LogDisplay implements Display {
    private final PrintStream out;

    LogDisplay(PrintStream out) {
        this.out = out;
    }

    @Override
    public void event(Timeline.Event event) {
        out.println(event.line());
    }

    @Override
    public void tick(Watcher watcher, Operator operator, Plc plc) {
        // Events suffice; a line per tick would flood the log.
    }

    @Override
    public void end() {
        out.flush();
    }
}
