package tickbus.machines.cell;

/** A magazine of parts, and a cylinder that pushes one of them below a press. */
final class Feeder {
    final PneumaticCylinder cylinder = new PneumaticCylinder(90_000_000);
    private int stock;
    private boolean pushed;
    boolean valve;

    void fill(int parts) {
        stock += parts;
    }

    int stock() {
        return stock;
    }

    /** Returns whether a part has come below the press in this step. */
    boolean step(long nanos) {
        cylinder.step(valve, nanos);
        boolean comes = cylinder.isForward() && !pushed && stock > 0;
        if (comes) {
            stock--;
        }
        pushed = comes || pushed && !cylinder.isBack();
        return comes;
    }
}
