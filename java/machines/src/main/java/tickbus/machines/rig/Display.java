package tickbus.machines.rig;

import tickbus.machines.demo.Plc;
import tickbus.machines.demo.Timeline;

/** Shows the demo while it runs. */
interface Display {
    /** Something happened. */
    void event(Timeline.Event event);

    /** A tick is done; called after every tick. */
    void tick(Watcher watcher, Operator operator, Plc plc);

    /** Nothing more will be shown. */
    void end();
}
