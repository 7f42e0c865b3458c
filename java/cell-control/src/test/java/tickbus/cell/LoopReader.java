package tickbus.cell;

import java.nio.ByteBuffer;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.List;
import tickbus.Signal;
import tickbus.Tickbus;
import tickbus.machines.cell.CodeCarrier;
import tickbus.machines.cell.ManufacturingCell;

/**
 * Stands in for the reader between the cell and the nets, in simulation time without a serial port. The nets see an
 * ivi-client, the cell an ivi-reader. A command takes as long as on a line at 9600 baud.
 */
final class LoopReader {
    /** 34 characters of ten bits, as a read or a write of 21 octets has. */
    private static final long COMMAND_NANOS = 35_000_000;
    private static final int TOGGLE = 0x80;

    private final Tickbus bus;
    private final ManufacturingCell cell;
    private final List<Head> heads = new ArrayList<>();
    private long nanos;

    /** The machine's end of the signals of plc/cell/identification.cfg. */
    LoopReader(Tickbus bus, ManufacturingCell cell) {
        this.bus = bus;
        this.cell = cell;
        for (int station : new int[] {1, 3, 4}) {
            heads.add(new Head("Head " + station));
        }
    }

    void tick(long now) {
        nanos = now;
        bus.receive(now);
        heads.forEach(Head::tick);
        bus.send();
    }

    /** Answers the next commands of a station's head with this status; FF means no answer. */
    void fail(int station, int status, int times) {
        Head head = heads.get(List.of(1, 3, 4).indexOf(station));
        head.failure = status;
        head.failures = times;
    }

    /** Answers nothing from now on. */
    void hang() {
        heads.forEach(head -> head.hangs = true);
    }

    /** The program that asks has begun again: its commands count from 0. */
    void restart() {
        bus.receive(nanos);
        for (Head head : heads) {
            head.at("%IB0").setLong(0);
            head.asked = -1;
        }
        bus.send();
    }

    private final class Head {
        private final String name;
        private final byte[] octets = new byte[CodeCarrier.BYTES];
        private boolean has;
        private long asked = -1;
        private int failure;
        private int failures;
        private boolean hangs;

        Head(String name) {
            this.name = name;
        }

        private Signal at(String address) {
            return bus.signals().stream().filter(one -> one.station().equals(name) && one.address().equals(address)).findAny()
                .orElseThrow();
        }

        void tick() {
            boolean shown = cell.output(cell.outputs().indexOf(name + " carrier")) != 0;
            if (shown && !has) {
                ByteBuffer brings = ByteBuffer.wrap(octets);
                for (int i = 0; i < octets.length; i += 4) {
                    brings.putInt((int) (long) cell.output(cell.outputs().indexOf(name + " brings " + i)));
                }
            }
            has = shown;
            int command = (int) at("%QB0").getLong();
            if (command == at("%IB0").getLong() || hangs) {
                asked = -1;
            } else if (asked < 0) {
                asked = nanos;
            } else if (nanos - asked >= COMMAND_NANOS) {
                execute(command & ~TOGGLE, (int) at("%QW2").getLong(), (int) at("%QB1").getLong());
                at("%IB0").setLong(command);
                asked = -1;
            }
            at("%IX2.0").setBoolean(has);
            cell.input(cell.inputs().indexOf(name + " taken"), has ? 1 : 0);
            ByteBuffer holds = ByteBuffer.wrap(octets);
            for (int i = 0; i < octets.length; i += 4) {
                cell.input(cell.inputs().indexOf(name + " holds " + i), Integer.toUnsignedLong(holds.getInt()));
            }
        }

        private void execute(int command, int first, int count) {
            byte[] data = new byte[24];
            at("%IB3").setLong(0);
            if (failures > 0) {
                failures--;
                at("%IB1").setLong(failure);
            } else if (!has) {
                at("%IB1").setLong(3);
            } else {
                at("%IB1").setLong(0);
                if (command == 'k') {
                    ByteBuffer written = ByteBuffer.wrap(data);
                    for (String address : List.of("%QL4", "%QL12", "%QL20")) {
                        written.putLong(at(address).getLong());
                    }
                    System.arraycopy(data, 0, octets, first, count);
                    Arrays.fill(data, (byte) 0);
                } else {
                    System.arraycopy(octets, first, data, 0, count);
                    at("%IB3").setLong(count);
                }
            }
            ByteBuffer read = ByteBuffer.wrap(data);
            for (String address : List.of("%IL4", "%IL12", "%IL20")) {
                at(address).setLong(read.getLong());
            }
        }
    }
}
