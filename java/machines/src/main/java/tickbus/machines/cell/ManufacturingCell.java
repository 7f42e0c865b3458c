package tickbus.machines.cell;

import java.util.ArrayList;
import java.util.List;
import java.util.function.BooleanSupplier;
import java.util.function.DoubleConsumer;
import java.util.function.DoubleSupplier;
import java.util.function.IntSupplier;
import tickbus.simulator.Machine;
import tickbus.simulator.ModelFault;
import tickbus.simulator.ModelFaults;
import tickbus.simulator.ModelVariable;

/**
 * The whole cell as a machine. Its variables have the names of the signals in plc/cell/cell.cfg and plc/cell/reader.cfg. The
 * names of station 1 are those of the cell at Zaragoza, in English.
 *
 * <p>The operator works the switches of the panel, fills the magazines and provokes mishaps: by methods, not variables.
 */
public final class ManufacturingCell implements Machine {
    private static final double ON = 0.5;
    /** The time from the button Rearm until air and motors are back; the control's outputs are back earlier. */
    private static final long CONTACTOR_NANOS = 50_000_000;

    /** The most that wear can take of a cylinder's speed. */
    private static final double MOST_WEAR = 0.9;

    /** Takes a Boolean variable. */
    private interface Switch {
        void set(boolean on);
    }

    private final Counters counters = new Counters();
    private final ModelFaults modelFaults = new ModelFaults();
    private final List<ModelVariable> variables = new ArrayList<>();
    private final StationOne one = new StationOne(counters);
    private final StationThree three = new StationThree(counters);
    private final StationFour four = new StationFour(counters);
    private final Transport transport = new Transport();
    private final List<String> inputs = new ArrayList<>();
    private final List<String> outputs = new ArrayList<>();
    private final List<DoubleConsumer> sinks = new ArrayList<>();
    private final List<DoubleSupplier> sources = new ArrayList<>();
    private boolean start;
    private boolean automatic = true;
    private boolean integrated = true;
    private boolean rearm;
    private boolean emergency;
    /** How long air and motors have been requested since the emergency stop; the contactor's time if they were never cut. */
    private long contactorNanos = CONTACTOR_NANOS;
    private boolean partsLamp;
    private boolean capsLamp;
    private boolean runningLamp;
    private boolean rearmLamp;
    /** The number of the last marking whose outputs arrived; kept while there is no control, whose number is 0 then. */
    private double markingNumber;

    /** A cell with three pallets and empty magazines. */
    public ManufacturingCell() {
        stationOne();
        stationThree();
        stationFour();
        for (int stop = 1; stop <= Transport.STOPS; stop++) {
            int number = stop;
            out("Pallet at stop " + stop, () -> transport.at(number) != null);
            in("Open stop " + stop, on -> transport.open[number - 1] = on);
        }
        in("Belt", on -> transport.forward = on);
        in("Belt back", on -> transport.backward = on);
        in("Running lamp", on -> runningLamp = on);
        in("Rearm lamp", on -> rearmLamp = on);
        inputs.add("Marking number");
        sinks.add(value -> markingNumber = value > 0 ? value : markingNumber);
        outputs.add("Marking held");
        sources.add(() -> markingNumber);
        declareFaults();
        declareCounts();
        head(1, one.head);
        head(3, three.head);
        head(4, four.head);
    }

    private void stationOne() {
        out("S1 belt back", one::isAtBack);
        out("S1 belt front", one::isAtFront);
        out("S1 arm left", one.arm::isBack);
        out("S1 arm right", one.arm::isForward);
        out("S1 arm up", one.lift::isBack);
        out("S1 arm down", one.lift::isForward);
        out("S1 loader forward", one.loader::isForward);
        out("S1 loader back", one.loader::isBack);
        out("S1 emergency", () -> emergency);
        out("S1 start", () -> start);
        out("S1 automatic", () -> automatic);
        out("S1 integrated", () -> integrated);
        out("S1 rearm", () -> rearm);
        out("S1 inductive", () -> one.sees(Colour.METALLIC));
        out("S1 optical", () -> one.sees(Colour.RED));
        out("S1 capacitive", () -> one.sees(Colour.BLACK));
        out("S1 reader forward", one.reader::isForward);
        out("S1 reader back", one.reader::isBack);
        out("S1 reader optical", one::seesPallet);
        out("S1 sleeve held", one::isHolding);
        in("S1 belt advance", on -> one.beltForward = on);
        in("S1 belt return", on -> one.beltBackward = on);
        in("S1 arm out", on -> one.armOut = on);
        in("S1 arm in", on -> one.armIn = on);
        in("S1 arm lower", on -> one.armLower = on);
        in("S1 loader", on -> one.loaderValve = on);
        in("S1 gripper", on -> one.gripper = on);
        in("S1 reader", on -> one.readerValve = on);
    }

