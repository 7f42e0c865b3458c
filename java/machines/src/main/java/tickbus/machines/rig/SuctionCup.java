package tickbus.machines.rig;

/** A suction cup on a lift: grips a bottle by its base, and holds it while there is vacuum. */
final class SuctionCup {
    private final String name;
    private final Bottle.Place place;
    private boolean vacuum;
    private Bottle held;

    SuctionCup(String name, Bottle.Place place) {
        this.name = name;
        this.place = place;
    }

    String name() {
        return name;
    }

    boolean vacuum() {
        return vacuum;
    }

    void vacuum(boolean on) {
        vacuum = on;
    }

    /** The bottle on the cup, or null. */
    Bottle held() {
        return held;
    }

    boolean canGrip() {
        return vacuum && held == null;
    }

    void grip(Bottle bottle, double height) {
        held = bottle;
        bottle.put(place, 0, height);
    }

    Bottle letGo() {
        Bottle bottle = held;
        held = null;
        return bottle;
    }
}
