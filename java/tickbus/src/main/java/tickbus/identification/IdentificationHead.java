package tickbus.identification;

import java.util.ArrayList;
import java.util.Comparator;
import java.util.List;
import java.util.Map;
import java.util.regex.Matcher;
import java.util.regex.Pattern;
import tickbus.Signal;
import tickbus.Tickbus;

/**
 * A head of a reader of code carriers, as a controller sees it over the bus {@code ivi-client}.
 *
 * <p>{@link #read} or {@link #write} begins a command. It goes out with the next exchange, and is over when {@link #isDone}
 * returns true after one of the following exchanges. Then {@link #status} and {@link #data} return its result.
 *
 * <pre>{@code
 * head.readPallet();
 * do {
 *     bus.exchange();
 * } while (!head.isDone());
 * PalletRecord pallet = head.pallet();
 * }</pre>
 *
 * <p>The head finds its signals by their addresses: {@code %QB0} is the command, {@code %QB1} a length, {@code %QW2} an
 * address, and the data begin at {@code %QB4}; {@code %IB0} is the command's echo, {@code %IB1} the status, {@code
 * %IX2.0} is on while a carrier is there, {@code %IB3} is a length, and the data begin at {@code %IB4}. Signals for data can
 * have any unsigned type; {@code %IL4}, {@code %IL12} and {@code %IL20} are enough for a pallet. Their {@code order} must be
 * the default: with {@code order = "DCBA"} the sequence of the octets differs from the carrier's. Like all signals the head
 * belongs to the ticking thread.
 *
 * <p>While the line is down, the fail-safe values are read, so the result of the last command is unknown, even if the
 * command was done before. The result is known again when the line is back. A command begun meanwhile goes out then, unless
 * {@link #cancel} takes it back.
 */
public final class IdentificationHead {
    /** The command was executed. */
    public static final int DONE = 0x00;
    /** No carrier is before the head. */
    public static final int NO_CARRIER = 0x03;
    /** The command was executed, and the carrier's battery is low. */
    public static final int BATTERY_LOW = 0x10;
    /** The reader did not answer, and may have executed the command. */
    public static final int NO_ANSWER = 0xFF;
    /** {@link #cancel} took the command back before it went out. */
    public static final int CANCELLED = -1;

    private static final int TOGGLE = 0x80;
    private static final int TAKE_BACK = 'q';
    private static final int BEFORE_DATA = 4;
    private static final Pattern ADDRESS = Pattern.compile("%([IQ])([BWDL])(\\d+)");
    private static final List<String> UNSIGNED =
        List.of("BYTE", "USINT", "WORD", "UINT", "DWORD", "UDINT", "LWORD", "ULINT");

    private final Tickbus bus;
    private final String shown;
    private final Signal command;
    private final Signal length;
    private final Signal address;
    private final Signal echo;
    private final Signal status;
    private final Signal present;
    private final Signal received;
    private final List<Part> sentData;
    private final List<Part> receivedData;

    /** A signal that holds some octets of the data, the first one in its highest byte. */
    private record Part(Signal signal, int at, int octets) {
    }

    /**
     * The head of a driver without {@code [[station]]} tables.
     *
     * @param bus an open driver whose bus is an {@code ivi-client}
     * @throws IllegalArgumentException if a signal is not there, with its address
     */
    public IdentificationHead(Tickbus bus) {
        this(bus, "");
    }

    /**
     * The head that is a station of a driver.
     *
     * @param bus an open driver whose bus is an {@code ivi-client}
     * @param station the station's name
     * @throws IllegalArgumentException if a signal is not there, with its address
     */
    public IdentificationHead(Tickbus bus, String station) {
        this.bus = bus;
        this.shown = station.isEmpty() ? bus.toString() : "station \"" + station + "\" of " + bus;
        List<Signal> own = bus.signals().stream().filter(signal -> signal.station().equals(station)).toList();
        this.command = require(own, "%QB0");
        this.length = require(own, "%QB1");
        this.address = require(own, "%QW2");
        this.echo = require(own, "%IB0");
        this.status = require(own, "%IB1");
        this.present = require(own, "%IX2.0");
        this.received = require(own, "%IB3");
        this.sentData = data(own, "Q");
        this.receivedData = data(own, "I");
    }

    private Signal require(List<Signal> own, String place) {
        return own.stream().filter(signal -> signal.address().equals(place)).findAny().orElseThrow(
            () -> new IllegalArgumentException("the head needs a signal at " + place + " in " + shown
                + "; write a [[signal]] with address = \"" + place + "\""));
    }

    /** The signals for data in this area, in the order of their addresses, up to the first gap. */
    private List<Part> data(List<Signal> own, String area) {
        List<Part> all = new ArrayList<>();
        for (Signal signal : own) {
            Matcher place = ADDRESS.matcher(signal.address());
            if (place.matches() && place.group(1).equals(area) && Integer.parseInt(place.group(3)) >= BEFORE_DATA) {
                if (!UNSIGNED.contains(signal.type())) {
                    throw new IllegalArgumentException("signal '" + signal.name() + "' at " + signal.address() + " in "
                        + shown + " is a " + signal.type() + "; octets need one of " + String.join(", ", UNSIGNED));
                }
                int octets = 1 << "BWDL".indexOf(place.group(2));
                all.add(new Part(signal, Integer.parseInt(place.group(3)) - BEFORE_DATA, octets));
            }
        }
        all.sort(Comparator.comparingInt(Part::at));
        int end = 0;
        List<Part> whole = new ArrayList<>();
        for (Part part : all) {
            if (part.at != end) {
                break;
            }
            whole.add(part);
            end += part.octets;
        }
        return List.copyOf(whole);
    }

