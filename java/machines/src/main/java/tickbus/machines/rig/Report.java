package tickbus.machines.rig;

import controlinterface.ControlInterfaceDeviceDriver;
import java.util.List;
import java.util.Map;
import tickbus.machines.demo.Timeline;
import tickbus.simulator.Simulator;
import tickbus.simulator.text.Columns;
import tickbus.simulator.text.Durations;

/** The report as text, written when the demo is over. */
final class Report {
    private final StringBuilder text = new StringBuilder();

    private Report() {
    }

    /**
     * Writes a report.
     *
     * @param options the options of the demo
     * @param verdict the demo's last line
     * @param timeline the events
     * @param run the run, null if it did not start
     * @param audit the comparison of edges, null if it did not start
     * @param operator the operator, null if it did not start
     */
    static String write(DemoOptions options, String verdict, Timeline timeline, Watcher run, EdgeAudit audit,
            Operator operator) {
        Report report = new Report();
        report.text.append("The test rig demo\n=================\n\n").append(verdict).append('\n');
        report.configuration(options, run);
        report.timeline(timeline);
        report.outage(operator == null ? null : operator.outage());
        report.edges(audit == null ? List.of() : audit.lives());
        if (run != null) {
            report.faults(run.faults());
            report.counters(run);
            for (ControlInterfaceDeviceDriver driver : run.simulator().drivers()) {
                report.statistics(driver);
            }
        }
        return report.text.toString();
    }

    private void heading(String heading) {
        text.append('\n').append(heading).append('\n').append("-".repeat(heading.length())).append("\n\n");
    }

    private void configuration(DemoOptions options, Watcher run) {
        heading("Configuration");
        Columns table = new Columns("what", "value");
        table.row("driver folder", options.drivers());
        table.row("control table", options.control());
        table.row("mode", options.mode().name().toLowerCase(java.util.Locale.ROOT).replace('_', '-'));
        table.row("step size", Durations.text(options.stepNanos()));
        table.row("cycles", options.cycles());
        table.row("jam in cycle", options.jamCycle());
        table.row("PLC", options.plc() == null ? "not the demo's affair" : options.plc() + ", killed in cycle "
                + options.killCycle());
        table.row("time limit", Durations.text(options.timeLimitNanos()));
        if (run != null) {
            run.simulator().drivers().forEach(driver -> table.row("driver " + driver.id(), driver.name()));
            table.row("machine", run.rig().name());
        }
        text.append(table.text("  "));
    }

    private void timeline(Timeline timeline) {
        heading("Timeline, in simulation time");
        timeline.events().forEach(event -> text.append("  ").append(event.line()).append('\n'));
    }

    private void outage(Outage outage) {
        if (outage != null) {
            heading("The outage, in simulation time");
            text.append(outage.text("  "));
        }
    }

    private void edges(List<EdgeAudit.Life> lives) {
        heading("Rising edges at both ends");
        if (lives.isEmpty()) {
            text.append("  not compared\n");
        }
        for (EdgeAudit.Life life : lives) {
            if (life.number() > 1) {
                text.append('\n');
            }
            text.append("  Life ").append(life.number()).append(" of the PLC, until: ").append(life.end())
                    .append("\n\n");
            Columns table = new Columns("signal", "direction", ">made", ">seen", ">missed");
            for (EdgeAudit.Line line : life.lines()) {
                long made = line.toPlc() ? line.here() : line.there();
                long seen = line.toPlc() ? line.there() : line.here();
                table.row(line.signal(), line.toPlc() ? "simulation to PLC" : "PLC to simulation", made, seen,
                        line.missed());
            }
            text.append(table.text("  "));
        }
    }

    private void faults(List<String> faults) {
        heading("Faults");
        if (faults.isEmpty()) {
            text.append("  none\n");
        }
        faults.forEach(fault -> text.append("  ").append(fault).append('\n'));
    }

    private void counters(Watcher run) {
        heading("Counters");
        Simulator simulator = run.simulator();
        Counters rig = run.rig().counters();
        Columns table = new Columns("count", ">value");
        table.row("ticks", simulator.ticks());
        table.row("stale ticks at the start", run.staleTicksAtStart());
        table.row("stale ticks in the outage", run.staleTicksInOutage());
        table.row("late ticks", simulator.lateTicks());
        table.row("dropped ticks", simulator.droppedTicks());
        table.row("cycles that the PLC counts", run.cycles());
        table.row("cycles that the rig counts", rig.cycles());
        table.row("bottles fed", rig.fed());
        table.row("bottles treated", rig.treated());
        table.row("bottles delivered", rig.delivered());
        table.row("bottles removed by hand", rig.removed());
        table.row("bottles fallen", rig.fallen());
        table.row("bottles in the rig", run.rig().bottles().size());
        table.row("jams", rig.jams());
        table.row("collisions", rig.collisions());
        table.row("times Not OK rose", rig.faults());
        table.row("index commands ignored", rig.retriggers());
        table.row("lamp errors", rig.lampErrors());
        text.append(table.text("  "));
    }

    private void statistics(ControlInterfaceDeviceDriver driver) {
        heading("Statistics of driver " + driver.id());
        try {
            Map<String, String> statistics = driver.statistics();
            Columns table = new Columns("key", ">value");
            statistics.forEach(table::row);
            text.append(statistics.isEmpty() ? "  none\n" : table.text("  "));
        } catch (RuntimeException e) {
            // A driver that has failed or is closed can lack statistics; the rest of the report is still useful.
            text.append("  none: ").append(e.getMessage()).append('\n');
        }
    }
}
