package tickbus.machines.board;

import java.util.ArrayDeque;
import java.util.Deque;
import java.util.function.BooleanSupplier;
import java.util.function.LongConsumer;
import tickbus.machines.demo.DemoFailure;
import tickbus.machines.demo.Timeline;

/** Works the switches of the board step by step, and waits for the reactions. */
final class LabOperator {
    private static final int TOGGLES = 5;
    private static final int PULSES = 20;
    private static final long MS = 1_000_000L;
    private static final long SOON = 2_000 * MS;
    private static final long LATE = 10_000 * MS;
    private static final long PULSE = 50 * MS;
    private static final long PAUSE = 150 * MS;
    private static final long SETTLING = 200 * MS;
    private static final long HOLD = 2_000 * MS;

    /** The level, in percent, to which tank 2 falls while TANKS is dead. */
    private static final double FALLEN = 22;

    /**
     * A step of the script.
     *
     * @param expected the reaction, for the message if it does not come
     * @param begin the operator's action
     * @param until true when the reaction has come
     * @param limitNanos the limit for the reaction
     * @param done gets the duration
     */
    private record Step(String expected, Runnable begin, BooleanSupplier until, long limitNanos, LongConsumer done) {
    }

    private final TestingBoard board;
    private final Laboratory lab;
    private final LabFacts facts;
    private final Timeline timeline;
    private final BooleanSupplier joined;
    private final Deque<Step> steps = new ArrayDeque<>();
    private Step step;
    private long begun;
    private long now;
    private boolean holding;

    /**
     * An operator.
     *
     * @param joined true if the dispatcher has accepted the board
     */
    LabOperator(TestingBoard board, Laboratory lab, LabFacts facts, Timeline timeline, BooleanSupplier joined) {
        this.board = board;
        this.lab = lab;
        this.facts = facts;
        this.timeline = timeline;
        this.joined = joined;
        setUp();
        fill();
        switchLamp();
        pulse();
        cut();
        stop();
    }

    private void then(String expected, Runnable begin, BooleanSupplier until, long limit, LongConsumer done) {
        steps.add(new Step(expected, begin, until, limit, done));
    }

    private void then(String expected, Runnable begin, BooleanSupplier until, long limit) {
        then(expected, begin, until, limit, nanos -> { });
    }

    private void after(long nanos, Runnable begin) {
        then("", begin, () -> now - begun >= nanos, Long.MAX_VALUE);
    }

    private void tell(String text) {
        timeline.add(now, "operator", text);
    }

    private void setUp() {
        then("the dispatcher takes the board", () -> { }, joined, LATE);
        then("PANEL is connected", () -> {
            tell("starts the controller PANEL");
            lab.start(lab.panel(), true);
        }, () -> lab.panel().said("logo: AQ1:BOARD:AI1: connected") != null, LATE);
        then("TANKS is connected", () -> {
            tell("starts the controller TANKS");
            lab.start(lab.tanks(), true);
        }, () -> lab.tanks().said("logo: AQ1:PANEL:AI1: connected") != null, LATE);
    }

    private void fill() {
        then("lamp 1 is lit", () -> {
            tell("presses switch 1, start, and opens the tap");
            board.tap(true);
            board.set(1, true);
        }, () -> board.isLit(1), SOON);
        then("both tanks are filled", () -> board.set(1, false), this::filled, LATE, nanos -> {
            tell("both tanks are filled; from now on their levels are watched");
            holding = true;
        });
    }

    private boolean filled() {
        return LabFacts.inBand(1, board.level(1)) && LabFacts.inBand(2, board.level(2));
    }

    private void switchLamp() {
        for (int i = 0; i < TOGGLES; i++) {
            boolean on = i % 2 == 0;
            after(PAUSE, () -> { });
            then("lamp 3 follows switch 3", () -> {
                tell("puts switch 3 " + (on ? "on" : "off"));
                board.set(3, on);
            }, () -> board.isLit(3) == on, SOON, facts::lamp);
        }
    }

    private void pulse() {
        after(0, () -> tell("gives " + PULSES + " pulses of 50 ms with switch 4"));
        for (int i = 0; i < PULSES; i++) {
            after(PULSE, () -> {
                board.set(4, true);
                facts.pulse();
            });
            after(PULSE, () -> board.set(4, false));
        }
        then("the gauge shows " + PULSES + " pulses, and lamp 4 is lit", () -> { },
                () -> board.gauge() == PULSES && board.isLit(4), SOON);
        // An edge that is counted twice can come later than the others.
        then("", () -> { }, () -> now - begun >= SETTLING, Long.MAX_VALUE, nanos -> {
            facts.counted(board.gauge());
            if (board.gauge() != PULSES) {
                throw new DemoFailure("PANEL has counted " + (int) board.gauge() + " pulses of " + PULSES);
            }
            tell("PANEL has counted " + PULSES);
        });
        after(HOLD, () -> { });
    }

    private void cut() {
        then("the valve, the pump and lamp 3 are off, and lamp 2, the alarm, is lit", () -> {
            holding = false;
            tell("kills TANKS");
            lab.tanks().kill();
        }, () -> !board.valve() && !board.pump() && !board.isLit(3) && board.isLit(2), SOON,
                nanos -> tell("the valve, the pump and lamp 3 are off; PANEL gives the alarm"));
        then("tank 2 falls below " + FALLEN + " %", () -> { }, () -> board.level(2) < FALLEN, LATE);
        then("lamp 3 is lit again, and the alarm is over", () -> {
            tell("starts TANKS again, without its list of connections");
            lab.start(lab.tanks(), false);
        }, () -> board.isLit(3) && !board.isLit(2), LATE, nanos -> {
            tell("lamp 3 is lit again, and the alarm is over");
            facts.woke(nanos);
        });
        then("both tanks are filled again", () -> { }, this::filled, LATE, nanos -> holding = true);
        after(HOLD, () -> tell("both tanks are filled again"));
    }

    private void stop() {
        then("lamp 1, the valve and the pump are off", () -> {
            holding = false;
            tell("presses switch 2, stop");
            board.set(2, true);
        }, () -> !board.isLit(1) && !board.valve() && !board.pump(), SOON, nanos -> tell("all is off"));
    }

    /**
     * Continues the script; once per tick.
     *
     * @return true if the script is over
     * @throws DemoFailure if a reaction did not come
     */
    boolean look(long nanos, long stepNanos) {
        now = nanos;
        if (holding) {
            for (int tank = 1; tank <= 2; tank++) {
                String wrong = facts.level(tank, board.level(tank), stepNanos);
                if (wrong != null) {
                    throw new DemoFailure(wrong);
                }
            }
        }
        if (step == null) {
            step = steps.poll();
            if (step == null) {
                return true;
            }
            begun = now;
            step.begin().run();
        }
        if (step.until().getAsBoolean()) {
            step.done().accept(now - begun);
            step = null;
        } else if (now - begun > step.limitNanos()) {
            throw new DemoFailure("it was expected within " + step.limitNanos() / MS + " ms that " + step.expected());
        }
        return false;
    }
}
