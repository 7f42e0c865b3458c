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
 * <p>Every test has its own program, machine and time; nothing is left over from the previous test. Simulation time
 * stands still unless the test lets it pass, and then passes as fast as it can be computed. The same test always
 * gives the same run, bit for bit.
 *
 * <p>On a class the annotation applies to all its tests, including those in nested classes. On a method it makes that method
 * a test; omitted elements come from the class. (With {@code @ParameterizedTest} or {@code @RepeatedTest}, put it on the
 * class: on the method it would be an additional test.) It can be a meta-annotation, such as on your own annotation {@code
 * @CellTest}.
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
     * @return a file, relative to the working directory or, failing that, to the test class on the class path
     */
    String config() default "";

    /**
     * The PLC program at the other end of the line, whatever the bus in driver.cfg.
     *
     * @return the program's name or file; empty for the one named in driver.cfg
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
     * @return such as {@code "10ms"}, the default
     */
    String scan() default "";

    /**
     * The simulation time of each tick.
     *
     * @return such as {@code "2ms"}; {@code "1ms"} if empty
     */
    String step() default "";

    /**
     * The machine that the PLC controls; needs a constructor without parameters. Test methods can have it as a parameter.
     *
     * @return {@link Machine} itself for no machine: the test then plays the machine
     */
    Class<? extends Machine> machine() default Machine.class;

    /**
     * When the recording of a test is kept. The folder is {@code tickbus/} beside the reports of Maven or Gradle, or the one
     * in the system property {@code tickbus.reports}; failures name the file. The file named in driver.cfg is never written.
     *
     * @return at most one; if empty, as for the enclosing class, or {@link Recording#ON_FAILURE}
     */
    Recording[] recording() default {};
}
