package tickbus.demo;

/** Shows the demo while it runs. */
interface Display {
    /** Something happened. */
    void event(Timeline.Event event);

    /** A tick is done; called after every tick. */
    void tick(Watcher watcher, Operator operator, Plc plc);

    /** Nothing more will be shown. */
    void end();
}
