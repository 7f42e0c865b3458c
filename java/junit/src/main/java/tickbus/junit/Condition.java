package tickbus.junit;

import java.util.ArrayList;
import java.util.List;
import java.util.Objects;
import java.util.function.BooleanSupplier;
import java.util.function.DoublePredicate;
import java.util.stream.Collectors;
import java.util.stream.Stream;

/**
 * Something that is true or false at the end of a tick, usually about one signal. To be imported statically:
 *
 * <pre>{@code
 * plc.expect(on("Running lamp"));
 * plc.await(is("Phase", 3).and(off("Fault lamp"))).within("25s");
 * }</pre>
 */
public abstract class Condition {
    private Condition() {
    }

    /**
     * The signal is on: not 0.
     *
     * @param signal a name of driver.cfg
     * @return the condition
     */
    public static Condition on(String signal) {
        return value(signal, "on", value -> value != 0);
    }

    /**
     * The signal is off: 0.
     *
     * @param signal a name of driver.cfg
     * @return the condition
     */
    public static Condition off(String signal) {
        return value(signal, "off", value -> value == 0);
    }

    /**
     * The signal has exactly this value.
     *
     * @param signal a name of driver.cfg
     * @param value in the signal's unit
     * @return the condition
     */
    public static Condition is(String signal, double value) {
        return value(signal, Watch.number(value), seen -> seen == value);
    }

    /**
     * The signal has this value, or nearly: scaled values are seldom exact.
     *
     * @param signal a name of driver.cfg
     * @param value in the signal's unit
     * @param tolerance the largest deviation
     * @return the condition
     */
    public static Condition near(String signal, double value, double tolerance) {
        if (!(tolerance >= 0)) {
            throw new IllegalArgumentException("a tolerance of " + tolerance + "; it is 0 or more");
        }
        return value(signal, Watch.number(value) + " ± " + Watch.number(tolerance),
            seen -> Math.abs(seen - value) <= tolerance);
    }

    /**
     * The signal is greater than a limit.
     *
     * @param signal a name of driver.cfg
     * @param limit in the signal's unit
     * @return the condition
     */
    public static Condition above(String signal, double limit) {
        return value(signal, "above " + Watch.number(limit), seen -> seen > limit);
    }

    /**
     * The signal is less than a limit.
     *
     * @param signal a name of driver.cfg
     * @param limit in the signal's unit
     * @return the condition
     */
    public static Condition below(String signal, double limit) {
        return value(signal, "below " + Watch.number(limit), seen -> seen < limit);
    }

    /**
     * The signal has gone from off to on, at least once since this condition was handed to the {@link Plc}.
     *
     * @param signal a name of driver.cfg
     * @return the condition
     */
    public static Condition rises(String signal) {
        return new Edge(signal, true);
    }

    /**
     * The signal has gone from on to off, at least once since this condition was handed to the {@link Plc}.
     *
     * @param signal a name of driver.cfg
     * @return the condition
     */
    public static Condition falls(String signal) {
        return new Edge(signal, false);
    }

    /**
     * No change came and went before the other side took a frame, since the test began (docs/timing.md).
     *
     * @param signals names of driver.cfg, of signals whose swallowed changes are counted; none for all that are counted
     * @return the condition
     */
    public static Condition nothingSwallowed(String... signals) {
        List<String> names = List.of(signals);
        return new Condition() {
            @Override
            Bound bind(Plc plc) {
                names.forEach(plc::watch);
                return new Unswallowed(plc, names);
            }
        };
    }

    /**
     * Any other condition, such as the state of the machine model.
     *
     * @param what the name in a failure, such as "bottle 1 is treated"
     * @param holds asked at the end of each tick
     * @return the condition
     */
    public static Condition when(String what, BooleanSupplier holds) {
        Objects.requireNonNull(what, "what");
        Objects.requireNonNull(holds, "holds");
        return new Condition() {
            @Override
            Bound bind(Plc plc) {
                return new Bound() {
                    @Override
                    boolean holds() {
                        return holds.getAsBoolean();
                    }

                    @Override
                    String subject() {
                        return "\"" + what + "\"";
                    }

                    @Override
                    String expected() {
                        return "true";
                    }

                    @Override
                    String seen() {
                        return String.valueOf(holds());
                    }
                };
            }
        };
    }

    /**
     * Both conditions hold in the same tick.
     *
     * @param other the other one
     * @return the condition
     */
    public Condition and(Condition other) {
        return new Both(this, Objects.requireNonNull(other, "other"), true);
    }

    /**
     * One of the conditions holds, or both do.
     *
     * @param other the other one
     * @return the condition
     */
    public Condition or(Condition other) {
        return new Both(this, Objects.requireNonNull(other, "other"), false);
    }

