package tickbus.petri;

/** Whether an enabled transition may fire. Tested at most once in a scan, so it must depend on the inputs alone. */
@FunctionalInterface
public interface Condition {
    /** Whether it holds for these inputs. */
    boolean test(Inputs inputs);
}
