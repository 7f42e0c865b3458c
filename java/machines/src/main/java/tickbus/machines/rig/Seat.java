package tickbus.machines.rig;

/** Where a lift's path meets a wheel: the slot of that wheel at the lift. */
final class Seat {
    private final Slots slots;
    private final double station;

    Seat(Slots slots, double station) {
        this.slots = slots;
        this.station = station;
    }

    String wheelName() {
        return slots.name();
    }

    boolean wheelTurning() {
        return slots.wheel().turning();
    }

    boolean aligned() {
        return slots.wheel().aligned();
    }

    /** Base of a bottle in the slot. */
    double floor() {
        return slots.floor();
    }

    /** The bottle in the slot, or null. */
    Bottle bottle() {
        return slots.bottleAt(station);
    }

    boolean free() {
        return slots.freeAt(station);
    }

    void hold(Bottle bottle) {
        slots.hold(slots.at(station), bottle);
    }

    Bottle take() {
        return slots.take(slots.at(station));
    }
}
