package tickbus.cell;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import java.io.IOException;
import java.io.UncheckedIOException;
import java.nio.file.Path;
import java.time.LocalDateTime;
import java.util.ArrayList;
import java.util.List;
import java.util.Map;
import java.util.TreeMap;
import java.util.concurrent.atomic.AtomicInteger;
import java.util.function.BooleanSupplier;
import org.junit.jupiter.api.AfterEach;
import org.junit.jupiter.api.BeforeEach;
import tickbus.Signal;
import tickbus.Tickbus;
import tickbus.machines.cell.Colour;
import tickbus.machines.cell.ManufacturingCell;
import tickbus.petri.control.BoundNet;
import tickbus.petri.control.NetController;

/** The nets and the cell, over a bus in simulation time; a test opens it, and closes it at its end. */
abstract class CellLoop {
    private static final AtomicInteger LINKS = new AtomicInteger();
    static final long STEP = 5_000_000;
    static final int PARTS = 20;

    ManufacturingCell cell;
    Tickbus machine;
    Tickbus plc;
    private Tickbus readerEnd;
    private Tickbus headsEnd;
    LoopReader reader;
    Heads heads;
    private int link;
    CellProgram program;
    NetController nets;
    /** Where the control keeps its markings; null to keep none. */
    Path file;
    List<Signal> written;
    private List<Signal> read;
    private int[] writes;
    private int[] reads;
    final Map<String, Integer> fired = new TreeMap<>();
    long nanos;
    /** An input of the nets that is stuck, and its value. */
    Signal stuck;
    double stuckAt;

    private Tickbus link(String cfg, String role) {
        return Tickbus.open(Path.of(System.getProperty("tickbus.root"), "plc/cell", cfg),
            "[fieldbus]\nkind = \"loopback\"\nmode = \"stepped\"\nlink = \"" + cfg + " " + link + "\"\nrole = \"" + role
            + "\"\n");
    }

    @BeforeEach
    void open() {
        cell = new ManufacturingCell();
        fired.clear();
        nanos = 0;
        stuck = null;
        link = LINKS.incrementAndGet();
        machine = link("cell.cfg", "device");
        readerEnd = link("identification.cfg", "device");
        reader = new LoopReader(readerEnd, cell);
        openControl();
        fill();
    }

    /** Opens the control's ends, and its nets. */
    void openControl() {
        plc = link("cell.cfg", "controller");
        headsEnd = link("identification.cfg", "controller");
        heads = Heads.on(headsEnd, () -> LocalDateTime.of(2004, 3, 9, 16, 5, 59));
        BoundNet[] all = CellNets.all(heads);
        for (BoundNet one : all) {
            one.listener((scan, at, transition, choices) ->
                fired.merge(one.net().name() + "." + one.net().transition(transition).name(), 1, Integer::sum));
        }
        try {
            program = new CellProgram(plc, heads, all, HomingNets.all(heads), file, 1);
        } catch (IOException e) {
            throw new UncheckedIOException(e);
        }
        nets = program.nets();
    }

    private void fill() {
        written = machine.signals().stream().filter(Signal::isWritten).toList();
        read = machine.signals().stream().filter(signal -> !signal.isWritten()).toList();
        writes = written.stream().mapToInt(signal -> cell.outputs().indexOf(signal.name())).toArray();
        reads = read.stream().mapToInt(signal -> cell.inputs().indexOf(signal.name())).toArray();
        cell.fillSleeves(List.of(Colour.BLACK, Colour.RED, Colour.METALLIC, Colour.RED, Colour.RED, Colour.BLACK,
            Colour.METALLIC, Colour.METALLIC, Colour.BLACK, Colour.BLACK, Colour.RED, Colour.METALLIC));
        cell.fillParts(PARTS);
        cell.fillHeads(20);
        cell.fillCaps(20);
        cell.start(true);
    }

    @AfterEach
    void close() {
        closeControl();
        readerEnd.close();
        machine.close();
    }

    void closeControl() {
        headsEnd.close();
        plc.close();
    }

    void tick() {
        machine.receive(nanos);
        for (int i = 0; i < reads.length; i++) {
            cell.input(reads[i], read.get(i).get());
        }
        move();
        heads.exchange(nanos);
        program.scan(nanos);
        nanos += STEP;
    }

    /** The cell's step with the outputs that it has, and what its sensors see. */
    void move() {
        cell.step(STEP);
        for (int i = 0; i < writes.length; i++) {
            Signal one = written.get(i);
            one.set(one == stuck ? stuckAt : cell.output(writes[i]));
        }
        machine.send();
        reader.tick(nanos);
    }

    void until(String what, BooleanSupplier so) {
        long limit = nanos + 60_000_000_000L;
        while (!so.getAsBoolean()) {
            assertTrue(nanos < limit, () -> "not " + what + " within a minute: " + state());
            tick();
        }
    }

    String state() {
        List<String> markings = new ArrayList<>();
        for (String net : List.of("station 1", "station 3", "station 4", "transport", "cell")) {
            markings.add(net + " " + nets.coordinator(net).marking());
        }
        for (String net : List.of(HomingNets.station(1), HomingNets.station(3), HomingNets.station(4), HomingNets.TRANSPORT)) {
            markings.add(net + " " + program.homing().coordinator(net).marking());
        }
        return markings + ", homing because: " + program.why() + ", delivered " + cell.delivered().size() + ", " + program.stops();
    }

    void delivers(int count) {
        until(count + " cylinders", () -> cell.delivered().size() >= count);
        assertEquals(List.of(), nets.stops());
    }

    int times(String transition) {
        return fired.getOrDefault(transition, 0);
    }
}