    /**
     * The condition does not hold.
     *
     * @return the opposite
     */
    public Condition negated() {
        Condition original = this;
        return new Condition() {
            @Override
            Bound bind(Plc plc) {
                Bound bound = original.bind(plc);
                return new Bound() {
                    @Override
                    boolean holds() {
                        return !bound.holds();
                    }

                    @Override
                    String subject() {
                        return bound.subject();
                    }

                    @Override
                    String expected() {
                        return "not " + bound.expected();
                    }

                    @Override
                    String seen() {
                        return bound.seen();
                    }

                    @Override
                    List<Watch> watches() {
                        return bound.watches();
                    }
                };
            }
        };
    }

    /** Finds the signals; throws {@link IllegalArgumentException} with the nearest names if one does not exist. */
    abstract Bound bind(Plc plc);

    private static Condition value(String signal, String expected, DoublePredicate holds) {
        Objects.requireNonNull(signal, "signal");
        return new Condition() {
            @Override
            Bound bind(Plc plc) {
                Watch watch = plc.watch(signal);
                return new OfSignal(watch) {
                    @Override
                    boolean holds() {
                        return holds.test(watch.signal().get());
                    }

                    @Override
                    String expected() {
                        return expected;
                    }

                    @Override
                    String seen() {
                        return watch.text();
                    }
                };
            }
        };
    }

    /** A condition bound to the signals of one PLC. */
    abstract static class Bound {
        abstract boolean holds();

        /** The condition's subject, which begins a failure's sentence. */
        abstract String subject();

        abstract String expected();

        abstract String seen();

        /** The failure as a sentence; {@code when} is the span in which the condition should have held. */
        String failure(String when) {
            return subject() + " is " + seen() + ", expected " + expected() + (when.isEmpty() ? "" : " " + when);
        }

        /** The signals that the condition depends on. */
        List<Watch> watches() {
            return List.of();
        }
    }

    private static final class Unswallowed extends Bound {
        private final Plc plc;
        private final List<String> names;

        Unswallowed(Plc plc, List<String> names) {
            this.plc = plc;
            this.names = names;
        }

        @Override
        boolean holds() {
            return !plc.hasSwallowed(names);
        }

        @Override
        String subject() {
            return "what was swallowed";
        }

        @Override
        String expected() {
            return "nothing swallowed";
        }

        @Override
        String seen() {
            return String.join("\n  ", plc.swallowed(names).values());
        }

        @Override
        String failure(String when) {
            return "expected nothing swallowed: " + seen();
        }

        @Override
        List<Watch> watches() {
            return plc.swallowed(names).keySet().stream().limit(1).map(plc::watch).toList();
        }
    }

    private abstract static class OfSignal extends Bound {
        private final Watch watch;

        OfSignal(Watch watch) {
            this.watch = watch;
        }

        @Override
        String subject() {
            return watch.quoted();
        }

        @Override
        List<Watch> watches() {
            return List.of(watch);
        }
    }

    private static final class Edge extends Condition {
        private final String signal;
        private final boolean rising;

        Edge(String signal, boolean rising) {
            this.signal = Objects.requireNonNull(signal, "signal");
            this.rising = rising;
        }

        @Override
        Bound bind(Plc plc) {
            Watch watch = plc.watch(signal);
            long before = count(watch);
            return new OfSignal(watch) {
                @Override
                boolean holds() {
                    return count(watch) != before;
                }

                @Override
                String expected() {
                    return rising ? "a rising edge" : "a falling edge";
                }

                @Override
                String seen() {
                    long count = count(watch) - before;
                    return count == 0 ? watch.text() + " without one" : watch.text() + " after " + count;
                }
            };
        }

        private long count(Watch watch) {
            return rising ? watch.rises() : watch.falls();
        }
    }

    private static final class Both extends Condition {
        private final Condition one;
        private final Condition other;
        private final boolean and;

        Both(Condition one, Condition other, boolean and) {
            this.one = one;
            this.other = other;
            this.and = and;
        }

        @Override
        Bound bind(Plc plc) {
            Bound first = one.bind(plc);
            Bound second = other.bind(plc);
            return new Bound() {
                @Override
                boolean holds() {
                    return and ? first.holds() && second.holds() : first.holds() || second.holds();
                }

                @Override
                String subject() {
                    // Of two conditions that must both hold, only those that fail are reported.
                    return wrong().map(Bound::subject).collect(Collectors.joining(join()));
                }

                @Override
                String expected() {
                    return wrong().map(Bound::expected).collect(Collectors.joining(join()));
                }

                @Override
                String seen() {
                    return wrong().map(Bound::seen).collect(Collectors.joining(join()));
                }

                @Override
                List<Watch> watches() {
                    List<Watch> all = new ArrayList<>(first.watches());
                    second.watches().stream().filter(watch -> !all.contains(watch)).forEach(all::add);
                    return all;
                }

                private Stream<Bound> wrong() {
                    boolean whole = holds() || !and;
                    return Stream.of(first, second).filter(part -> whole || !part.holds());
                }

                private String join() {
                    return and ? " and " : " or ";
                }
            };
        }
    }
}
