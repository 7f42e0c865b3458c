/* tickbus.h: connects a simulator in C, or in any language that calls C, to a PLC's fieldbus.
 *
 * A driver.cfg names the fieldbus and the signals. The simulator opens it and exchanges values with the PLC at every tick:
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
 * examples/c/tank.c is a complete program; docs/c-api.md explains it. Link with libtickbus.so (tickbus.dll, libtickbus.dylib).
 *
 * VALUES are in the signal's unit, scaled as driver.cfg says. Directions are the PLC's: a simulated machine writes %I and reads
 * %Q. A value out of range is sent as the nearest value that fits, NaN as the signal's fail-safe value; the statistics count
 * both.
 *
 * HANDLES are numbers. A handle that was never open returns TB_NOT_OPEN, a closed one TB_CLOSED. A driver's buffer stays valid
 * memory after tb_close, until the process ends; its values then mean nothing, and can become those of another driver.
 *
 * THREADS. One thread at a time ticks a driver and reads and writes its values; a tick by a second thread meanwhile returns
 * TB_BUSY. Any thread can call all other functions: they wait up to 2 s for a tick in progress, then return TB_BUSY. Any thread
 * may read tb_buffer itself at any time. No function throws, exits, or touches the process's signal handlers. Call
 * tb_last_error before tb_close: after it, the reason why the line failed is lost.
 *
 * END. When the process ends by exit() or by returning from main, open drivers are closed (not on Windows). A signal that kills
 * the process closes nothing: handle SIGTERM and SIGINT, leave the loop, and call tb_close.
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

/* Return values. 0 and above: success. docs/status-codes.md explains each code; tb_last_error says what to do. */
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
    TB_INTERNAL = -8,         /* the driver has a defect and has stopped */
    TB_LIBRARY = -9,          /* the native library cannot be loaded */
    TB_BAD_ARGUMENT = -10     /* an argument is invalid */
};

/* An open driver. Never 0. */
typedef int64_t tb_driver;

/* Nets on the page. Never 0. */
typedef int64_t tb_nets;

/* A value: a double, or an integer for a signal of a 64-bit integer type without scale. */
typedef union tb_slot {
    double real;
    int64_t integer;
    uint64_t natural;
} tb_slot;

/* The member of tb_slot in use. */
enum tb_kind { TB_REAL = 0, TB_INTEGER = 1, TB_NATURAL = 2 };

/* The initial tb_buffer.simulation_time: the simulator has no time of its own. */
#define TB_NO_TIME INT64_MIN

/* The memory that simulator and driver share. All times are in nanoseconds. */
typedef struct tb_buffer {
    uint64_t version;        /* of this layout: 2 */
    int64_t status;          /* of the last tb_exchange, tb_receive or tb_send that did not fail with TB_INTERNAL */
    uint64_t sequence;       /* bus cycles that have arrived */
    int64_t age;             /* of the values read last */
    int64_t simulation_time; /* set it before each tb_exchange or tb_receive, if the simulation has a time of its own */
    int64_t granted;         /* on a stepped bus: the time up to which the simulation may run before the next exchange */
    uint64_t ticks;          /* ticks so far */
    uint64_t slot_count;     /* slots that follow: see tb_slots */
    uint64_t saturated;      /* counted by tb_set: values beyond a 64-bit integer */
    uint64_t not_a_number;   /* counted by tb_set: NaN for a 64-bit integer */
    tb_slot spare;           /* the slot of every signal that was not found */
} tb_buffer;

/* A signal. The texts are valid until the end of the process. */
typedef struct tb_signal {
    const char *name;
    const char *address; /* in IEC form, such as %QX1.0 */
    const char *type;    /* the IEC data type, such as INT */
    const char *unit;    /* empty for none */
    const char *station; /* empty if driver.cfg names no stations */
    int32_t slot;        /* index of the value among tb_slots */
    int32_t edges;       /* index among tb_slots of the number of edges in the last exchange; -1: edges are not counted */
    int32_t is_written;  /* 1 if the simulator writes the signal, 0 if it reads it */
    int32_t kind;        /* of the slot: TB_REAL; for unscaled 64-bit types TB_INTEGER (LINT) or TB_NATURAL (ULINT, LWORD) */
    tb_slot fail_safe;   /* the slot's initial value; sent for NaN */
} tb_signal;

/* A change of a signal, for buses with `events = true`. */
typedef struct tb_event {
    int64_t signal; /* the signal's index, as for tb_signal_at */
    tb_slot value;
    int64_t time; /* on the driver's clock */
} tb_event;

/* One turn of a loop over tb_every, in nanoseconds. All members are 0 before the first turn. */
typedef struct tb_turn {
    int64_t time;   /* when the turn was due, since the first one: the simulation's time, if it keeps pace with the clock */
    int64_t lag;    /* how late it begins: less than the period */
    int64_t missed; /* how many turns before it were skipped */
    int64_t begun;  /* for the library: when the first turn began */
    int64_t due;    /* for the library: when the next turn is due */
} tb_turn;

