package tickbus.petri.run;

/** Permits an enabled transition to fire. Tested at most once in a scan, so it must depend on the inputs alone. */
@FunctionalInterface
public interface Condition {
    /** True if the condition holds for these inputs. */
    boolean test(Inputs inputs);
}
