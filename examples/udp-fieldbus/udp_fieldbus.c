/* udp_fieldbus.c: a fieldbus for tickbus in UDP datagrams, as a plug-in. C99 and POSIX sockets.
 *
 * The controller asks, the device answers; each datagram carries one whole process image:
 *
 *     "TBU1" | kind | session | sequence | acknowledged | image        four words, big-endian
 *
 * kind 1 asks, kind 2 answers with the session and sequence of the request, and kind 3, which has no image,
 * says good-bye. UDP loses datagrams, so both ends have to know what has arrived (TICKBUS_TAKEN):
 *
 *   - The controller knows that its image was taken when the answer to its own request comes.
 *   - The device learns it from `acknowledged`, the sequence of the newest answer that the controller
 *     has. Until that covers the image it answered with, it keeps answering with the very same bytes.
 *
 * Options: local  = "ADDRESS:PORT"  where to listen; the device needs it
 *          remote = "ADDRESS:PORT"  where the other end listens; the controller needs it, a device that
 *                                   has it answers nobody else
 *
 * Build: cc -std=c99 -O2 -Wall -Wextra -fPIC -shared -I ../../include -o libudp_fieldbus.so udp_fieldbus.c
 */
#define _POSIX_C_SOURCE 200809L

#include "tickbus_fieldbus.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

enum { REQUEST = 1, ANSWER = 2, BYE = 3, WORDS = 5, HEADER = 4 * WORDS, MOST = 65507 };

#define MAGIC 0x54425531u /* "TBU1" */

struct tickbus_bus {
    int socket;
    int connected; /* the socket has the one peer that `remote` names */
    uint32_t role;
    uint32_t in_size;
    uint32_t out_size;
    /* The session of the requests: the controller's own, or that of the controller last heard. */
    uint32_t session;
    /* The newest request: sent by the controller, or received by the device. 0 before the first. */
    uint32_t sequence;
    /* Controller: the newest answer that came. Device: the request that first got the current image. */
    uint32_t settled;
    struct sockaddr_in peer; /* the controller last heard, for a device */
    uint8_t *sending;   /* header and image */
    uint8_t *receiving; /* as much as a datagram may have */
    char error[300];
};

/* A failed tickbus_open has no tickbus_bus, so the text is per thread, as each driver has its own thread. */
static __thread char open_error[300];

static int32_t fail(char error[300], int32_t code, const char *format, ...) {
    va_list values;
    va_start(values, format);
    vsnprintf(error, 300, format, values);
    va_end(values);
    return code;
}

static uint64_t now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

static void put_word(uint8_t *datagram, int index, uint32_t value) {
    value = htonl(value);
    memcpy(datagram + 4 * index, &value, 4);
}

static uint32_t word(const uint8_t *datagram, int index) {
    uint32_t value;
    memcpy(&value, datagram + 4 * index, 4);
    return ntohl(value);
}

/* True if sequence a is newer than b; sequences wrap. */
static int newer(uint32_t a, uint32_t b) {
    return (int32_t)(a - b) > 0;
}

/* ---- Opening ---------------------------------------------------------------------------------- */

/* Splits "ADDRESS:PORT" and looks it up; NULL after having set the error. */
static struct addrinfo *resolve(const char *key, const char *text, int32_t *code) {
    char host[256];
    const char *colon = strrchr(text, ':');
    struct addrinfo hints = {0}, *found = NULL;
    int failed;

    if (colon == NULL || colon[1] == 0 || (size_t)(colon - text) >= sizeof host) {
        *code = fail(open_error, TICKBUS_E_CONFIG,
                     "the option %s is \"%s\"; write an address and a port, such as \"127.0.0.1:20040\"",
                     key, text);
        return NULL;
    }
    memcpy(host, text, (size_t)(colon - text));
    host[colon - text] = 0;
    hints.ai_family = AF_INET;
    hints.ai_socktype = SOCK_DGRAM;
    failed = getaddrinfo(host, colon + 1, &hints, &found);
    if (failed) {
        *code = fail(open_error, TICKBUS_E_LINK, "the option %s is \"%s\", which cannot be looked up: %s; "
                     "write a numeric address, or check the name", key, text, gai_strerror(failed));
        return NULL;
    }
    return found;
}

/* Binds (local) or connects (remote) the socket, if the driver.cfg has the option. */
static int32_t attach(int fd, const char *key, const char *text,
                      int (*how)(int, const struct sockaddr *, socklen_t), const char *advice) {
    int32_t code = TICKBUS_OK;
    struct addrinfo *address = resolve(key, text, &code);
    if (address == NULL)
        return code;
    if (how(fd, address->ai_addr, address->ai_addrlen) != 0)
        code = fail(open_error, TICKBUS_E_LINK, "%s \"%s\": %s; %s", key, text, strerror(errno), advice);
    freeaddrinfo(address);
    return code;
}

