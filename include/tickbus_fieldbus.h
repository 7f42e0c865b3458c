/* tickbus_fieldbus.h: the functions that a shared library exports to be a fieldbus of tickbus.
 *
 * A driver.cfg with
 *
 *     [fieldbus]
 *     kind    = "plugin"
 *     library = "libmybus.so"
 *     options = { card = 0, baud = "1500k" }
 *
 * makes the host (the process that loads tickbus, mostly a simulator) load the library and call the five
 * functions below. docs/plugin.md explains the steps; examples/udp-fieldbus is a complete library.
 *
 * ORDER AND THREAD. One thread, the driver's bus thread, makes all calls:
 *
 *     tickbus_abi_version                    once after loading
 *     tickbus_open                           once per attempt to open the line
 *       tickbus_exchange, again and again    once per bus cycle
 *     tickbus_close                          once for every tickbus_open that returned TICKBUS_OK
 *
 * The host calls tickbus_last_error directly after a failed call. When tickbus_exchange fails, the host
 * closes the bus (except after TICKBUS_E_LEFT), waits for the driver.cfg's `reconnect`, and opens it again;
 * the library stays loaded meanwhile. Two driver.cfg files can name the same library: two threads then
 * call it, each with its own tickbus_bus. Protect data that they share with a lock, or better, share none.
 *
 * THE PROCESS belongs to the simulator and is often a Java VM. The library must not install signal
 * handlers, change the locale, the working directory or the floating-point mode, or exit. No C++
 * exception may leave a function. Threads that tickbus_open starts must have ended when
 * tickbus_close returns, because the host may then unload the library.
 *
 * VERSIONS. TICKBUS_ABI_VERSION grows when a change breaks libraries built against an older header; the
 * host then refuses such a library and names both versions. Compatible additions go to the end of a
 * struct, and its first member, `size`, is the size of the host's struct: read a member that was added
 * later only if TICKBUS_HAS(pointer, member) holds. Do not walk arrays by the sizeof of these structs;
 * the arrays hold pointers for that reason. Only libraries return the flags and errors that a later
 * version adds; an older host reports such a value as an error, with its number.
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

/* The version of this interface, which tickbus_abi_version returns. */
#define TICKBUS_ABI_VERSION 1u

#if defined(_WIN32)
#define TICKBUS_EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define TICKBUS_EXPORT __attribute__((visibility("default")))
#else
#define TICKBUS_EXPORT
#endif

/* True if the host's struct at `pointer` is large enough to have `member`. */
#define TICKBUS_HAS(pointer, member) \
    ((pointer)->size >= (size_t)((const char *)(&(pointer)->member + 1) - (const char *)(pointer)))

/* ---- Return values of tickbus_open and tickbus_exchange --------------------------------------- */

/* tickbus_open: the bus is open. */
#define TICKBUS_OK 0

/* tickbus_exchange, 0 and above: the sum of the flags below. 0 means that nothing arrived from the peer
 * within the time-out. This is no error: the data grow older, and become stale after `max_age`. */

/* The peer has the bytes of `in` of this call, or will get exactly these bytes because the library keeps
 * them for it. Without this flag the host assumes that they are lost, and repeats the pulses in them until
 * a call returns the flag. A flag returned too early loses pulses; one never returned holds them forever. */
#define TICKBUS_TAKEN 1
/* `out` holds a new and complete image from the peer: all out_size bytes, of one moment. An image equal to
 * the previous one is new, too, if it has arrived since. */
#define TICKBUS_FRESH 2
/* The peer is alive. TICKBUS_TAKEN and TICKBUS_FRESH imply it. */
#define TICKBUS_ALIVE 4

/* Errors of tickbus_open and tickbus_exchange. After all but the last the host closes the bus and opens it
 * again after its back-off; they differ only in the message that the host logs. */

/* The link is down, or was never up: no card, no cable, peer unreachable. */
#define TICKBUS_E_LINK (-1)
/* The peer violated the protocol. */
#define TICKBUS_E_PROTOCOL (-2)
/* The peer understood the request and refused it. */
#define TICKBUS_E_REFUSED (-3)
/* The options in the driver.cfg are wrong; name in last_error the wrong option and a right value. */
#define TICKBUS_E_CONFIG (-4)
/* The library does not support this role, these sizes, or this number of stations. */
#define TICKBUS_E_UNSUPPORTED (-5)
/* tickbus_exchange only: the peer said goodbye and left. Only this error leaves the bus open: the host logs
 * it and continues to call tickbus_exchange until the next peer connects. */
#define TICKBUS_E_LEFT (-6)

/* ---- Arguments of tickbus_open ---------------------------------------------------------------- */

/* The host owns everything below, and it is valid until tickbus_open returns: copy what you need. Texts
 * are UTF-8, end with a 0 byte, and are never NULL. */

