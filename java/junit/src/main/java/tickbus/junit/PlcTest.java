package tickbus.junit;

import java.lang.annotation.Documented;
import java.lang.annotation.ElementType;
import java.lang.annotation.Inherited;
import java.lang.annotation.Retention;
import java.lang.annotation.RetentionPolicy;
import java.lang.annotation.Target;
import org.junit.jupiter.api.Test;
import org.junit.jupiter.api.extension.ExtendWith;

/**
 * A test of a PLC program: gives the test a {@link Plc}, with the program behind it and a machine in front.
 *
 * <pre>{@code
 * @PlcTest(config = "driver.cfg", program = "rig", step = "2ms", machine = Cell.class)
 * class CellTest {
 *     @Test
 *     void startBeginsARun(Plc plc) {
 *         plc.await(on("Ready lamp")).within("25s");
 *         plc.press("Start button");
 *         plc.await(on("Running lamp")).within(40);
 *     }
 * }
 * }</pre>
 *
 * <p>Every test gets a program, a machine and a time of its own; nothing is left over from the test before. Simulation
 * time stands still unless the test lets it pass, and then passes as fast as the processor can compute it. The same
 * test gives the same run, bit for bit.
 *
 * <p>On a class it serves all its tests, those in nested classes, too. On a method it makes that method a test, and what
 * it leaves out is taken from the class. (With {@code @ParameterizedTest} or {@code @RepeatedTest}, put it on the class:
 * on the method it would be a test beside them.) It can be put on an annotation of your own, such as
 * {@code @CellTest}, which then stands for it.
 */
@Documented
@Inherited
@Target({ElementType.TYPE, ElementType.METHOD})
@Retention(RetentionPolicy.RUNTIME)
@ExtendWith(PlcExtension.class)
@Test
public @interface PlcTest {
    /**
     * The plant's own driver.cfg, with its signal table.
     *
     * @return a file, as seen from the working directory or, failing that, from the test class on the class path
     */
    String config() default "";

    /**
     * The PLC program at the other end of the line, whatever bus driver.cfg names.
     *
     * @return its name, or its file; empty takes the one that driver.cfg names itself
     */
    String program() default "";

    /**
     * Options of the program.
     *
     * @return each as {@code key=value}
     */
    String[] options() default {};

    /**
     * The scan interval of the program.
     *
     * @return such as {@code "10ms"}, which it is if empty
     */
    String scan() default "";

    /**
     * The simulation time that passes with each tick.
     *
     * @return such as {@code "2ms"}; {@code "1ms"} if empty
     */
    String step() default "";

    /**
     * The machine that the PLC controls; it needs a constructor without parameters. Test methods can have it as a
     * parameter.
     *
     * @return {@link Machine} itself for none: then the test is the machine
     */
    Class<? extends Machine> machine() default Machine.class;

    /**
     * When the recording of a test is kept. It lies in {@code tickbus/} beside the reports of Maven or Gradle, or where
     * the system property {@code tickbus.reports} says; the failure tells. Nothing is recorded to the file that
     * driver.cfg itself names.
     *
     * @return one; none for that of the class around it, or {@link Recording#ON_FAILURE}
     */
    Recording[] recording() default {};
}
