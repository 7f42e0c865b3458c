package tickbus.machines.rig.plc;

import java.lang.annotation.ElementType;
import java.lang.annotation.Retention;
import java.lang.annotation.RetentionPolicy;
import java.lang.annotation.Target;
import org.junit.jupiter.api.Tag;
import tickbus.junit.PlcTest;

/** A test of the rig's PLC program on the simulated rig, with the signal table of the plant's own driver.cfg. */
@Target(ElementType.TYPE)
@Retention(RetentionPolicy.RUNTIME)
@Tag("native")
@PlcTest(config = "../../driver.cfg", program = "rig", step = "2ms", machine = SimulatedRig.class)
@interface RigTest {
}
