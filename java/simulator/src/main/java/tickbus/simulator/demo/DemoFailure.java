package tickbus.simulator.demo;

/** Something that a demo must not show; the message is the reason. */
public final class DemoFailure extends RuntimeException {
    private static final long serialVersionUID = 1L;

    /**
     * A failure.
     *
     * @param reason what it must not show, for people
     */
    public DemoFailure(String reason) {
        super(reason);
    }
}
