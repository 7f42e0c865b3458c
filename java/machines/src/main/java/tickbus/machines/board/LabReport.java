package tickbus.machines.board;

import controlinterface.ControlInterfaceDeviceDriver;
import tickbus.machines.demo.Timeline;
import tickbus.simulator.Simulator;
import tickbus.simulator.text.Columns;
import tickbus.simulator.text.Durations;

/** The report as text, written when the demo is over. */
final class LabReport {
    private final StringBuilder text = new StringBuilder();

    private LabReport() {
    }

    /**
     * Writes a report.
     *
     * @param verdict the demo's last line
     * @param facts the measurements
     * @param timeline the events
     * @param run {@link #run}, empty if the simulator did not start
     */
    static String write(String verdict, LabFacts facts, Timeline timeline, String run) {
        LabReport report = new LabReport();
        report.text.append("The virtual laboratory\n======================\n\n").append(verdict).append('\n');
        report.heading("What was measured");
        Columns table = new Columns("what", ">here", "as it should be");
        for (Object[] row : facts.rows()) {
            table.row(row);
        }
        report.text.append(table.text("  "));
        report.heading("Timeline, in simulation time");
        timeline.events().forEach(event -> report.text.append("  ").append(event.line()).append('\n'));
        return report.text.append(run).toString();
    }

    /**
     * The part about the simulator, which must still be running.
     *
     * @param options the options of the demo
     * @param simulator the running simulator
     */
    static String run(LabOptions options, Simulator simulator) {
        LabReport report = new LabReport();
        report.configuration(options, simulator);
        return report.text.toString();
    }

    private void heading(String heading) {
        text.append('\n').append(heading).append('\n').append("-".repeat(heading.length())).append("\n\n");
    }

    private void configuration(LabOptions options, Simulator simulator) {
        heading("Configuration");
        Columns table = new Columns("what", "value");
        table.row("driver folder", options.drivers());
        table.row("control table", options.control());
        table.row("programs of the controllers", options.programs());
        table.row("step size", Durations.text(options.stepNanos()));
        table.row("ticks", simulator.ticks());
        table.row("late ticks", simulator.lateTicks());
        table.row("dropped ticks", simulator.droppedTicks());
        text.append(table.text("  "));
        simulator.drivers().forEach(this::statistics);
    }

    private void statistics(ControlInterfaceDeviceDriver driver) {
        heading("Statistics of driver " + driver.id() + ", " + driver.name());
        try {
            Columns table = new Columns("key", ">value");
            driver.statistics().forEach(table::row);
            text.append(table.text("  "));
        } catch (RuntimeException e) {
            // A driver that has failed can lack statistics; the rest of the report is still useful.
            text.append("  none: ").append(e.getMessage()).append('\n');
        }
    }
}
