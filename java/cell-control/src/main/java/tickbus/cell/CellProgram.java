package tickbus.cell;

import java.io.IOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import tickbus.Tickbus;
import tickbus.identification.PalletRecord.Piece;
import tickbus.petri.control.BoundNet;
import tickbus.petri.control.NetController;
import tickbus.petri.net.Marking;
import tickbus.petri.net.NetException;
import tickbus.petri.net.PetriNet;
import tickbus.petri.net.Place;
import tickbus.petri.run.Stop;

/**
 * The cell's nets with their markings in a file, and the homing nets, which run first if the file is missing or does not fit
 * the cell. Each scan is that of the homing nets or of the cell's nets.
 */
final class CellProgram {
    private static final int[] STATIONS = {1, 3, 4};

    private final Tickbus bus;
    private final Heads heads;
    private final BoundNet[] all;
    private final NetController nets;
    private final NetController homing;
    /** The reason why the nets do not begin as saved; empty if they do, null if that is not known yet. */
    private String why;
    /** True if the file's markings are the last ones, so the plan in them is true even if the stations' markings are not. */
    private boolean latest;

    /**
     * Binds the nets.
     *
     * @param bus open, with the signals of plc/cell/cell.cfg
     * @param all the cell's nets: see {@link CellNets#all}
     * @param before the homing nets: see {@link HomingNets#all}
     * @param file where the markings are saved, and found if the file is there; null to save nothing and begin with the initial
     *     marking, without homing
     * @param number of the first markings, if there is no file; another one in each run
     * @throws IOException if the file cannot be read
     */
    CellProgram(Tickbus bus, Heads heads, BoundNet[] all, BoundNet[] before, Path file, int number) throws IOException {
        this.bus = bus;
        this.heads = heads;
        this.all = all;
        nets = CellNets.controller(bus, all);
        homing = CellNets.controller(bus, before);
        if (file == null) {
            why = "";
            return;
        }
        nets.keepMarkings(file).numberMarkings("Marking number", number);
        String trouble = "there is no " + file;
        if (Files.exists(file)) {
            try {
                nets.resume(file);
                trouble = "";
            } catch (NetException e) {
                trouble = e.getMessage();
            }
        }
        String found = trouble;
        nets.beginIf(() -> begins(found));
    }

    private boolean begins(String trouble) {
        double held = bus.signal("Marking held").get();
        // The control can have ended after it saved, and before it sent the outputs.
        latest = trouble.isEmpty() && (held == nets.markingNumber() || held == nets.markingNumber() - 1);
        if (!trouble.isEmpty()) {
            why = trouble;
        } else if (!latest) {
            why = "the markings are number " + nets.markingNumber() + ", and the machine has had number " + (long) held;
        } else {
            why = AsMarked.contradiction(bus, nets);
        }
        return why.isEmpty();
    }

    /** The cell's nets. */
    NetController nets() {
        return nets;
    }

    /** The homing nets. */
    NetController homing() {
        return homing;
    }

    /** True while the homing nets run. */
    boolean isHoming() {
        return nets.isWaiting();
    }

    /** The reason for homing; empty without one, null before the first fresh inputs. */
    String why() {
        return why;
    }

    /** Why nets stopped. */
    List<Stop> stops() {
        List<Stop> stops = new ArrayList<>(homing.stops());
        stops.addAll(nets.stops());
        return stops;
    }

    /** One scan; the time must not go back. */
    void scan(long nanos) {
        if (!isHoming()) {
            nets.scan(nanos);
            return;
        }
        homing.scan(nanos);
        takeOver();
    }

    /** After a scan of the homing nets: lets the cell's nets begin if all markings are found. */
    void takeOver() {
        String[] found = new String[STATIONS.length];
        for (int i = 0; i < STATIONS.length; i++) {
            found[i] = found(homing.coordinator(HomingNets.station(STATIONS[i])).marking());
            if (found[i] == null) {
                return;
            }
        }
        nets.begin(markings(found));
    }

    private static String found(Marking marking) {
        for (Place place : marking.net().places()) {
            if (place.name().startsWith(HomingNets.FOUND) && marking.get(place.index()) > 0) {
                return place.name().substring(HomingNets.FOUND.length());
            }
        }
        return null;
    }

    private List<Marking> markings(String[] found) {
        Marking transport = empty("transport");
        Marking cell = empty("cell");
        mark(transport, "forward");
        mark(cell, "stopped");
        for (int stop = 1; stop <= CellNets.STOPS; stop++) {
            boolean there = bus.signal("Pallet at stop " + stop).get() != 0;
            if (there) {
                mark(transport, "at " + stop);
            } else {
                mark(cell, "room at " + stop);
            }
            int station = Arrays.binarySearch(STATIONS, stop);
            boolean works = station >= 0 && !List.of("supply", "looking", "waiting").contains(found[station]);
            mark(cell, (works ? "working " : "empty ") + stop);
        }
        List<Marking> markings = new ArrayList<>(List.of(transport, cell));
        for (int i = 0; i < STATIONS.length; i++) {
            Marking station = empty("station " + STATIONS[i]);
            mark(station, found[i]);
            if (found[i].equals("supply") || found[i].equals("looking")) {
                mark(station, "waiting");
            }
            markings.add(station);
        }
        Marking plan = latest ? nets.coordinator(Plan.NAME).marking() : net(Plan.NAME).initialMarking();
        if (found[0].equals("swinging")) {
            Plan.decide(plan, heads.one().record().piece());
        } else if (found[0].equals("supply")) {
            Plan.decide(plan, Piece.UNDEFINED);
        }
        markings.add(plan);
        return markings;
    }

    private PetriNet net(String name) {
        return Arrays.stream(all).map(BoundNet::net).filter(one -> one.name().equals(name)).findAny().orElseThrow();
    }

    private Marking empty(String name) {
        PetriNet net = net(name);
        return net.marking(new int[net.places().size()]);
    }

    private static void mark(Marking marking, String place) {
        marking.set(marking.net().place(place).index(), 1);
    }
}
