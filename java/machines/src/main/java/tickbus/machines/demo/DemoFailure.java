package tickbus.machines.demo;

/** Something that must not happen in a demo; the message is the reason. */
public final class DemoFailure extends RuntimeException {
    private static final long serialVersionUID = 1L;

    /**
     * A failure.
     *
     * @param reason the event, for people
     */
    public DemoFailure(String reason) {
        super(reason);
    }
}
