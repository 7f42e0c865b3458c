package tickbus.machines.cell;

import controlinterface.ControlInterfaceDeviceDriver;
import java.util.Locale;
import java.util.Map;
import java.util.TreeMap;
import java.util.stream.Collectors;
import tickbus.machines.demo.Timeline;
import tickbus.simulator.Simulator;
import tickbus.simulator.text.Columns;
import tickbus.simulator.text.Durations;

/** The report as text, written when the demo is over. */
final class CellReport {
    private final StringBuilder text = new StringBuilder();

    private CellReport() {
    }

    /** The cylinders by kind, as {@code 10:2,20:2}, with the codes of the kinds. */
    static String kinds(ManufacturingCell cell) {
        Map<Integer, Integer> kinds = new TreeMap<>();
        cell.delivered().forEach(piece -> kinds.merge(PieceKind.of(piece).code(), 1, Integer::sum));
        return kinds.entrySet().stream().map(one -> String.format(Locale.ROOT, "%02x:%d", one.getKey(), one.getValue()))
                .collect(Collectors.joining(","));
    }

    /**
     * Writes a report.
     *
     * @param nets the last counts of the nets' process
     * @param markings a line {@code net=firings, marking} for each net
     * @param simulator the simulator; null if it did not start
     */
    static String write(CellOptions options, String verdict, Timeline timeline, ManufacturingCell cell,
            Map<String, String> nets, String markings, Simulator simulator) {
        CellReport report = new CellReport();
        report.text.append("The manufacturing cell\n======================\n\n").append(verdict).append('\n');
        report.configuration(options, simulator);
        report.heading("Timeline, in simulation time");
        timeline.events().forEach(event -> report.text.append("  ").append(event.line()).append('\n'));
        report.cylinders(cell);
        report.counters(cell.counters());
        report.heading("The nets at the end");
        report.text.append(markings.isEmpty() ? "  none\n" : markings.replaceAll("(?m)^([^=]*)=", "  $1: "));
        report.table("What the nets' process counts", nets);
        if (simulator != null) {
            for (ControlInterfaceDeviceDriver driver : simulator.drivers()) {
                report.statistics(driver);
            }
        }
        return report.text.toString();
    }

    private void heading(String heading) {
        text.append('\n').append(heading).append('\n').append("-".repeat(heading.length())).append("\n\n");
    }

    private void configuration(CellOptions options, Simulator simulator) {
        heading("Configuration");
        Columns table = new Columns("what", "value");
        table.row("driver folder", options.drivers());
        table.row("control table", options.control());
        table.row("step size", Durations.text(options.stepNanos()));
        table.row("cylinders to make", options.cylinders());
        if (simulator != null) {
            table.row("ticks", simulator.ticks());
            table.row("late ticks", simulator.lateTicks());
            table.row("dropped ticks", simulator.droppedTicks());
        }
        text.append(table.text("  "));
    }

    private void cylinders(ManufacturingCell cell) {
        heading("Cylinders");
        Columns table = new Columns(">sleeve", "kind", ">code", "complete");
        for (Workpiece piece : cell.delivered()) {
            PieceKind kind = PieceKind.of(piece);
            table.row(piece.number(), kind.name().toLowerCase(Locale.ROOT).replace('_', ' '),
                    String.format(Locale.ROOT, "%02x", kind.code()), piece.isComplete() ? "yes" : "no");
        }
        text.append(table.text("  "));
    }

    private void counters(Counters counters) {
        heading("What happened in the cell");
        Columns table = new Columns("count", ">value");
        table.row("sleeves taken", counters.begun());
        table.row("loader jams that were freed", counters.loaderJams());
        table.row("stuck pallets that were freed", counters.palletJams());
        table.row("vacuum lost", counters.vacuumLosses());
        table.row("carriers missed, and read after all", counters.carriersMissed());
        table.row("pieces fallen", counters.fallen());
        table.row("parts pressed into nothing", counters.wasted());
        table.row("steps in which an arm collided", counters.collisions());
        text.append(table.text("  "));
    }

    private void statistics(ControlInterfaceDeviceDriver driver) {
        try {
            table("Statistics of driver " + driver.id(), driver.statistics());
        } catch (RuntimeException e) {
            // A driver that has failed or is closed can lack statistics; the rest of the report is still useful.
            text.append("  none: ").append(e.getMessage()).append('\n');
        }
    }

    private void table(String heading, Map<String, String> values) {
        heading(heading);
        Columns table = new Columns("key", ">value");
        values.forEach(table::row);
        text.append(values.isEmpty() ? "  none\n" : table.text("  "));
    }
}
