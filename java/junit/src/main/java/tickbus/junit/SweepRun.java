package tickbus.junit;

import java.lang.reflect.Method;
import org.junit.jupiter.api.extension.BeforeEachCallback;
import org.junit.jupiter.api.extension.ExtensionContext;
import org.junit.jupiter.api.extension.InvocationInterceptor;
import org.junit.jupiter.api.extension.ReflectiveInvocationContext;
import org.opentest4j.AssertionFailedError;
import org.opentest4j.TestAbortedException;
import tickbus.SweepSession;
import tickbus.Tickbus;

/** One run of a sweep: the scenario without a fault, or with one. */
final class SweepRun implements BeforeEachCallback, InvocationInterceptor {
    /** The number of the run without a fault. */
    static final int WITHOUT_FAULT = -1;

    private final Sweep sweep;
    private final int run;
    private Bench bench;
    private Plc plc;
    private Tickbus bus;
    /** The actions of the scenario have ended. */
    private boolean done;

    SweepRun(Sweep sweep, int run) {
        this.sweep = sweep;
        this.run = run;
    }

    /** The run is judged: ends the scenario, wherever it is. */
    private static final class Over extends Error {
        private static final long serialVersionUID = 1L;

        Over() {
            super("the run is judged", null, false, false);
        }
    }

    @Override
    public void beforeEach(ExtensionContext context) {
        bench = PlcExtension.bench(context);
        plc = bench.plc();
        bus = bench.bus();
        sweep.begin(bench, run);
        plc.sweep(this);
    }

    /** True if the expectations of the scenario count. */
    boolean isStrict() {
        return run == WITHOUT_FAULT;
    }

    void before() {
        sweep.session().before(bus);
    }

    /** Looks at an exchange, and gives delayed sensors their true values again; true if the run is over. */
    boolean after() {
        return sweep.session().after(bus);
    }

    /** Ends the scenario: the run is over. */
    static void end() {
        throw new Over();
    }

    @Override
    public void interceptBeforeEachMethod(Invocation<Void> invocation, ReflectiveInvocationContext<Method> method,
        ExtensionContext context) throws Throwable {
        scenario(invocation);
    }

    @Override
    public void interceptTestTemplateMethod(Invocation<Void> invocation, ReflectiveInvocationContext<Method> method,
        ExtensionContext context) throws Throwable {
        scenario(invocation);
        try {
            // What had to hold so far need not hold any more.
            plc.sweep(this);
            boolean over = sweep.session().idle(bus);
            while (!over) {
                plc.tick();
            }
        } catch (Over e) {
            // So ends the run without a fault, and a run with one if it outlives the scenario.
        }
        plc.sweep(null);
        if (isStrict()) {
            sweep.plan();
        } else {
            judge();
        }
    }

    /** Runs a method of the scenario, unless the scenario has ended in an earlier one. */
    private void scenario(Invocation<Void> invocation) throws Throwable {
        if (done) {
            invocation.skip();
            return;
        }
        try {
            invocation.proceed();
        } catch (Over e) {
            done = true;
        } catch (AssertionError e) {
            if (isStrict()) {
                throw new AssertionFailedError("the scenario fails without a fault, so nothing was judged: "
                    + e.getMessage() + "\nlet the scenario pass as a @Test first", e);
            }
            // An expectation of the scenario's own does not count under a fault.
            done = true;
        } catch (TestAbortedException e) {
            // Nor does an assumption.
            if (isStrict()) {
                throw e;
            }
            done = true;
        }
    }

    private void judge() {
        SweepSession.Verdict verdict = sweep.session().verdict(run);
        if (verdict == null) {
            throw new IllegalStateException("the run ended before it was judged");
        }
        if (!verdict.passes() && !sweep.isAccepting()) {
            bench.page().ifPresent(page -> sweep.kept(run, page));
            throw new AssertionFailedError(verdict.what());
        }
    }
}
