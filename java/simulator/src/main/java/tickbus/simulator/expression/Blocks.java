package tickbus.simulator.expression;

import java.util.List;

/**
 * The function blocks. Each place in a table where one is called has its own state, as an instance has in a PLC program.
 *
 * <p>Time is the simulation's: from one tick to the next it advances by the step. As in the standard, {@code TON} with a
 * {@code PT} of 0 is on from the first tick, and an input that is true in the first tick is a rising edge.
 */
final class Blocks {
    static final List<Callable> ALL = List.of(
            timer("TON", "on once IN has been TRUE for PT", Ton::new),
            timer("TOF", "off once IN has been FALSE for PT", Tof::new),
            timer("TP", "a pulse of the length PT when IN becomes TRUE", Tp::new),
            edge("R_TRIG", "on for the tick in which CLK becomes TRUE", true),
            edge("F_TRIG", "on for the tick in which CLK becomes FALSE", false),
            block("SR", "on by S1, off by R; S1 wins", List.of("Q1"), (typing, call) -> bistable(typing, call, true),
                    "S1", "R"),
            block("RS", "on by S, off by R1; R1 wins", List.of("Q1"), (typing, call) -> bistable(typing, call, false),
                    "S", "R1"),
            block("CTU", "on once CU has become TRUE PV times since R", List.of("Q", "CV"), Blocks::ctu,
                    "CU", "R", "PV"));

    /** A block, computed once per tick by way of the output that is used. */
    private abstract static class Block {
        /** The first output, as of the last call. */
        boolean q;
        /** The second output, {@code ET} or {@code CV}. */
        long number;

        abstract void call(double[] values);
    }

    /** A timer: its inputs, and the time since it started. */
    private abstract static class Timer extends Block {
        private final Node in;
        private final Node pt;
        private final long step;
        private long now;
        private long start;
        private boolean started;

        Timer(Node in, Node pt, long step) {
            this.in = in;
            this.pt = pt;
            this.step = step;
        }

        @Override
        void call(double[] values) {
            boolean input = in.truth(values);
            tick(input, Math.max(0, pt.whole(values)));
            now += step;
        }

        abstract void tick(boolean input, long preset);

        /** Starts, if it is not started yet, and sets the elapsed time, which stops at the preset. */
        void elapse(long preset) {
            if (!started) {
                started = true;
                start = now;
            }
            number = Math.min(now - start, preset);
        }

        void reset() {
            started = false;
            number = 0;
        }

        boolean started() {
            return started;
        }
    }

    private static final class Ton extends Timer {
        Ton(Node in, Node pt, long step) {
            super(in, pt, step);
        }

        @Override
        void tick(boolean input, long preset) {
            if (input) {
                elapse(preset);
            } else {
                reset();
            }
            q = input && number >= preset;
        }
    }

    private static final class Tof extends Timer {
        Tof(Node in, Node pt, long step) {
            super(in, pt, step);
        }

        @Override
        void tick(boolean input, long preset) {
            if (input) {
                reset();
                q = true;
            } else if (q) {
                elapse(preset);
                q = number < preset;
            }
        }
    }

    private static final class Tp extends Timer {
        Tp(Node in, Node pt, long step) {
            super(in, pt, step);
        }

        @Override
        void tick(boolean input, long preset) {
            if (input && !started()) {
                q = true;
            }
            // A pulse that is over stays over, even if PT grows.
            if (q) {
                elapse(preset);
                q = number < preset;
            }
            if (!q && !input) {
                reset();
            }
        }
    }

    private Blocks() {
    }

    private static Callable block(String name, String meaning, List<String> outputs, Callable.Maker maker,
            String... parameters) {
        return new Callable(name, List.of(parameters), false, outputs, meaning, maker);
    }

    /** Makes a timer. */
    private interface TimerMaker {
        Timer make(Node in, Node pt, long step);
    }

    private static Callable timer(String name, String meaning, TimerMaker maker) {
        return block(name, meaning, List.of("Q", "ET"), (typing, call) -> {
            Node in = typing.as(Type.BOOL, call.argument(0), "IN of " + name);
            Node pt = typing.as(Type.TIME, call.argument(1), "PT of " + name);
            Timer timer = maker.make(in, pt, call.stepNanos());
            return "ET".equals(call.output()) ? Node.time(call.offset(), v -> {
                timer.call(v);
                return timer.number;
            }) : first(call, timer);
        }, "IN", "PT");
    }

    private static Node first(Call call, Block block) {
        return Node.truth(call.offset(), v -> {
            block.call(v);
            return block.q;
        });
    }

    private static Callable edge(String name, String meaning, boolean rising) {
        return block(name, meaning, List.of("Q"), (typing, call) -> {
            Node clk = typing.as(Type.BOOL, call.argument(0), "CLK of " + name);
            return first(call, new Block() {
                private boolean before;

                @Override
                void call(double[] values) {
                    boolean now = clk.truth(values) == rising;
                    q = now && !before;
                    before = now;
                }
            });
        }, "CLK");
    }

    private static Node bistable(Typing typing, Call call, boolean setWins) {
        Node set = typing.as(Type.BOOL, call.argument(0), (setWins ? "S1 of " : "S of ") + call.name());
        Node reset = typing.as(Type.BOOL, call.argument(1), (setWins ? "R of " : "R1 of ") + call.name());
        return first(call, new Block() {
            @Override
            void call(double[] values) {
                boolean on = set.truth(values);
                boolean off = reset.truth(values);
                q = setWins ? on || !off && q : !off && (on || q);
            }
        });
    }

    private static Node ctu(Typing typing, Call call) {
        Node cu = typing.as(Type.BOOL, call.argument(0), "CU of CTU");
        Node r = typing.as(Type.BOOL, call.argument(1), "R of CTU");
        Node pv = typing.as(Type.LINT, call.argument(2), "PV of CTU");
        Block counter = new Block() {
            private boolean before;

            @Override
            void call(double[] values) {
                boolean now = cu.truth(values);
                if (r.truth(values)) {
                    number = 0;
                } else if (now && !before) {
                    number++;
                }
                before = now;
                q = number >= pv.whole(values);
            }
        };
        return "CV".equals(call.output()) ? Node.whole(call.offset(), v -> {
            counter.call(v);
            return counter.number;
        }) : first(call, counter);
    }
}
