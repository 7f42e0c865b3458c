package tickbus.simulator.demo;

/** Something that a demo must not show; the message is the reason. */
final class DemoFailure extends RuntimeException {
    private static final long serialVersionUID = 1L;

    DemoFailure(String reason) {
        super(reason);
    }
}
