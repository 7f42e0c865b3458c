/* tickbus.h: a simulator in C, or in any language that calls C, on a PLC's fieldbus.
 *
 * A driver.cfg names the fieldbus and the signals; the simulator opens it, and exchanges values with the PLC at each of its
 * ticks:
 *
 *     tb_driver plc;
 *     tb_signal valve, level;
 *     if (tb_open("driver.cfg", NULL, &plc) < 0 || tb_find(plc, "Valve", &valve) < 0 || tb_find(plc, "Level", &level) < 0) {
 *         fputs(tb_last_error(), stderr);
 *         return 1;
 *     }
 *     tb_buffer *values = tb_buffer_of(plc);
 *     for (;;) {
 *         int status = tb_receive(plc);          // TB_FRESH, TB_UNCHANGED, TB_STALE; below 0 a failure
 *         run(tb_get_bool(values, &valve));      // your machine
 *         tb_set(values, &level, mm);
 *         tb_send(plc);
 *     }
 *
 * examples/c/tank.c is a whole one; docs/c-api.md explains it. Link with libtickbus.so (tickbus.dll, libtickbus.dylib).
 *
 * VALUES are in the unit of their signal, scaled as driver.cfg says. Directions are the PLC's: a simulated machine writes %I and
 * reads %Q. What is set out of range is sent as the nearest value that fits, NaN as the signal's fail-safe value; the statistics
 * count both.
 *
 * HANDLES are numbers: one that was never open, or is closed already, is answered by TB_NOT_OPEN or TB_CLOSED. The buffer
 * of a driver stays valid memory after tb_close, until the end of the process; its values then mean nothing, and may
 * become those of another driver.
 *
 * THREADS. One thread at a time ticks a driver and moves its values; a second one that ticks is answered by TB_BUSY. All other
 * functions can be called by any thread: they wait for a tick that is in their way, at most 2 s, before they
 * return TB_BUSY. Any thread may read tb_buffer itself at any time. No function throws, exits, or touches the process's signal
 * handlers. Ask tb_last_error before tb_close: afterwards the line's reason is gone.
 *
 * END. When the process ends by exit() or by the end of main, drivers that are open are closed (not on Windows). A signal
 * that kills the process ends it without that: handle SIGTERM and SIGINT, leave the loop, and call tb_close.
 *
 * FORK. A forked child has none of the driver's threads: it must not call a driver that its parent has opened.
 *
 * License: MIT OR Apache-2.0, at your choice.
 */
#ifndef TICKBUS_H
#define TICKBUS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What functions return. 0 and above: done. docs/status-codes.md explains each; tb_last_error says what to do. */
enum tb_status {
    TB_FRESH = 0,             /* a new bus cycle has arrived since the last exchange */
    TB_UNCHANGED = 1,         /* the link lives, no new bus cycle since the last exchange */
    TB_STALE = 2,             /* nothing has come from the PLC for longer than max_age; the fail-safe values are delivered */
    TB_NOT_OPEN = -1,         /* no driver was ever opened under this handle */
    TB_BUSY = -2,             /* another thread is using this driver at this moment */
    TB_CLOSED = -3,           /* the driver was closed */
    TB_BAD_CONFIG = -4,       /* driver.cfg cannot be used */
    TB_BUS_FAILED = -5,       /* the fieldbus could not be opened, or failed for good */
    TB_UNSUPPORTED = -6,      /* this build or this platform cannot do what driver.cfg asks for */
    TB_TOO_MANY_DRIVERS = -7, /* all places for drivers in this process are taken */
    TB_INTERNAL = -8,         /* the driver met a defect of its own and has stopped */
    TB_LIBRARY = -9,          /* the native library cannot be loaded */
    TB_BAD_ARGUMENT = -10     /* a call had an argument that makes no sense */
};

/* An open driver. Never 0. */
typedef int64_t tb_driver;

/* A value: a double, or for a 64-bit integer without scale that integer. */
typedef union tb_slot {
    double real;
    int64_t integer;
    uint64_t natural;
} tb_slot;

/* Which of them. */
enum tb_kind { TB_REAL = 0, TB_INTEGER = 1, TB_NATURAL = 2 };

/* tb_buffer.simulation_time as long as the simulator has no time of its own. */
#define TB_NO_TIME INT64_MIN

