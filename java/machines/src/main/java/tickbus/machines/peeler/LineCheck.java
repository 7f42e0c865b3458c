package tickbus.machines.peeler;

import java.util.Locale;
import tickbus.machines.demo.DemoFailure;

/** The conditions at the end of a good run. */
final class LineCheck {
    /** The rounding error permitted in the balance of wood, in cubic metres. */
    private static final double CRUMB = 1e-9;

    private LineCheck() {
    }

    /** All wood accounted for, in cubic metres. */
    static double found(Peeler line) {
        Wood wood = line.wood();
        return wood.veneer() + wood.torn() + wood.chipped() + wood.cores() + wood.unpeeled() + line.held();
    }

    /**
     * Checks a run.
     *
     * @throws DemoFailure with the violated condition
     */
    static void check(LineWatcher watcher, int logs) {
        Peeler line = watcher.line();
        Wood wood = line.wood();
        must(wood.coreCount() >= logs, wood.coreCount() + " blocks were peeled instead of " + logs);
        must(wood.unpeeledCount() == 0, wood.unpeeledCount() + " blocks fell before they were peeled");
        must(wood.ribbon() > 0, "no whole ribbon came");
        double lost = wood.chucked() - found(line);
        must(Math.abs(lost) < CRUMB * Math.max(1, wood.chucked()),
                String.format(Locale.ROOT, "%.3g cubic metres of wood are unaccounted for", lost));
        must(logs < 2 || watcher.peeled().stream().anyMatch(shape -> !shape.equals("cylinder")),
                "every block was a cylinder");
    }

    private static void must(boolean fulfilled, String reason) {
        if (!fulfilled) {
            throw new DemoFailure(reason);
        }
    }
}
