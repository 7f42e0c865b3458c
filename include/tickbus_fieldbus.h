/* tickbus_fieldbus.h: what a shared library exports to be a fieldbus of tickbus.
 *
 * A driver.cfg with
 *
 *     [fieldbus]
 *     kind    = "plugin"
 *     library = "libmybus.so"
 *     options = { card = 0, baud = "1500k" }
 *
 * loads the library and calls the five functions below. docs/plugin.md goes through it step by step;
 * examples/udp-fieldbus is a whole one.
 *
 * ORDER AND THREAD. One thread, the driver's bus thread, makes all calls:
 *
 *     tickbus_abi_version                    once after loading
 *     tickbus_open                           once per attempt to open the line
 *       tickbus_exchange, again and again    once per bus cycle
 *     tickbus_close                          once for every tickbus_open that returned TICKBUS_OK
 *
 * tickbus_last_error follows a failed call at once. After a tickbus_exchange that failed the host
 * closes the bus (but see TICKBUS_E_LEFT), waits (the driver.cfg's `reconnect`), and opens it anew; the library stays loaded
 * meanwhile. Two driver.cfg may name one library: then two threads call it, each with a tickbus_bus
 * of its own, so whatever they share needs a lock, or better, is not shared.
 *
 * WHAT THE LIBRARY LEAVES ALONE. The process is the simulator's, often a Java VM: install no signal
 * handlers, change neither locale nor working directory nor floating-point mode, do not exit. No C++
 * exception may leave a function. Threads that tickbus_open starts must have ended when
 * tickbus_close returns, because the library may be unloaded then.
 *
 * VERSIONS. TICKBUS_ABI_VERSION grows when a library built against an older header would break; the
 * host then refuses it with both numbers. What is added without breaking anything comes at the end of
 * a struct, and `size`, the first member of each, tells how far the host's struct reaches: read a
 * member that came later only if TICKBUS_HAS(pointer, member) holds. Never use sizeof of these structs
 * to walk arrays; they are arrays of pointers for that reason. Flags and errors that a later version
 * adds are only ever used by libraries, so an older host answers them with an error that has the number.
 *
 * License: MIT OR Apache-2.0, at your choice.
 */
#ifndef TICKBUS_FIELDBUS_H
#define TICKBUS_FIELDBUS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The version of this interface; what tickbus_abi_version returns. */
#define TICKBUS_ABI_VERSION 1u

#if defined(_WIN32)
#define TICKBUS_EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define TICKBUS_EXPORT __attribute__((visibility("default")))
#else
#define TICKBUS_EXPORT
#endif

/* Whether the host's struct behind `pointer` reaches as far as to have `member`. */
#define TICKBUS_HAS(pointer, member) \
    ((pointer)->size >= (size_t)((const char *)(&(pointer)->member + 1) - (const char *)(pointer)))

/* ---- What tickbus_open and tickbus_exchange return -------------------------------------------- */

/* tickbus_open: the bus is open. */
#define TICKBUS_OK 0

/* tickbus_exchange, 0 and above: the sum of what happened. 0 means that nothing was heard of the
 * peer within the time-out, which is no error: data grow older, and are stale after `max_age`. */

/* The peer has the bytes of `in` of this call, or will get these very bytes: the library keeps them
 * until it does. Without this flag the host assumes them lost. It shows pulses in them again until a
 * call has the flag, so a flag given too early loses pulses, and one never given holds them for ever. */
#define TICKBUS_TAKEN 1
/* `out` holds a new whole image from the peer: all out_size bytes, of one moment. An image equal to the
 * one before is new, too, if it has arrived since. */
#define TICKBUS_FRESH 2
/* The peer showed life. TICKBUS_TAKEN and TICKBUS_FRESH imply it. */
#define TICKBUS_ALIVE 4

/* Errors of tickbus_open and tickbus_exchange. All but the last make the host close and open again after
 * its back-off; they differ in what people are told. */

/* The link is down, or was never there: no card, cable out, peer unreachable. */
#define TICKBUS_E_LINK (-1)
/* The peer sent what it must not send. */
#define TICKBUS_E_PROTOCOL (-2)
/* The peer understood, and declined. */
#define TICKBUS_E_REFUSED (-3)
/* The options in the driver.cfg are wrong; say in last_error which one, and what would be right. */
#define TICKBUS_E_CONFIG (-4)
/* The library cannot do what is asked for: this role, these sizes, this number of stations. */
#define TICKBUS_E_UNSUPPORTED (-5)
/* tickbus_exchange only: the peer took its leave in good order. This one error leaves the bus open: people
 * are told, and the host goes on exchanging until the next peer comes. */
#define TICKBUS_E_LEFT (-6)

/* ---- What tickbus_open is given --------------------------------------------------------------- */

/* Everything below is the host's, and valid until tickbus_open returns: copy what you need. Texts are
 * UTF-8, end with a 0 byte, and are never NULL. */