/* What simulator and driver share. All times are in nanoseconds. */
typedef struct tb_buffer {
    uint64_t version;        /* of this layout: 2 */
    int64_t status;          /* of the last tb_exchange, tb_receive or tb_send that did not fail with TB_INTERNAL */
    uint64_t sequence;       /* bus cycles that have arrived */
    int64_t age;             /* of the values read last */
    int64_t simulation_time; /* set it before each tb_exchange or tb_receive, if the simulation has a time of its own */
    int64_t granted;         /* on a stepped bus: how far the simulation may go before it has to exchange again */
    uint64_t ticks;          /* how many there were */
    uint64_t slot_count;     /* slots that follow: see tb_slots */
    uint64_t saturated;      /* counted by tb_set: values beyond a 64-bit integer */
    uint64_t not_a_number;   /* counted by tb_set: NaN for a 64-bit integer */
    tb_slot spare;           /* of a signal that was not found */
} tb_buffer;

/* A signal. The texts are valid until the end of the process. */
typedef struct tb_signal {
    const char *name;
    const char *address; /* in IEC form, such as %QX1.0 */
    const char *type;    /* the IEC data type, such as INT */
    const char *unit;    /* empty for none */
    const char *station; /* empty if driver.cfg names no stations */
    int32_t slot;        /* where its value is among tb_slots */
    int32_t edges;       /* where the number of edges is that came with the last exchange; -1: none are counted */
    int32_t is_written;  /* 1 if the simulator writes it, 0 if it reads it */
    int32_t kind;        /* what its slot holds: TB_REAL; TB_INTEGER for LINT, TB_NATURAL for ULINT and LWORD */
    tb_slot fail_safe;   /* what its slot holds at first; sent for NaN */
} tb_signal;

/* A change of a signal, for buses with `events = true`. */
typedef struct tb_event {
    int64_t signal; /* its index, as for tb_signal_at */
    tb_slot value;
    int64_t time; /* on the driver's clock */
} tb_event;

#if defined(_WIN32)
#define TB_IMPORT __declspec(dllimport)
#else
#define TB_IMPORT
#endif

/* Opens what a driver.cfg describes. `tables`, which may be NULL, is TOML that stands in place of tables of the file, such as
 * another [fieldbus]. Does not wait for the PLC. `driver` gets the handle, or 0. */
TB_IMPORT int32_t tb_open(const char *path, const char *tables, tb_driver *driver);

/* Closes. What was set since the last tb_send or tb_exchange is not sent; a recording has it if tb_receive had begun a tick. */
TB_IMPORT int32_t tb_close(tb_driver driver);

/* A tick: sends what was set, and gets what the PLC has sent. Takes no lock, makes no system call, allocates nothing; on
 * a stepped bus it waits. */
TB_IMPORT int32_t tb_exchange(tb_driver driver);

/* The two halves of a tick: first get, then, after the machine's step, send. */
TB_IMPORT int32_t tb_receive(tb_driver driver);
TB_IMPORT int32_t tb_send(tb_driver driver);

/* The values of a driver; NULL if it is not open. */
TB_IMPORT tb_buffer *tb_buffer_of(tb_driver driver);

/* How many signals there are, or a status below 0. */
TB_IMPORT int32_t tb_signal_count(tb_driver driver);

/* A signal by its index, from 0, in the order of driver.cfg; or by its name. On failure `signal` is one that reads 0 and cannot
 * be set. TB_BAD_ARGUMENT: the driver has no such signal. */
TB_IMPORT int32_t tb_signal_at(tb_driver driver, int32_t index, tb_signal *signal);
TB_IMPORT int32_t tb_find(tb_driver driver, const char *name, tb_signal *signal);

/* The statistics, a line each, "key=value" (docs/statistics.md). As snprintf does, returns the length of the whole text
 * without its final 0, and writes what there is room for; or returns a status below 0. */
TB_IMPORT int32_t tb_statistics(tb_driver driver, char *text, size_t room);

/* Moves waiting events to `events`, at most 64 at once. Returns their number, or a status below 0. */
TB_IMPORT int32_t tb_events(tb_driver driver, tb_event *events, size_t room);

/* Injects a fault, as in a [[fault]] table of driver.cfg: "kind = \"stuck\"\nsignal = \"Valve\"". Returns its number, or a
 * status below 0. */
