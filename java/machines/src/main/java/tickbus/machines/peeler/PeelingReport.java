package tickbus.machines.peeler;

import controlinterface.ControlInterfaceDeviceDriver;
import java.util.Locale;
import java.util.Map;
import tickbus.machines.demo.Timeline;
import tickbus.simulator.text.Columns;
import tickbus.simulator.text.Durations;

/** The report as text, written when the demo is over. */
final class PeelingReport {
    private final StringBuilder text = new StringBuilder();

    private PeelingReport() {
    }

    /** The tables about the links, which the demo also prints at its end. */
    static String tables(Map<Intervals.Direction, Intervals> intervals, CommandRate rate) {
        PeelingReport report = new PeelingReport();
        report.intervals(intervals);
        report.commands(rate);
        return report.text.toString();
    }

    /**
     * Writes a report.
     *
     * @param options the options of the demo
     * @param verdict the demo's last line
     * @param timeline the events
     * @param watcher the run, null if it did not start
     * @param tables {@link #tables}, empty if the run did not start
     * @param rate commands of the axes
     */
    static String write(PeelingOptions options, String verdict, Timeline timeline, LineWatcher watcher, String tables,
            CommandRate rate) {
        PeelingReport report = new PeelingReport();
        report.text.append("The peeling line\n================\n\n").append(verdict).append('\n').append(tables);
        if (watcher != null) {
            report.wood(watcher);
            report.axes(rate);
        }
        report.heading("Timeline, in simulation time");
        timeline.events().forEach(event -> report.text.append("  ").append(event.line()).append('\n'));
        report.configuration(options, watcher);
        return report.text.toString();
    }

    private void heading(String heading) {
        text.append('\n').append(heading).append('\n').append("-".repeat(heading.length())).append("\n\n");
    }

    private void intervals(Map<Intervals.Direction, Intervals> intervals) {
        heading("Time from one record to the next, where they arrive, in ms");
        Columns table = new Columns("direction", "where", ">count", ">mean", ">max", ">min", ">variance", ">deviation");
        intervals.forEach((direction, here) -> {
            table.row(here.cells("here", direction.text()));
            table.row(direction.paper().cells("2018", ""));
        });
        text.append(table.text("  "));
        text.append("""

              here: by the end that receives, which takes the time when it has read the last byte of a record. The simulator's
              driver does so for records of the PLCs, and each PLC's process for records of the simulator. All of it runs on
              one machine, over its loopback network. A time of 0 is that of two records that were read at once.
              2018: table 4 of S. Nyyssonen's thesis, two S7-1500 and a PC on an Ethernet, seen by Wireshark at the PC. Its
              variances are printed there 1000 times smaller and in ms; they fit the other figures as seconds squared / 1000.
            """);
    }

    private void commands(CommandRate rate) {
        heading("Commands per second and axis");
        Columns table = new Columns("axis", ">in the mean", ">most in a second", ">2018: at most");
        table.row("mean of all 25", rate(rate.mean()), "", "2");
        AxisName busiest = rate.busiest();
        table.row("busiest: " + busiest.label(), rate(rate.mean(busiest)), rate.most(busiest), "2");
        text.append(table.text("  "));
        text.append("""

              2018: Execute had to stay on for 500 ms, because nothing told that it had been seen; here the link acknowledges.
            """);
    }

    private static String rate(double value) {
        return String.format(Locale.ROOT, "%.2f", value);
    }

    private void wood(LineWatcher watcher) {
        heading("Wood");
        Wood wood = watcher.line().wood();
        Columns table = new Columns("what", ">value", "unit");
        table.row("blocks in the lathe", wood.blocks(), "");
        table.row("peeled to their cores", wood.coreCount(), "");
        table.row("whole ribbon", volume(wood.ribbon(), 1), "m");
        table.row("whole ribbon", volume(wood.veneer(), 5), "m3");
        table.row("torn pieces on the veneer belt", volume(wood.torn(), 5), "m3");
        table.row("chipped in rounding up", volume(wood.chipped(), 5), "m3");
        table.row("cores", volume(wood.cores(), 5), "m3");
        table.row("fallen before they were peeled", volume(wood.unpeeled(), 5), "m3");
        table.row("still between the spindles", volume(watcher.line().held(), 5), "m3");
        table.row("sum of these", volume(LineCheck.found(watcher.line()), 5), "m3");
        table.row("volume of the blocks", volume(wood.chucked(), 5), "m3");
        text.append(table.text("  "));
    }

    private static String volume(double value, int decimals) {
        return String.format(Locale.ROOT, "%." + decimals + "f", value);
    }

    private void axes(CommandRate rate) {
        heading("Commands by axis");
        Columns table = new Columns("PLC", "axis", ">commands", ">per second", ">most in a second");
        for (AxisName axis : AxisName.values()) {
            table.row(axis.ofCharger() ? "charger" : "lathe", axis.label(), rate.commands(axis), rate(rate.mean(axis)), rate.most(axis));
        }
        text.append(table.text("  "));
    }

    private void configuration(PeelingOptions options, LineWatcher watcher) {
        heading("Configuration");
        Columns table = new Columns("what", "value");
        table.row("driver folder", options.drivers());
        table.row("control table", options.control());
        table.row("PLC programs", options.plc() + " plc " + String.join(", ", Plcs.PROGRAMS));
        table.row("step size", Durations.text(options.stepNanos()));
        table.row("blocks to peel", options.logs());
        if (watcher != null) {
            table.row("ticks", watcher.simulator().ticks());
            table.row("late ticks", watcher.simulator().lateTicks());
            table.row("dropped ticks", watcher.simulator().droppedTicks());
        }
        text.append(table.text("  "));
        if (watcher != null) {
            watcher.simulator().drivers().forEach(this::statistics);
        }
    }

    private void statistics(ControlInterfaceDeviceDriver driver) {
        heading("Statistics of driver " + driver.id() + ", " + driver.name());
        try {
            Columns table = new Columns("key", ">value");
            driver.statistics().forEach(table::row);
            text.append(table.text("  "));
        } catch (RuntimeException e) {
            // A driver that has failed or is closed can lack statistics; the rest of the report is still useful.
            text.append("  none: ").append(e.getMessage()).append('\n');
        }
    }
}
