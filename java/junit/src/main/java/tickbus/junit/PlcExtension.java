package tickbus.junit;

import org.junit.jupiter.api.extension.AfterEachCallback;
import org.junit.jupiter.api.extension.BeforeEachCallback;
import org.junit.jupiter.api.extension.ExtensionContext;
import org.junit.jupiter.api.extension.ParameterContext;
import org.junit.jupiter.api.extension.ParameterResolutionException;
import org.junit.jupiter.api.extension.ParameterResolver;

/** Passes their {@link Plc} and machine to tests; used through {@link PlcTest}. */
public final class PlcExtension implements BeforeEachCallback, AfterEachCallback, ParameterResolver {
    private static final ExtensionContext.Namespace NAMESPACE = ExtensionContext.Namespace.create(PlcExtension.class);

    /** For JUnit. */
    public PlcExtension() {
    }

    @Override
    public void beforeEach(ExtensionContext context) {
        store(context).put(Bench.class, Bench.open(Setup.of(context), context));
    }

    @Override
    public void afterEach(ExtensionContext context) {
        Bench bench = store(context).remove(Bench.class, Bench.class);
        if (bench != null) {
            bench.close(context);
        }
    }

    @Override
    public boolean supportsParameter(ParameterContext parameter, ExtensionContext context) {
        Class<?> type = parameter.getParameter().getType();
        if (type == Plc.class) {
            return true;
        }
        return Machine.class.isAssignableFrom(type) && type.isAssignableFrom(Setup.of(context).machine());
    }

    @Override
    public Object resolveParameter(ParameterContext parameter, ExtensionContext context) {
        Bench bench = bench(context);
        if (bench == null) {
            throw new ParameterResolutionException("a " + parameter.getParameter().getType().getSimpleName()
                + " lives for one test; take it as a parameter of a test, or of a @BeforeEach or @AfterEach method");
        }
        return parameter.getParameter().getType() == Plc.class ? bench.plc() : bench.machine();
    }

    /** The bench of a test, while the test runs. */
    static Bench bench(ExtensionContext context) {
        return store(context).get(Bench.class, Bench.class);
    }

    private static ExtensionContext.Store store(ExtensionContext context) {
        return context.getStore(NAMESPACE);
    }
}