TB_IMPORT int32_t tb_inject(tb_driver driver, const char *fault);

/* Ends a fault by its number. Returns 1, or 0 if there is none, or a status below 0. */
TB_IMPORT int32_t tb_end_fault(tb_driver driver, int32_t fault);

/* The injected faults, a line each: number, state, how often begun, kind, name, effect, with tabs between. Returns as
 * tb_statistics does. */
TB_IMPORT int32_t tb_faults(tb_driver driver, char *text, size_t room);

/* The address of the live page on which the driver is shown, with the token that lets who opens it force signals; "" if its
 * driver.cfg has no [page]. Returns as tb_statistics does. */
TB_IMPORT int32_t tb_page(tb_driver driver, char *text, size_t room);

/* Paces a loop by the computer's clock: waits until *due, then moves it on by `period` (nanoseconds, above 0). *due is 0 before the
 * first turn, which begins at once. Returns by how many nanoseconds this turn begins late, or a status below 0. A late turn does
 * not delay the next one; turns that were missed are left out.
 *
 *     int64_t due = 0;
 *     for (;;) { int64_t lag = tb_wait_until(&due, 10000000); ... one step of 10 ms ... } */
TB_IMPORT int64_t tb_wait_until(int64_t *due, int64_t period);

/* The version of the library, such as "0.1.0". */
TB_IMPORT const char *tb_version(void);

/* Why the last failed call of this thread failed, and what to do; "" if none has. Valid until this thread's next call. */
TB_IMPORT const char *tb_last_error(void);

/* The slots of a buffer. */
static inline tb_slot *tb_slots(tb_buffer *values) { return (tb_slot *)(values + 1); }

/* The value of a signal as a double. */
static inline double tb_get(tb_buffer *values, const tb_signal *signal) {
    const tb_slot *slot = tb_slots(values) + signal->slot;
    return signal->kind == TB_REAL ? slot->real : signal->kind == TB_INTEGER ? (double)slot->integer : (double)slot->natural;
}

static inline int tb_get_bool(tb_buffer *values, const tb_signal *signal) { return tb_get(values, signal) != 0; }

/* The nearest whole number; halves away from zero. */
static inline double tb_whole(double value) {
    const double all_whole = 4503599627370496.0;
    if (value <= -all_whole || value >= all_whole || value != value) return value;
    double whole = (double)(int64_t)value;
    return value - whole >= 0.5 ? whole + 1 : value - whole <= -0.5 ? whole - 1 : whole;
}

/* Sets a signal, to be sent with the next tb_exchange or tb_send. For a BOOL everything but 0 is true. What its slot cannot
 * hold becomes the nearest value that it can; write integers beyond 2^53 into the slot itself. Returns 0; or TB_BAD_ARGUMENT,
 * and does nothing, if the PLC writes this signal or it was not found. */
static inline int32_t tb_set(tb_buffer *values, const tb_signal *signal, double value) {
    if (!signal->is_written) return TB_BAD_ARGUMENT;
    tb_slot *slot = tb_slots(values) + signal->slot;
    if (signal->kind == TB_REAL) {
        slot->real = value;
        return TB_FRESH;
    }
    double whole = tb_whole(value);
    double least = signal->kind == TB_NATURAL ? 0 : -9223372036854775808.0;
    double beyond = signal->kind == TB_NATURAL ? 18446744073709551616.0 : 9223372036854775808.0;
    if (whole != whole) {
        *slot = signal->fail_safe;
        values->not_a_number++;
    } else if (whole >= least && whole < beyond) {
        if (signal->kind == TB_NATURAL) slot->natural = (uint64_t)whole;
        else slot->integer = (int64_t)whole;
    } else {
        if (signal->kind == TB_NATURAL) slot->natural = whole > 0 ? UINT64_MAX : 0;
        else slot->integer = whole > 0 ? INT64_MAX : INT64_MIN;
        values->saturated++;
    }
    return TB_FRESH;
}

/* How many edges came with the last exchange; 0 if none are counted. */
static inline uint32_t tb_edges(tb_buffer *values, const tb_signal *signal) {
    return signal->edges < 0 ? 0 : (uint32_t)tb_slots(values)[signal->edges].real;
}

#ifdef __cplusplus
}
#endif

#endif