/* A change of a fault of the simulation's model. */
typedef struct tb_model_fault {
    int32_t fault; /* the fault's index among the names of tb_declare_faults */
    int32_t is_on; /* 1 from the tick in which the fault begins, 0 from the one in which it ends */
    double value;  /* the fault's value; 0 if it is off */
} tb_model_fault;

#if defined(_WIN32)
#define TB_IMPORT __declspec(dllimport)
#else
#define TB_IMPORT
#endif

/* Opens the driver that a driver.cfg describes. `tables` is NULL or TOML that replaces tables of the file, such as [fieldbus].
 * Does not wait for the PLC. Sets *driver to the handle, or to 0 on failure. */
TB_IMPORT int32_t tb_open(const char *path, const char *tables, tb_driver *driver);

/* Closes a driver. Values set since the last tb_send or tb_exchange are not sent; a recording has them if tb_receive had begun
 * a tick. */
TB_IMPORT int32_t tb_close(tb_driver driver);

/* A tick: sends the values that were set, and receives those that the PLC has sent. Takes no lock, makes no system call,
 * allocates nothing. Waits for the PLC only on a stepped bus. */
TB_IMPORT int32_t tb_exchange(tb_driver driver);

/* The two halves of a tick: receive, run the machine's step, send. */
TB_IMPORT int32_t tb_receive(tb_driver driver);
TB_IMPORT int32_t tb_send(tb_driver driver);

/* Ticks `count` drivers in one call, one after the other on this thread, as tb_exchange, tb_receive and tb_send do. A driver that
 * fails stops no other one: each has its status in `statuses`. `times` has the simulation time of each driver, which is also
 * stored in its buffer; or is NULL, and the buffers' own times count. A driver that is in the list twice is ticked once, and the
 * second status is TB_BAD_ARGUMENT. Returns the number of statuses below 0; tb_last_error explains the last of them. Returns
 * TB_BAD_ARGUMENT and ticks none if a list is NULL, or if there are more drivers than a process can open (4096).
 *
 * Drivers that wait for each other, as two clients of one run on virtual time do, need a thread each. */
TB_IMPORT int32_t tb_exchange_many(const tb_driver *drivers, size_t count, const int64_t *times, int32_t *statuses);
TB_IMPORT int32_t tb_receive_many(const tb_driver *drivers, size_t count, const int64_t *times, int32_t *statuses);
TB_IMPORT int32_t tb_send_many(const tb_driver *drivers, size_t count, int32_t *statuses);

/* Begins the next episode without opening again: values, counts of edges, faults and the counters of ticks are as after tb_open,
 * and simulation time begins at 0. A hosted PLC program begins with its first scan; a connection to a PLC stays. The thread that
 * ticks the driver calls this. TB_UNSUPPORTED: the time belongs to other participants as well, and the driver is as before. */
TB_IMPORT int32_t tb_reset(tb_driver driver);

/* Reads the driver.cfg again, and gives the line its settings while the simulation ticks: the present bus ends as with tb_close,
 * and the new one opens; until its PLC sends something, data are stale. TB_FRESH: the line has other settings now;
 * TB_UNCHANGED: it has those of the file already. Any thread may call this. TB_BAD_CONFIG: the file has mistakes;
 * TB_UNSUPPORTED: more than the line differs, and tb_last_error says what; the line is then as before. */
TB_IMPORT int32_t tb_reload(tb_driver driver);

/* The values of a driver; NULL if it is not open. */
TB_IMPORT tb_buffer *tb_buffer_of(tb_driver driver);

/* The number of signals, or a status below 0. */
TB_IMPORT int32_t tb_signal_count(tb_driver driver);

/* Gets a signal by its index, from 0 in the order of driver.cfg, or by its name. On failure *signal reads 0 and cannot be set.
 * TB_BAD_ARGUMENT: the driver has no such signal. */
TB_IMPORT int32_t tb_signal_at(tb_driver driver, int32_t index, tb_signal *signal);
TB_IMPORT int32_t tb_find(tb_driver driver, const char *name, tb_signal *signal);

/* Writes the statistics to `text`, one "key=value" per line (docs/statistics.md). Like snprintf, writes at most `room` bytes
 * and returns the length of the whole text without the final 0; or returns a status below 0. */
TB_IMPORT int32_t tb_statistics(tb_driver driver, char *text, size_t room);

/* Moves waiting events to `events`, at most 64 at once. Returns their number, or a status below 0. */
TB_IMPORT int32_t tb_events(tb_driver driver, tb_event *events, size_t room);