    private static int room(List<Part> data) {
        return data.stream().mapToInt(Part::octets).sum();
    }

    /**
     * Begins to read octets.
     *
     * @param from the address of the first one
     * @param count how many
     * @throws IllegalStateException if another command is not {@link #isDone done}
     * @throws IllegalArgumentException if there are not enough signals for them
     */
    public void read(int from, int count) {
        mustFit(count, receivedData, "%IB");
        begin('w', from, count);
    }

    /**
     * Begins to write octets.
     *
     * @param to the address of the first one
     * @param octets to be written
     * @throws IllegalStateException if another command is not {@link #isDone done}
     * @throws IllegalArgumentException if there are not enough signals for them
     */
    public void write(int to, byte[] octets) {
        mustFit(octets.length, sentData, "%QB");
        mustBeDone();
        for (Part part : sentData) {
            long value = 0;
            for (int at = part.at; at < part.at + part.octets; at++) {
                value = value << 8 | (at < octets.length ? octets[at] & 0xFF : 0);
            }
            part.signal.setLong(value);
        }
        begin('k', to, octets.length);
    }

    /**
     * Begins to read the {@link PalletRecord} at address 0.
     *
     * @throws IllegalStateException if another command is not {@link #isDone done}
     */
    public void readPallet() {
        read(0, PalletRecord.LENGTH);
    }

    /**
     * Begins to write a record to address 0.
     *
     * @param pallet the record
     * @throws IllegalStateException if another command is not {@link #isDone done}
     */
    public void writePallet(PalletRecord pallet) {
        write(0, pallet.toOctets());
    }

    private void begin(char character, int at, int count) {
        mustBeDone();
        if (at < 0 || at > 0xFFFF) {
            throw new IllegalArgumentException(
                at + " is no address on a carrier; write one from 0 to 65535");
        }
        address.setLong(at);
        length.setLong(count);
        command.setLong((command.getLong() ^ TOGGLE) & TOGGLE | character);
    }

    private void mustFit(int count, List<Part> data, String first) {
        if (count < 1 || count > room(data)) {
            throw new IllegalArgumentException(count + " octets do not fit into the data of " + shown
                + ", which has signals for " + room(data) + " from " + first + BEFORE_DATA + " on");
        }
    }

    private void mustBeDone() {
        if (!isDone()) {
            Map<String, String> now = bus.statistics();
            String line = now.get("state").equals("running") ? ""
                : "; the line is " + now.get("state") + ": " + now.get("reason");
            throw new IllegalStateException("the head in " + shown
                + " has not answered the command before; wait for isDone(), or cancel() the command" + line);
        }
    }

    /**
     * Takes the last command back, unless it has gone out already; does nothing if it is {@link #isDone done}.
     *
     * <p>When the line is up and {@link #isDone} returns true, {@link #status} is {@link #CANCELLED}, or the status of
     * the command if it had gone out already.
     */
    public void cancel() {
        if (!isDone()) {
            command.setLong(command.getLong() & TOGGLE | TAKE_BACK);
        }
    }

    /**
     * Returns whether the last command has been answered or taken back, or no command was given.
     *
     * @return false while the command is on its way, and while the line is not up
     */
    public boolean isDone() {
        long given = command.getLong();
        long found = echo.getLong();
        // The echo of the take-back itself has the same toggle bit if the command was not taken back in time. A fail-safe 0
        // is no echo.
        boolean wasSent = (given & ~TOGGLE) == TAKE_BACK && found != 0 && ((found ^ given) & TOGGLE) == 0;
        return found == given || wasSent;
    }

    /**
     * Returns whether a carrier is before the head.
     *
     * @return false also while the line is not up
     */
    public boolean isPresent() {
        return present.getBoolean();
    }

    /**
     * The result of the last command, as numbered in the reader's manual.
     *
     * @return {@link #DONE}, {@link #BATTERY_LOW}, or an error such as {@link #NO_CARRIER}; {@link #CANCELLED} for a command
     * that was taken back
     * @throws IllegalStateException if it is not {@link #isDone done}
     */
    public int status() {
        mustBeDone();
        return (echo.getLong() & ~TOGGLE) == TAKE_BACK ? CANCELLED : (int) status.getLong();
    }

    /**
     * The octets read last.
     *
     * @return the data of the last answer; none after a command that writes
     * @throws IllegalStateException if it is not {@link #isDone done}, or failed
     */
    public byte[] data() {
        int found = status();
        if (found == CANCELLED) {
            throw new IllegalStateException("the command was taken back in " + shown + ", and has read nothing");
        }
        if (found != DONE && found != BATTERY_LOW) {
            throw new IllegalStateException(
                String.format("the command has failed with status %02X in %s; see status()", found, shown));
        }
        byte[] octets = new byte[(int) received.getLong()];
        for (Part part : receivedData) {
            long value = part.signal.getLong();
            for (int at = Math.min(part.at + part.octets, octets.length) - 1; at >= part.at; at--) {
                octets[at] = (byte) (value >>> 8 * (part.at + part.octets - 1 - at));
            }
        }
        return octets;
    }

    /**
     * The record read by {@link #readPallet}.
     *
     * @return the pallet's record
     * @throws IllegalStateException if the command is not {@link #isDone done}, or failed
     * @throws IllegalArgumentException if the carrier holds no record
     */
    public PalletRecord pallet() {
        return PalletRecord.ofOctets(data());
    }
}
