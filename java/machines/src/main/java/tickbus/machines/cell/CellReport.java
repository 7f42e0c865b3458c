package tickbus.machines.cell;

import controlinterface.ControlInterfaceDeviceDriver;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import java.util.Locale;
import java.util.Map;
import java.util.TreeMap;
import java.util.stream.Collectors;
import java.util.stream.Stream;
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
        report.stations(nets);
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
        Columns table = new Columns(">sleeve", "kind", ">code", "complete", ">begun", ">out", ">took", ">after the last");
        long last = 0;
        for (Workpiece piece : cell.delivered()) {
            PieceKind kind = PieceKind.of(piece);
            table.row(piece.number(), kind.name().toLowerCase(Locale.ROOT).replace('_', ' '),
                    String.format(Locale.ROOT, "%02x", kind.code()), piece.isComplete() ? "yes" : "no",
                    seconds(piece.begunNanos()), seconds(piece.deliveredNanos()), seconds(piece.deliveredNanos() - piece.begunNanos()),
                    last == 0 ? "" : seconds(piece.deliveredNanos() - last));
            last = piece.deliveredNanos();
        }
        text.append(table.text("  "));
    }

    private static String seconds(long nanos) {
        return String.format(Locale.ROOT, "%.2f s", nanos * 1e-9);
    }

    /** Shares of the time in which the cell ran, from the markings of the nets. */
    private void stations(Map<String, String> nets) {
        heading("The stations while the cell ran");
        Columns table = new Columns("station", ">pallets", ">a pallet", ">working", ">short of parts", ">blocked", ">starved",
                ">leaving");
        for (int station : new int[] {1, 3, 4}) {
            String key = "station" + station + ".";
            double[] times = Stream.of("working", "short", "blocked", "starved", "leaving")
                    .mapToDouble(state -> Double.parseDouble(nets.getOrDefault(key + state + "_ms", "0"))).toArray();
            double all = Arrays.stream(times).sum();
            long pallets = Long.parseLong(nets.getOrDefault(key + "pallets", "0"));
            List<Object> row = new ArrayList<>(List.of("station " + station, pallets, pallets == 0 ? "" : seconds((long) (times[0] / pallets * 1e6))));
            Arrays.stream(times).forEach(one -> row.add(all == 0 ? "" : String.format(Locale.ROOT, "%.1f %%", 100 * one / all)));
            table.row(row.toArray());
        }
        text.append(table.text("  "));
        text.append("\n  blocked: done, and the next stop has no room. starved: no pallet. short of parts: a pallet, and no sleeve or part.\n");
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
