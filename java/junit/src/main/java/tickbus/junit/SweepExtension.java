package tickbus.junit;

import java.util.stream.Stream;
import org.junit.jupiter.api.extension.ExtensionContext;
import org.junit.jupiter.api.extension.TestTemplateInvocationContext;
import org.junit.jupiter.api.extension.TestTemplateInvocationContextProvider;
import org.junit.platform.commons.support.AnnotationSupport;

/** Makes the runs of a sweep; used through {@link FaultSweep}. */
public final class SweepExtension implements TestTemplateInvocationContextProvider {
    private static final ExtensionContext.Namespace NAMESPACE = ExtensionContext.Namespace.create(SweepExtension.class);

    /** For JUnit. */
    public SweepExtension() {
    }

    @Override
    public boolean supportsTestTemplate(ExtensionContext context) {
        return AnnotationSupport.isAnnotated(context.getTestMethod(), FaultSweep.class);
    }

    @Override
    public Stream<TestTemplateInvocationContext> provideTestTemplateInvocationContexts(ExtensionContext context) {
        Sweep sweep = new Sweep(context);
        // Closed with the context, after the last run.
        context.getStore(NAMESPACE).put(Sweep.class, sweep);
        // JUnit makes each run before it asks for the next one, so that the list comes from the run without a fault.
        return Stream.concat(Stream.of(sweep.withoutFault()), Stream.of(sweep).flatMap(Sweep::runs));
    }
}