    private void stationThree() {
        out("S3 parts forward", three.parts.cylinder::isForward);
        out("S3 parts back", three.parts.cylinder::isBack);
        out("S3 head forward", three.heads.cylinder::isForward);
        out("S3 head back", three.heads.cylinder::isBack);
        out("S3 press down", three.press::isForward);
        out("S3 press up", three.press::isBack);
        out("S3 parts there", () -> three.parts.stock() > 0);
        out("S3 heads there", () -> three.heads.stock() > 0);
        out("S3 piston in", () -> three.piston);
        out("S3 head on", () -> three.closed);
        in("S3 parts feeder", on -> three.parts.valve = on);
        in("S3 head feeder", on -> three.heads.valve = on);
        in("S3 press", on -> three.pressValve = on);
        in("S3 empty lamp", on -> partsLamp = on);
    }

    private void stationFour() {
        out("S4 cap forward", four.caps.cylinder::isForward);
        out("S4 cap back", four.caps.cylinder::isBack);
        out("S4 press down", four.press::isForward);
        out("S4 press up", four.press::isBack);
        out("S4 caps there", () -> four.caps.stock() > 0);
        out("S4 arm inside", four.arm::isBack);
        out("S4 arm outside", four.arm::isForward);
        out("S4 arm up", four.lift::isBack);
        out("S4 arm down", four.lift::isForward);
        out("S4 vacuum", four::hasVacuum);
        out("S4 exit", four::seesExit);
        out("S4 cap on", () -> four.capped);
        in("S4 cap feeder", on -> four.caps.valve = on);
        in("S4 press", on -> four.pressValve = on);
        in("S4 arm out", on -> four.armOut = on);
        in("S4 arm in", on -> four.armIn = on);
        in("S4 arm lower", on -> four.armLower = on);
        in("S4 vacuum valve", on -> four.vacuumValve = on);
        in("S4 empty lamp", on -> capsLamp = on);
    }

    private void declareFaults() {
        once("jam of the loader", "its next stroke stops half-way", one.loader::jam, one.loader::jamsNoMore);
        once("jam of a pallet", "the next pallet that passes the middle between two stops sticks", transport::jam,
                transport::jamsNoMore);
        once("carrier missed", "head 1 misses the carrier the next time that it comes forward", one::missCarrier,
                one::missesNoCarrier);
        once("vacuum lost", "the next piece that station 4 lifts falls", four::loseVacuum, four::keepsVacuum);
        worn("S1 loader", one.loader);
        worn("S1 arm", one.arm);
        worn("S1 lift", one.lift);
        worn("S1 reader", one.reader);
        worn("S1 gripper", one.fingers);
        worn("S3 parts feeder", three.parts.cylinder);
        worn("S3 head feeder", three.heads.cylinder);
        worn("S3 press", three.press);
        worn("S4 cap feeder", four.caps.cylinder);
        worn("S4 press", four.press);
        worn("S4 arm", four.arm);
        worn("S4 lift", four.lift);
    }

    private void once(String name, String effect, Runnable begin, Runnable end) {
        modelFaults.add(name, effect, on -> (on ? begin : end).run());
    }

    private void declareCounts() {
        count("sleeves in the magazine", one::sleeves);
        count("parts in the magazine", three.parts::stock);
        count("heads in the magazine", three.heads::stock);
        count("caps in the magazine", four.caps::stock);
        count("pieces begun", counters::begun);
        count("pieces delivered", four.delivered()::size);
        count("pieces fallen", counters::fallen);
        count("parts wasted", counters::wasted);
        count("collisions", counters::collisions);
        count("vacuum losses", counters::vacuumLosses);
        count("carriers missed", counters::carriersMissed);
    }

    private void count(String name, IntSupplier value) {
        variables.add(new ModelVariable(name, "", value::getAsInt));
    }

    private void worn(String name, PneumaticCylinder cylinder) {
        modelFaults.add("wear of " + name, MOST_WEAR, "", "the cylinder has this part less of its speed", cylinder::wear);
        variables.add(new ModelVariable(name + " stroke", "%", cylinder::percent));
    }

    private void head(int number, ReadWriteHead head) {
        String name = "Head " + number;
        out(name + " carrier", head::showsCarrier);
        in(name + " taken", on -> head.taken = on);
        for (int i = 0; i < CodeCarrier.WORDS; i++) {
            int word = i;
            outputs.add(name + " brings " + 4 * i);
            sources.add(() -> head.brings(word));
            inputs.add(name + " holds " + 4 * i);
            sinks.add(value -> head.holds[word] = (long) value);
        }
    }

    private void in(String name, Switch sink) {
        inputs.add(name);
        sinks.add(value -> sink.set(value >= ON));
    }

    private void out(String name, BooleanSupplier source) {
        outputs.add(name);
        sources.add(() -> source.getAsBoolean() ? 1 : 0);
    }

    @Override
    public String name() {
        return "manufacturing cell";
    }

    @Override
    public List<String> inputs() {
        return List.copyOf(inputs);
    }