uint32_t tickbus_abi_version(void) {
    return TICKBUS_ABI_VERSION;
}

int32_t tickbus_open(const tickbus_config *config, const tickbus_layout *layout, tickbus_bus **result) {
    const char *local = NULL, *remote = NULL;
    uint32_t controller = config->role == TICKBUS_ROLE_CONTROLLER;
    uint32_t i, largest = layout->in_size > layout->out_size ? layout->in_size : layout->out_size;
    tickbus_bus *bus;
    int32_t code = TICKBUS_OK;

    for (i = 0; i < config->option_count; i++) {
        const tickbus_option *option = config->options[i];
        if (strcmp(option->key, "local") == 0)
            local = option->value;
        else if (strcmp(option->key, "remote") == 0)
            remote = option->value;
        else
            return fail(open_error, TICKBUS_E_CONFIG, "unknown option \"%s\"; the options are local and remote",
                        option->key);
    }
    if (controller && remote == NULL)
        return fail(open_error, TICKBUS_E_CONFIG,
                    "no option remote; add options = { remote = \"127.0.0.1:20040\" }, where the device listens");
    if (!controller && local == NULL)
        return fail(open_error, TICKBUS_E_CONFIG,
                    "no option local; add options = { local = \"127.0.0.1:20040\" }, where to listen");
    if (largest > MOST - HEADER)
        return fail(open_error, TICKBUS_E_UNSUPPORTED,
                    "an image of %lu bytes does not fit into a datagram, which takes %d; use fewer signals",
                    (unsigned long)largest, MOST - HEADER);

    bus = calloc(1, sizeof *bus);
    if (bus == NULL)
        return fail(open_error, TICKBUS_E_LINK, "out of memory");
    bus->role = config->role;
    bus->in_size = layout->in_size;
    bus->out_size = layout->out_size;
    bus->session = (uint32_t)(now_ns() ^ ((uint64_t)getpid() << 20));
    bus->sending = calloc(1, HEADER + (size_t)layout->in_size);
    bus->receiving = malloc(MOST);
    bus->socket = socket(AF_INET, SOCK_DGRAM, 0);
    if (bus->sending == NULL || bus->receiving == NULL)
        code = fail(open_error, TICKBUS_E_LINK, "out of memory");
    else if (bus->socket < 0 || fcntl(bus->socket, F_SETFL, O_NONBLOCK) != 0
             || fcntl(bus->socket, F_SETFD, FD_CLOEXEC) != 0)
        code = fail(open_error, TICKBUS_E_LINK, "no socket: %s", strerror(errno));
    if (code == TICKBUS_OK && local != NULL)
        code = attach(bus->socket, "local", local, bind,
                      "choose an address of this computer and a port that no other program has");
    if (code == TICKBUS_OK && remote != NULL)
        code = attach(bus->socket, "remote", remote, connect,
                      "choose an address that this computer has a way to");
    if (code != TICKBUS_OK) {
        tickbus_close(bus);
        return code;
    }
    bus->connected = remote != NULL;
    put_word(bus->sending, 0, MAGIC);
    *result = bus;
    return TICKBUS_OK;
}

/* ---- Exchanging ------------------------------------------------------------------------------- */

/* Results of receive besides the TICKBUS_E_ codes. */
enum { NOTHING = 0, DATAGRAM = 1 };

/* Takes the next datagram of the right kind, or the peer's good-bye. `from` gets the sender. */
static int32_t receive(tickbus_bus *bus, uint32_t kind, struct sockaddr_in *from) {
    for (;;) {
        socklen_t length = sizeof *from;
        ssize_t got = recvfrom(bus->socket, bus->receiving, MOST, 0, (struct sockaddr *)from, &length);
        if (got < 0) {
            /* Refused: nobody listens there yet, as a returned datagram shows. */
            if (errno == EINTR || errno == ECONNREFUSED)
                continue;
            if (errno == EAGAIN || errno == EWOULDBLOCK)
                return NOTHING;
            return fail(bus->error, TICKBUS_E_LINK, "the socket cannot be read: %s", strerror(errno));
        }
        /* Anybody may send to a UDP port; datagrams of other protocols are ignored. */
        if (got < HEADER || word(bus->receiving, 0) != MAGIC)
            continue;
        if (word(bus->receiving, 1) == BYE && word(bus->receiving, 2) == bus->session && bus->sequence != 0) {
            bus->sequence = bus->settled = 0;
            return fail(bus->error, TICKBUS_E_LEFT, "the other end at %s has closed",
                        inet_ntoa(from->sin_addr));
        }
        if (word(bus->receiving, 1) != kind)
            continue;
        if ((uint32_t)got - HEADER != bus->out_size)
            return fail(bus->error, TICKBUS_E_PROTOCOL,
                        "an image of %ld bytes came from %s, expected %lu bytes; give both ends the same signals",
                        (long)got - HEADER, inet_ntoa(from->sin_addr), (unsigned long)bus->out_size);
        return DATAGRAM;
    }
}