/* Names the faults that the simulation's model can have: those that a fault of kind "model" can name (docs/faults.md). Call it
 * before the first tick. TB_BAD_ARGUMENT: a name is empty or there twice, or a fault of driver.cfg has another name; the message
 * has the nearest one. */
TB_IMPORT int32_t tb_declare_faults(tb_driver driver, const char *const *names, size_t count);

/* Moves the changes of the model's faults since the last call to `faults`, at most `room`. Returns their number, or a status below
 * 0. The thread that ticks asks after each tb_exchange, or between tb_receive and tb_send, until it gets less than `room`. */
TB_IMPORT int32_t tb_model_faults(tb_driver driver, tb_model_fault *faults, size_t room);

/* Injects a fault, written as in a [[fault]] table of driver.cfg: "kind = \"stuck\"\nsignal = \"Valve\"". Returns the fault's
 * number, or a status below 0. */
TB_IMPORT int32_t tb_inject(tb_driver driver, const char *fault);

/* Ends a fault by its number. Returns 1, or 0 if no fault has this number, or a status below 0. */
TB_IMPORT int32_t tb_end_fault(tb_driver driver, int32_t fault);

/* Writes the injected faults, one per line: number, state, number of times begun, kind, name, effect, separated by tabs.
 * Returns as tb_statistics does. */
TB_IMPORT int32_t tb_faults(tb_driver driver, char *text, size_t room);

/* Writes the address of the driver's live page; "" if driver.cfg has no [page]. The address contains the token that permits
 * forcing signals: pass it on with care. Returns as tb_statistics does. */
TB_IMPORT int32_t tb_page(tb_driver driver, char *text, size_t room);

/* Petri nets that this process runs, on its live page: docs/petri.md describes the page and the JSON. tb_nets_open shows nets under a
 * heading. The page is that of the drivers if one of them has a page; otherwise it is served at `address`, such as "127.0.0.1:8080"
 * for this computer alone; port 0 lets the system choose. Sets *nets to a handle, or to 0 on failure. Any thread may call these
 * functions. */
TB_IMPORT int32_t tb_nets_open(const char *address, const char *title, tb_nets *nets);

/* Writes the address of the page with the nets. It has no token: the page of nets only shows. Returns as tb_statistics does. */
TB_IMPORT int32_t tb_nets_page(tb_nets nets, char *text, size_t room);

/* Hands over the names, conditions and drawings of the nets as JSON, once. TB_BAD_ARGUMENT: tb_last_error says where it is wrong. */
TB_IMPORT int32_t tb_nets_draw(tb_nets nets, const char *json);

/* Returns 1 if a state is wanted: somebody looks, and the last state is 33 ms old. Otherwise waits for that, at most `patience`
 * nanoseconds, and returns 0 if it was in vain; or returns a status below 0. With 0 it never waits. */
TB_IMPORT int32_t tb_nets_wanted(tb_nets nets, int64_t patience);

/* Hands over the present states of the nets as JSON. Viewers never make the caller wait. */
TB_IMPORT int32_t tb_nets_put(tb_nets nets, const char *json);

/* Takes the nets from the page. A tb_nets_wanted of another thread returns 0. */
TB_IMPORT int32_t tb_nets_close(tb_nets nets);

/* Returns 1 once the bus has ended the run on its own, as virtual time does: further ticks bring stale values. Returns 0 before
 * that, or a status below 0. */
TB_IMPORT int32_t tb_is_over(tb_driver driver);

/* Paces a loop by the computer's clock: waits until the next turn is due, one in each `period` (nanoseconds, above 0), and
 * describes it. The first turn begins at once. A late turn does not delay the next one; missed turns are skipped. Returns 0, or
 * a status below 0.
 *
 *     tb_turn turn = {0};
 *     while (tb_is_over(plc) == 0 && tb_every(10000000, &turn) == TB_FRESH) {
 *         values->simulation_time = turn.time;
 *         ... one step of 10 ms ...
 *     } */
TB_IMPORT int32_t tb_every(int64_t period, tb_turn *turn);

/* The version of the library, such as "0.1.0". */
TB_IMPORT const char *tb_version(void);

/* Why this thread's last failed call failed, and what to do; "" if no call has failed. Valid until this thread's next call. */
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

/* Sets a signal, to be sent with the next tb_exchange or tb_send. For a BOOL, every value but 0 is true. A value that the slot
 * cannot hold becomes the nearest one that it can; write integers beyond 2^53 to the slot directly. Returns 0. Returns
 * TB_BAD_ARGUMENT and does nothing if the PLC writes this signal, or if it was not found. */
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

/* The number of edges in the last exchange; 0 if edges are not counted. */
static inline uint32_t tb_edges(tb_buffer *values, const tb_signal *signal) {
    return signal->edges < 0 ? 0 : (uint32_t)tb_slots(values)[signal->edges].real;
}

#ifdef __cplusplus
}
#endif

#endif
