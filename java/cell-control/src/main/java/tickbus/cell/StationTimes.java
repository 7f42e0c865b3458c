package tickbus.cell;

import java.util.List;
import tickbus.petri.control.NetController;
import tickbus.petri.net.PetriNet;
import tickbus.petri.run.Coordinator;

/** How long a station worked, and how long it waited for what, while the cell was running: from the markings of the nets. */
final class StationTimes {
    /** A station's states, in the order in which they are looked for. */
    private static final List<String> STATES = List.of("short", "working", "blocked", "starved", "leaving");
    private static final long MS = 1_000_000;

    private final int station;
    private final Coordinator cell;
    private final Coordinator own;
    private final int running;
    private final int worked;
    /** The places of the cell's net behind each state but the first. */
    private final int[] places;
    /** The places in which the station waits for parts. */
    private final int[] lacking;
    private final long[] nanos = new long[STATES.size()];
    private long last = -1;

    /** The times of station 1, 3 or 4. */
    StationTimes(NetController nets, int station) {
        this.station = station;
        cell = nets.coordinator("cell");
        own = nets.coordinator("station " + station);
        PetriNet net = cell.net();
        running = net.place("running").index();
        worked = net.transition("worked " + station).index();
        places = List.of("working ", "worked ", "empty ", "sending from ").stream()
            .mapToInt(place -> net.place(place + station).index()).toArray();
        List<String> names = switch (station) {
            case 1 -> List.of("pallet empty");
            case 3 -> List.of("no parts", "no heads");
            default -> List.of("no caps");
        };
        lacking = names.stream().mapToInt(place -> own.net().place(place).index()).toArray();
    }

    /** Counts the time since the last call for the current state. */
    void count(long now) {
        if (last >= 0 && cell.tokens(running) > 0) {
            int state = state();
            if (state >= 0) {
                nanos[state] += now - last;
            }
        }
        last = now;
    }

    private int state() {
        for (int place : lacking) {
            if (own.tokens(place) > 0) {
                return 0;
            }
        }
        for (int i = 0; i < places.length; i++) {
            if (cell.tokens(places[i]) > 0) {
                return i + 1;
            }
        }
        return -1;
    }

    /** Lines {@code key=value}: the milliseconds of each state, and how many pallets were worked on. */
    String lines() {
        StringBuilder text = new StringBuilder();
        for (int i = 0; i < nanos.length; i++) {
            text.append("station").append(station).append('.').append(STATES.get(i)).append("_ms=").append(nanos[i] / MS)
                .append('\n');
        }
        return text.append("station").append(station).append(".pallets=").append(cell.firings(worked)).append('\n').toString();
    }
}