/* This end is the machine: it sends PLC inputs (%I) and receives PLC outputs (%Q). */
#define TICKBUS_ROLE_DEVICE 0u
/* This end is the PLC: it sends %Q and receives %I. */
#define TICKBUS_ROLE_CONTROLLER 1u

/* One entry of `options` in the driver.cfg. */
typedef struct tickbus_option {
    uint32_t size;     /* bytes of this struct */
    const char *key;   /* as it is written there */
    const char *value; /* a text as it is; a number in its digits; a boolean as "true" or "false" */
} tickbus_option;

typedef struct tickbus_config {
    uint32_t size;                        /* bytes of this struct */
    uint32_t role;                        /* TICKBUS_ROLE_DEVICE or TICKBUS_ROLE_CONTROLLER */
    const char *name;                     /* the driver's name, for messages */
    const char *directory;                /* where the driver.cfg stands; relative paths begin there */
    const tickbus_option *const *options; /* pointers to option_count options, sorted by key */
    uint32_t option_count;
    uint32_t timeout_ms;                  /* what tickbus_exchange will be given, at least 1 */
    uint64_t cycle_ns;                    /* tickbus_exchange is called this often, in nanoseconds */
    uint64_t max_age_ns;                  /* data older than this are stale, in nanoseconds */
} tickbus_config;

/* Where one station's frames lie within `in` and `out`. */
typedef struct tickbus_station {
    uint32_t size;       /* bytes of this struct */
    uint32_t in_offset;  /* its first byte within `in` */
    uint32_t in_size;    /* bytes that it sends; may be 0 */
    uint32_t out_offset; /* its first byte within `out` */
    uint32_t out_size;   /* bytes that it receives; may be 0 */
    const char *name;    /* its name; "" when the driver has just one */
} tickbus_station;

typedef struct tickbus_layout {
    uint32_t size;                          /* bytes of this struct */
    uint32_t in_size;                       /* bytes of `in`: the frames of all stations, gapless, in order */
    uint32_t out_size;                      /* bytes of `out`, likewise */
    uint32_t station_count;                 /* at least 1 */
    const tickbus_station *const *stations; /* pointers to station_count stations */
} tickbus_layout;

/* An open bus: whatever struct the library makes of it. */
typedef struct tickbus_bus tickbus_bus;

/* ---- The five functions that a library exports ------------------------------------------------ */

/* Returns TICKBUS_ABI_VERSION. Called first; must work without anything else having been called. */
TICKBUS_EXPORT uint32_t tickbus_abi_version(void);

/* Opens the bus: takes the card, binds the socket, starts to listen. Sets *bus to what the other
 * functions shall be given; it must not be NULL when TICKBUS_OK is returned.
 *
 * Need not wait for the peer: a tickbus_exchange that returns 0 says that none is there yet. What it does
 * wait for should take less than the driver.cfg's `open_timeout` (10 s unless stated).
 *
 * Returns TICKBUS_OK, or a TICKBUS_E_ code; then everything is released again, and *bus is ignored. */
TICKBUS_EXPORT int32_t tickbus_open(const tickbus_config *config, const tickbus_layout *layout,
                                    tickbus_bus **bus);

/* One bus cycle: sends the in_size bytes of `in`, receives into the out_size bytes of `out`.
 *
 * May wait for the peer, up to timeout_ms milliseconds in all; returns as soon as it has what it waits
 * for. A later return makes the host miss cycles (they are left out, not made up for); one that is later
 * by more than the driver.cfg's `call_timeout` is told to people as hung, and in a helper process
 * (`isolated = true`) it ends that process.
 *
 * `in` and `out` never overlap, are valid until this call returns, and may be at another place in the
 * next call. A size may be 0; the pointer is not NULL even then. What stands in `out` at first means
 * nothing. The host reads `out` only if TICKBUS_FRESH is returned, and checks that nothing was written
 * behind it.
 *
 * Returns a sum of TICKBUS_TAKEN, TICKBUS_FRESH, TICKBUS_ALIVE, or 0, or a TICKBUS_E_ code. */
TICKBUS_EXPORT int32_t tickbus_exchange(tickbus_bus *bus, const uint8_t *in, uint8_t *out,
                                        uint32_t timeout_ms);

/* Why the call before failed, for people: what happened, what was expected, what to do about it. In
 * UTF-8, one line, of up to 1000 bytes, without the library's name. `bus` is NULL after a failed
 * tickbus_open. The host copies the text before it makes another call. NULL or "" says nothing. */
TICKBUS_EXPORT const char *tickbus_last_error(tickbus_bus *bus);

/* Ends the bus and releases all that tickbus_open took; also after an error. Should return well within the
 * driver.cfg's `close_timeout` (2 s unless stated); the host waits no longer. A library in whose call the
 * host has given up waiting is never called again, and stays loaded until the process ends. */
TICKBUS_EXPORT void tickbus_close(tickbus_bus *bus);

#ifdef __cplusplus
}
#endif

#endif /* TICKBUS_FIELDBUS_H */