/* Waits until a datagram is there or until `deadline`; returns 0 at the deadline. */
static int wait_readable(tickbus_bus *bus, uint64_t deadline) {
    uint64_t now = now_ns();
    struct pollfd wanted = {bus->socket, POLLIN, 0};
    if (now >= deadline)
        return 0;
    poll(&wanted, 1, (int)((deadline - now + 999999) / 1000000));
    return 1;
}

static void send_datagram(tickbus_bus *bus, size_t image) {
    /* A datagram that cannot be sent counts as lost: the next cycle sends again. */
    if (bus->connected)
        (void)!send(bus->socket, bus->sending, HEADER + image, 0);
    else
        (void)!sendto(bus->socket, bus->sending, HEADER + image, 0, (const struct sockaddr *)&bus->peer,
                      sizeof bus->peer);
}

/* Asks, and waits for the answer. Also delivers answers to earlier requests, each replaced by a newer
 * one, since the newest image counts. */
static int32_t ask(tickbus_bus *bus, const uint8_t *in, uint8_t *out, uint64_t deadline) {
    struct sockaddr_in from;
    int32_t flags = 0;
    if (++bus->sequence == 0)
        bus->sequence = 1;
    put_word(bus->sending, 1, REQUEST);
    put_word(bus->sending, 2, bus->session);
    put_word(bus->sending, 3, bus->sequence);
    put_word(bus->sending, 4, bus->settled);
    memcpy(bus->sending + HEADER, in, bus->in_size);
    send_datagram(bus, bus->in_size);
    do {
        int32_t got;
        while ((got = receive(bus, ANSWER, &from)) == DATAGRAM) {
            uint32_t sequence = word(bus->receiving, 3);
            if (word(bus->receiving, 2) != bus->session || newer(sequence, bus->sequence)
                || (bus->settled != 0 && !newer(sequence, bus->settled)))
                continue; /* for somebody before us, or a datagram that the network doubled or delayed */
            bus->settled = sequence;
            memcpy(out, bus->receiving + HEADER, bus->out_size);
            flags = TICKBUS_FRESH | TICKBUS_ALIVE;
            if (sequence == bus->sequence)
                return flags | TICKBUS_TAKEN;
        }
        if (got < 0)
            return got;
    } while (wait_readable(bus, deadline));
    return flags;
}

/* Waits for a request and answers it; if several wait, the newest. */
static int32_t answer(tickbus_bus *bus, const uint8_t *in, uint8_t *out, uint64_t deadline) {
    struct sockaddr_in from;
    int32_t flags = 0;
    uint32_t acknowledged = 0;
    do {
        int32_t got;
        while ((got = receive(bus, REQUEST, &from)) == DATAGRAM) {
            uint32_t session = word(bus->receiving, 2), sequence = word(bus->receiving, 3);
            if (session != bus->session) {
                bus->session = session; /* another controller, or the same one started again */
                bus->settled = 0;
            } else if (bus->sequence != 0 && !newer(sequence, bus->sequence)) {
                continue;
            }
            bus->sequence = sequence;
            acknowledged = word(bus->receiving, 4);
            bus->peer = from;
            memcpy(out, bus->receiving + HEADER, bus->out_size);
            flags = TICKBUS_FRESH | TICKBUS_ALIVE;
        }
        if (got < 0)
            return got;
    } while (flags == 0 && wait_readable(bus, deadline));
    if (flags == 0)
        return 0;
    if (bus->settled == 0 || acknowledged == 0 || !newer(bus->settled, acknowledged)) {
        memcpy(bus->sending + HEADER, in, bus->in_size);
        bus->settled = bus->sequence;
        flags |= TICKBUS_TAKEN;
    }
    put_word(bus->sending, 1, ANSWER);
    put_word(bus->sending, 2, bus->session);
    put_word(bus->sending, 3, bus->sequence);
    send_datagram(bus, bus->in_size);
    return flags;
}

int32_t tickbus_exchange(tickbus_bus *bus, const uint8_t *in, uint8_t *out, uint32_t timeout_ms) {
    uint64_t deadline = now_ns() + (uint64_t)timeout_ms * 1000000u;
    return bus->role == TICKBUS_ROLE_CONTROLLER ? ask(bus, in, out, deadline) : answer(bus, in, out, deadline);
}

const char *tickbus_last_error(tickbus_bus *bus) {
    return bus == NULL ? open_error : bus->error;
}

void tickbus_close(tickbus_bus *bus) {
    if (bus->sequence != 0) {
        put_word(bus->sending, 1, BYE);
        put_word(bus->sending, 2, bus->session);
        send_datagram(bus, 0);
    }
    if (bus->socket >= 0)
        close(bus->socket);
    free(bus->sending);
    free(bus->receiving);
    free(bus);
}