    @Override
    public List<String> outputs() {
        return List.copyOf(outputs);
    }

    @Override
    public List<ModelVariable> variables() {
        return List.copyOf(variables);
    }

    @Override
    public List<ModelFault> modelFaults() {
        return modelFaults.list();
    }

    @Override
    public void fault(String name, double value) {
        modelFaults.set(name, value);
    }

    @Override
    public void input(int index, double value) {
        sinks.get(index).accept(value);
    }

    @Override
    public double output(int index) {
        return sources.get(index).getAsDouble();
    }

    @Override
    public void step(long nanos) {
        if (nanos < 0) {
            throw new IllegalArgumentException("a step of " + nanos + " ns; expected 0 or more");
        }
        counters.nanos += nanos;
        if (!hasPower(nanos)) {
            return;
        }
        boolean loaderJam = one.loader.isJammed();
        boolean palletJam = transport.isJammed();
        transport.step(nanos);
        one.step(transport.at(1), nanos);
        three.step(transport.at(3), nanos);
        four.step(transport.at(4), nanos);
        counters.loaderJams += loaderJam && !one.loader.isJammed() ? 1 : 0;
        counters.palletJams += palletJam && !transport.isJammed() ? 1 : 0;
    }

    /**
     * The emergency stop cuts air and motors, whatever the control commands; releasing it brings them back only after Rearm.
     */
    private boolean hasPower(long nanos) {
        if (emergency) {
            contactorNanos = -1;
        } else if (contactorNanos < 0 && rearm) {
            contactorNanos = 0;
        } else if (contactorNanos >= 0 && contactorNanos < CONTACTOR_NANOS) {
            contactorNanos += nanos;
        }
        return contactorNanos >= CONTACTOR_NANOS;
    }

    /** Puts sleeves into the magazine of station 1; they come out in this order. */
    public void fillSleeves(List<Colour> sleeves) {
        sleeves.forEach(one::fill);
    }

    /** Puts sets of piston and spring into the magazine of station 3. */
    public void fillParts(int sets) {
        three.parts.fill(sets);
    }

    /** Puts heads into the magazine of station 3. */
    public void fillHeads(int heads) {
        three.heads.fill(heads);
    }

    /** Puts caps into the magazine of station 4. */
    public void fillCaps(int caps) {
        four.caps.fill(caps);
    }

    /** Sleeves in the magazine of station 1. */
    public int sleeves() {
        return one.sleeves();
    }

    /** Turns the switch on the panel. */
    public void start(boolean on) {
        start = on;
    }

    /** Turns the switch on the panel, which is on at first. */
    public void automatic(boolean on) {
        automatic = on;
    }

    /** Turns the switch on the panel, which is on at first: the stations work together, not each for itself. */
    public void integrated(boolean on) {
        integrated = on;
    }

    /**
     * Presses or releases the button Rearm: after an emergency stop it brings air and motors back; otherwise it informs
     * station 1 that its magazine is filled.
     */
    public void rearm(boolean on) {
        rearm = on;
    }

    /** Presses or releases the emergency stop; after a release the cell waits for {@link #rearm}. */
    public void emergency(boolean on) {
        emergency = on;
    }

    /** Stops the loader's next stroke half-way, until the loader has been back. */
    public void jamLoader() {
        one.loader.jam();
    }

    /** Makes the next pallet that passes the middle between two stops stick, until the belt has run back for 0.1 s. */
    public void jamPallet() {
        transport.jam();
    }

    /** Makes head 1 miss the carrier the next time that it comes forward, until it has been back. */
    public void missCarrier() {
        one.missCarrier();
    }

    /** Makes the next piece that station 4 lifts fall. */
    public void loseVacuum() {
        four.loseVacuum();
    }

    /** True if station 3 shows that a magazine is empty. */
    public boolean showsEmptyParts() {
        return partsLamp;
    }

    /** True if station 4 shows that its magazine is empty. */
    public boolean showsEmptyCaps() {
        return capsLamp;
    }

    /** True if the cell shows that it works. */
    public boolean showsRunning() {
        return runningLamp;
    }

    /** True if the control waits for Rearm before it moves anything. */
    public boolean asksForRearm() {
        return rearmLamp;
    }

    /** True if something is stuck at this moment. */
    public boolean isJammed() {
        return one.loader.isJammed() || transport.isJammed();
    }

    /** The counted events. */
    public Counters counters() {
        return counters;
    }

    /** The pieces that came out, in order. */
    public List<Workpiece> delivered() {
        return List.copyOf(four.delivered());
    }

    /** The transport, with its pallets. */
    public Transport transport() {
        return transport;
    }

    /** The read/write head of a station: 1, 3 or 4. */
    public ReadWriteHead head(int station) {
        return switch (station) {
            case 1 -> one.head;
            case 3 -> three.head;
            case 4 -> four.head;
            default -> throw new IllegalArgumentException("head " + station + "; there are 1, 3 and 4");
        };
    }
}
