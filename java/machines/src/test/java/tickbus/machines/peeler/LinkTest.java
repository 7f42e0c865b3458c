package tickbus.machines.peeler;

import static org.junit.jupiter.api.Assertions.assertEquals;
import static org.junit.jupiter.api.Assertions.assertTrue;

import controlinterface.ControlInterfaceDeviceDriver;
import java.io.DataInputStream;
import java.io.IOException;
import java.net.InetAddress;
import java.net.Socket;
import java.nio.ByteBuffer;
import java.nio.file.Path;
import org.junit.jupiter.api.Tag;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.Timeout;
import org.junit.jupiter.api.io.TempDir;
import tickbus.machines.demo.DriverFolder;
import tickbus.machines.demo.Eventually;
import tickbus.simulator.DeviceDriverFolder;
import tickbus.simulator.Simulator;
import tickbus.simulator.TickMode;
import tickbus.simulator.TimeSource;

/**
 * The line behind its two links, byte by byte as in 2018: a plain socket client sends 360 bytes, 30 of them
 * commanding one axis, and gets 134.
 */
@Tag("native")
@Timeout(60)
class LinkTest {
    private static final int COMMAND = 30;
    private static final int FEEDBACK = 10;
    private static final int LINEAR_FEEDER = 1;
    private static final byte ENABLE_AND_EXECUTE = 0x11;
    private static final byte ENABLE = 0x10;

    @TempDir
    Path folder;

    private Simulator open() throws IOException {
        DriverFolder.ofPeelingLine(folder);
        return new Simulator(DeviceDriverFolder.scan(folder).open(), new Peeler(), Path.of("peeler.table"), 2_000_000,
                TimeSource.system());
    }

    private static Socket connect(ControlInterfaceDeviceDriver driver) throws IOException {
        String address = Eventually.get("an address", () -> driver.statistics().get("address"));
        return new Socket(InetAddress.getLoopbackAddress(),
                Integer.parseInt(address.substring(address.lastIndexOf(':') + 1)));
    }

    /** Sends and receives until the linear feeder is in the expected state. */
    private static ByteBuffer talk(Socket plc, byte bits, boolean inPosition, int sizeIn) throws IOException {
        ByteBuffer out = ByteBuffer.allocate(360);
        out.put(LINEAR_FEEDER * COMMAND, bits);
        // Hundredths of a millimetre, as the driver.cfg says.
        out.putFloat(LINEAR_FEEDER * COMMAND + 2, 2_300);
        out.putFloat(LINEAR_FEEDER * COMMAND + 6, 80_000);
        out.putFloat(LINEAR_FEEDER * COMMAND + 10, 300_000);
        out.putFloat(LINEAR_FEEDER * COMMAND + 14, 300_000);
        DataInputStream in = new DataInputStream(plc.getInputStream());
        byte[] record = new byte[sizeIn];
        while (true) {
            plc.getOutputStream().write(out.array());
            in.readFully(record);
            ByteBuffer answer = ByteBuffer.wrap(record);
            if ((answer.get(LINEAR_FEEDER * FEEDBACK) & 2) != 0 == inPosition) {
                return answer;
            }
        }
    }

    @Test
    void aBareClientMovesAnAxisOverTheLink() throws Exception {
        try (Simulator simulator = open()) {
            Thread ticks = new Thread(() -> simulator.run(TickMode.REAL_TIME, () -> true), "simulation");
            ticks.start();
            try (Socket plc = connect(simulator.drivers().get(0))) {
                plc.setTcpNoDelay(true);
                talk(plc, ENABLE, false, 134);
                ByteBuffer answer = talk(plc, ENABLE_AND_EXECUTE, true, 134);
                assertEquals(2_300, answer.getFloat(LINEAR_FEEDER * FEEDBACK + 2), 1);
                assertEquals(0, answer.getFloat(LINEAR_FEEDER * FEEDBACK + 6));
                assertEquals(1, answer.get(0) & 1, "the step feeder is healthy");
                assertEquals(0b1000_1111, answer.get(120) & 0xff, "blocks on all steps and at the gate");
                assertEquals(800, answer.getFloat(122));
                assertTrue(answer.getFloat(130) > 1, "it took more than a second of simulation time");
            } finally {
                simulator.stop();
                ticks.join();
            }
        }
    }
}
