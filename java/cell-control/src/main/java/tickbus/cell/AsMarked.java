package tickbus.cell;

import java.util.LinkedHashMap;
import java.util.Map;
import tickbus.Tickbus;
import tickbus.petri.control.NetController;
import tickbus.petri.net.Marking;

/**
 * Compares the cell with a marking: sensors that must be on or off while a place is marked, wherever the movement is that
 * belongs to the place. Most movements can begin again; those that could do harm are here.
 */
final class AsMarked {
    /** By net, and by place: signals behind + must be on, those behind - off. */
    private static final Map<String, Map<String, String[]>> SENSORS = new LinkedHashMap<>();

    static {
        station(1, "fetching", "+S1 belt front", "+S1 arm left", "-S1 sleeve held");
        station(1, "closing", "+S1 arm left", "+S1 arm down");
        station(1, "lifting", "+S1 arm left", "+S1 sleeve held");
        station(1, "sleeve ready", "+S1 arm left", "+S1 arm up", "+S1 sleeve held");
        station(1, "reading", "+S1 reader forward");
        station(1, "swinging", "+S1 arm up", "+S1 sleeve held");
        station(1, "lowering", "+S1 arm right", "+S1 sleeve held");
        station(1, "writing", "+S1 arm right", "+S1 arm down", "+S1 sleeve held", "+S1 reader forward");
        station(1, "opening", "+S1 arm right", "+S1 arm down");
        station(1, "raising", "+S1 arm right", "-S1 sleeve held");
        station(1, "going back", "+S1 arm up");
        // At the back end, a part could have been fed and the feeder gone back: nobody sees what lies below the press.
        station(3, "feeding parts", "-S3 parts back");
        station(3, "pressing parts", "+S3 parts forward");
        station(3, "feeding head", "-S3 head back");
        station(3, "pressing head", "+S3 head forward");
        station(4, "feeding cap", "-S4 cap back");
        station(4, "pressing cap", "+S4 cap forward");
        station(4, "lowering", "+S4 arm inside");
        station(4, "sucking", "+S4 arm inside", "+S4 arm down");
        station(4, "lifting", "+S4 arm inside");
        station(4, "writing", "+S4 arm inside", "+S4 arm up", "+S4 vacuum");
        station(4, "swinging", "+S4 arm up", "+S4 vacuum");
        station(4, "putting down", "+S4 arm outside", "+S4 vacuum");
        station(4, "letting go", "+S4 arm outside", "+S4 arm down");
        station(4, "raising", "+S4 arm outside", "-S4 vacuum");
        station(4, "returning", "+S4 arm up", "-S4 vacuum");
        for (int stop = 1; stop <= CellNets.STOPS; stop++) {
            place("transport", "at " + stop, "+Pallet at stop " + stop);
        }
    }

    private AsMarked() {
    }

    private static void station(int number, String place, String... sensors) {
        place("station " + number, place, sensors);
    }

    private static void place(String net, String place, String... sensors) {
        SENSORS.computeIfAbsent(net, key -> new LinkedHashMap<>()).put(place, sensors);
    }

    /** The first sensor that contradicts the marking with which the nets would begin, and the place; empty if there is none. */
    static String contradiction(Tickbus bus, NetController nets) {
        for (Map.Entry<String, Map<String, String[]>> net : SENSORS.entrySet()) {
            Marking marking = nets.coordinator(net.getKey()).marking();
            for (Map.Entry<String, String[]> place : net.getValue().entrySet()) {
                if (marking.get(place.getKey()) == 0) {
                    continue;
                }
                for (String sensor : place.getValue()) {
                    boolean on = bus.signal(sensor.substring(1)).get() != 0;
                    if (on != (sensor.charAt(0) == '+')) {
                        return "'" + sensor.substring(1) + "' is " + (on ? "on" : "off") + " in " + net.getKey() + "'s place "
                            + place.getKey();
                    }
                }
            }
        }
        return "";
    }
}
