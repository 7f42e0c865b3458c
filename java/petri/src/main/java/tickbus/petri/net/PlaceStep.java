package tickbus.petri.net;

/** A place of a net that is being built. */
public final class PlaceStep extends NetBuilder {
    private final String place;

    PlaceStep(NetBuilder of, String place) {
        super(of);
        this.place = place;
    }

    /** The most tokens that the place may hold, 1 or more. */
    public PlaceStep capacity(int most) {
        if (most < 1) {
            mistakes.add("place " + place + ": capacity " + most + "; expected 1 or more");
        }
        places.computeIfPresent(place, (key, old) -> new Place(old.index(), key, old.initial(), most, old.delay()));
        return this;
    }

    /** How long a token that arrives in the place is unavailable, in nanoseconds, 0 or more. */
    public PlaceStep delay(long nanos) {
        if (nanos < 0) {
            mistakes.add("place " + place + ": delay " + nanos + " ns; expected 0 or more");
        } else {
            places.computeIfPresent(place, (key, old) -> new Place(old.index(), key, old.initial(), old.capacity(), nanos));
        }
        return this;
    }
}