/* This end is the machine: it sends PLC inputs (%I) and receives PLC outputs (%Q). */
#define TICKBUS_ROLE_DEVICE 0u
/* This end is the PLC: it sends %Q and receives %I. */
#define TICKBUS_ROLE_CONTROLLER 1u

/* One entry of `options` in the driver.cfg. */
typedef struct tickbus_option {
    uint32_t size;     /* bytes of this struct */
    const char *key;   /* as written there */
    const char *value; /* a text unchanged; a number in digits; a boolean as "true" or "false" */
} tickbus_option;

typedef struct tickbus_config {
    uint32_t size;                        /* bytes of this struct */
    uint32_t role;                        /* TICKBUS_ROLE_DEVICE or TICKBUS_ROLE_CONTROLLER */
    const char *name;                     /* the driver's name, for messages */
    const char *directory;                /* of the driver.cfg; relative paths begin there */
    const tickbus_option *const *options; /* pointers to option_count options, sorted by key */
    uint32_t option_count;
    uint32_t timeout_ms;                  /* the argument of tickbus_exchange, at least 1 */
    uint64_t cycle_ns;                    /* the interval between calls of tickbus_exchange, in nanoseconds */
    uint64_t max_age_ns;                  /* data older than this are stale, in nanoseconds */
} tickbus_config;

/* The position of one station's frames within `in` and `out`. */
typedef struct tickbus_station {
    uint32_t size;       /* bytes of this struct */
    uint32_t in_offset;  /* the station's first byte within `in` */
    uint32_t in_size;    /* bytes that the station sends; can be 0 */
    uint32_t out_offset; /* the station's first byte within `out` */
    uint32_t out_size;   /* bytes that the station receives; can be 0 */
    const char *name;    /* "" if the driver has only one station */
} tickbus_station;

typedef struct tickbus_layout {
    uint32_t size;                          /* bytes of this struct */
    uint32_t in_size;                       /* bytes of `in`: the frames of all stations, gapless, in order */
    uint32_t out_size;                      /* bytes of `out`, likewise */
    uint32_t station_count;                 /* at least 1 */
    const tickbus_station *const *stations; /* pointers to station_count stations */
} tickbus_layout;

/* An open bus. The library defines this struct; the host only passes the pointer. */
typedef struct tickbus_bus tickbus_bus;

/* ---- The five functions that a library exports ------------------------------------------------ */

/* Returns TICKBUS_ABI_VERSION. Called before any other function. */
TICKBUS_EXPORT uint32_t tickbus_abi_version(void);

/* Opens the bus: takes the card, binds the socket, starts to listen. Sets *bus to the pointer that the
 * host passes to the other functions; it must not be NULL if the return value is TICKBUS_OK.
 *
 * Need not wait for the peer: while no peer is there, tickbus_exchange returns 0. Should return within the
 * driver.cfg's `open_timeout` (10 s by default).
 *
 * Returns TICKBUS_OK, or a TICKBUS_E_ code. Before it returns an error it must release everything that it
 * took; the host then ignores *bus. */
TICKBUS_EXPORT int32_t tickbus_open(const tickbus_config *config, const tickbus_layout *layout,
                                    tickbus_bus **bus);

/* One bus cycle: sends the in_size bytes of `in`, receives into the out_size bytes of `out`.
 *
 * May wait for the peer, up to timeout_ms milliseconds in all; should return as soon as the data are there.
 * A later return makes the host miss cycles, which it skips. If the call is late by more than the
 * driver.cfg's `call_timeout`, the host reports it as hung, and ends the helper process if the library runs
 * in one (`isolated = true`).
 *
 * `in` and `out` never overlap, are valid until this call returns, and can have other addresses in the
 * next call. A size can be 0; the pointer is not NULL even then. The initial contents of `out` are
 * undefined. The host reads `out` only if the return value has TICKBUS_FRESH, and checks that nothing was
 * written past its end.
 *
 * Returns a sum of TICKBUS_TAKEN, TICKBUS_FRESH, TICKBUS_ALIVE, or 0, or a TICKBUS_E_ code. */
TICKBUS_EXPORT int32_t tickbus_exchange(tickbus_bus *bus, const uint8_t *in, uint8_t *out,
                                        uint32_t timeout_ms);

/* Why the previous call failed, for the log: what happened, what was expected, how to repair it. One line
 * of UTF-8, up to 1000 bytes, without the library's name. `bus` is NULL after a failed tickbus_open. The
 * host copies the text before its next call. Return NULL or "" if there is nothing to say. */
TICKBUS_EXPORT const char *tickbus_last_error(tickbus_bus *bus);

/* Closes the bus and releases everything that tickbus_open took; also called after an error. Should return
 * well within the driver.cfg's `close_timeout` (2 s by default); the host waits no longer. After a call
 * that did not return in time, the host never calls the library again and keeps it loaded until the
 * process ends. */
TICKBUS_EXPORT void tickbus_close(tickbus_bus *bus);

#ifdef __cplusplus
}
#endif

#endif /* TICKBUS_FIELDBUS_H */
