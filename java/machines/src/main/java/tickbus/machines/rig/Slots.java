package tickbus.machines.rig;

/** The pockets or sleeves of a wheel and the bottles in them. */
final class Slots {
    private static final double TURN = 360.0;

    private final String name;
    private final Wheel wheel;
    private final Bottle.Place place;
    private final double floor;
    private final Bottle[] bottles;

    Slots(String name, Wheel wheel, Bottle.Place place, int count, double floor) {
        this.name = name;
        this.wheel = wheel;
        this.place = place;
        this.floor = floor;
        this.bottles = new Bottle[count];
    }

    String name() {
        return name;
    }

    Wheel wheel() {
        return wheel;
    }

    /** Base of a bottle in a slot. */
    double floor() {
        return floor;
    }

    int count() {
        return bottles.length;
    }

    Bottle bottle(int slot) {
        return bottles[slot];
    }

    /** The position of a slot, in degrees from 0 up to 360. */
    double station(int slot) {
        return (wheel.angle() + slot * TURN / bottles.length) % TURN;
    }

    /** The slot at a station; -1 if the wheel is between two. */
    int at(double station) {
        if (!wheel.aligned()) {
            return -1;
        }
        for (int i = 0; i < bottles.length; i++) {
            double off = Math.abs(station(i) - station);
            if (Math.min(off, TURN - off) <= Geometry.ALIGNED) {
                return i;
            }
        }
        return -1;
    }

    /** The bottle at a station, or null. */
    Bottle bottleAt(double station) {
        int slot = at(station);
        return slot < 0 ? null : bottles[slot];
    }

    boolean freeAt(double station) {
        int slot = at(station);
        return slot >= 0 && bottles[slot] == null;
    }

    void hold(int slot, Bottle bottle) {
        bottles[slot] = bottle;
        bottle.put(place, slot, floor);
    }

    Bottle take(int slot) {
        Bottle bottle = bottles[slot];
        bottles[slot] = null;
        return bottle;
    }
}
