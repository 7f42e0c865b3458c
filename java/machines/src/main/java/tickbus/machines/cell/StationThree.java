package tickbus.machines.cell;

/** Station 3: presses piston and spring, then the head, into the sleeve on the pallet at stop 3. */
final class StationThree {
    private final Counters counters;
    final Feeder parts = new Feeder();
    final Feeder heads = new Feeder();
    final PneumaticCylinder press = new PneumaticCylinder(100_000_000);
    final ReadWriteHead head = new ReadWriteHead();
    private boolean partsReady;
    private boolean headReady;
    boolean pressValve;

    StationThree(Counters counters) {
        this.counters = counters;
    }

    void step(Pallet pallet, long nanos) {
        partsReady |= parts.step(nanos);
        headReady |= heads.step(nanos);
        boolean wasDown = press.isForward();
        press.step(pressValve, nanos);
        if (press.isForward() && !wasDown && (partsReady || headReady)) {
            if (pallet == null || pallet.piece == null) {
                counters.wasted++;
            } else if (partsReady) {
                pallet.piece.add(Part.PISTON);
                pallet.piece.add(Part.SPRING);
            } else {
                pallet.piece.add(Part.HEAD);
            }
            partsReady = false;
            headReady = false;
        }
        head.step(pallet == null ? null : pallet.carrier());
    }
}
