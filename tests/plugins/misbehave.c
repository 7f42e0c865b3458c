/* misbehave.c: a plug-in that does what its options say, for the tests.
 *
 * The plug-in is an echo: `out` is `in`, as far as both reach. The rest is misbehaviour:
 *
 *   open, exchange, close = WHAT    what that function does instead; see misbehave()
 *   good    = N       the first N exchanges are good
 *   once    = PATH    misbehaves only if it can make this file, so once
 *   text    = WHAT    last_error: "null", "empty", "invalid" (no UTF-8), "lines", "long", or itself
 *   release = PATH    a hung call returns when this file is there
 *   ms      = N       how long a slow call takes
 *   bytes   = N       how far behind `out` is written
 *
 * -DVERSION=N makes it lie about the version, -DWITHOUT_EXCHANGE and -DUNRESOLVED break it for the loader.
 */
#define _POSIX_C_SOURCE 200809L

#include "tickbus_fieldbus.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#ifndef VERSION
#define VERSION TICKBUS_ABI_VERSION
#endif

struct tickbus_bus {
    size_t in_size, out_size;
    int good;
    char what[3][40], text[200], once[500], release[500];
    int ms, bytes;
};

enum { OPEN, EXCHANGE, CLOSE };
enum { GOOD = 1000, NO_BUS };

static __thread struct tickbus_bus last;
static volatile char *volatile nowhere;

#ifdef UNRESOLVED
void nobody_has_this(void);
#endif

static void pause_ms(int ms) {
    struct timespec span = {ms / 1000, ms % 1000 * 1000000L};
    nanosleep(&span, NULL);
}

/* What a function answers instead; GOOD if it shall go on as usual. */
static int32_t misbehave(struct tickbus_bus *bus, int function) {
    static const struct { const char *name; int32_t code; } codes[] = {
        {"link", TICKBUS_E_LINK}, {"protocol", TICKBUS_E_PROTOCOL}, {"refused", TICKBUS_E_REFUSED},
        {"config", TICKBUS_E_CONFIG}, {"unsupported", TICKBUS_E_UNSUPPORTED}, {"left", TICKBUS_E_LEFT},
        {"64", 64}, {"-77", -77}, {"silent", 0}, {"alive", TICKBUS_ALIVE},
    };
    const char *what = bus->what[function];
    size_t i;
    if (what[0] == 0)
        return GOOD;
    if (bus->once[0]) {
        int made = open(bus->once, O_CREAT | O_EXCL | O_WRONLY, 0600);
        if (made < 0)
            return GOOD;
        close(made);
    }
    for (i = 0; i < sizeof codes / sizeof *codes; i++)
        if (strcmp(what, codes[i].name) == 0)
            return codes[i].code;
    if (strcmp(what, "no-bus") == 0)
        return NO_BUS;
    if (strcmp(what, "slow") == 0)
        pause_ms(bus->ms);
    else if (strcmp(what, "hang") == 0)
        while (!bus->release[0] || access(bus->release, F_OK) != 0)
            pause_ms(5);
    else if (strcmp(what, "crash") == 0)
        *nowhere = 1;
    else if (strcmp(what, "abort") == 0)
        abort();
    else if (strcmp(what, "exit") == 0)
        _exit(3);
    else if (strcmp(what, "print") == 0)
        printf("the plug-in prints\n"), fflush(stdout);
    else if (strcmp(what, "stdin") == 0)
        (void)!read(0, bus->text, 1);
    return GOOD;
}

uint32_t tickbus_abi_version(void) {
    return VERSION;
}

int32_t tickbus_open(const tickbus_config *config, const tickbus_layout *layout, tickbus_bus **bus) {
    uint32_t i;
    int32_t code;
#ifdef UNRESOLVED
    nobody_has_this();
#endif
    memset(&last, 0, sizeof last);
    last.in_size = layout->in_size;
    last.out_size = layout->out_size;
    for (i = 0; i < config->option_count; i++) {
        const char *key = config->options[i]->key, *value = config->options[i]->value;
        if (strcmp(key, "open") == 0)
            snprintf(last.what[OPEN], sizeof last.what[OPEN], "%s", value);
        if (strcmp(key, "exchange") == 0)
            snprintf(last.what[EXCHANGE], sizeof last.what[EXCHANGE], "%s", value);
        if (strcmp(key, "close") == 0)
            snprintf(last.what[CLOSE], sizeof last.what[CLOSE], "%s", value);
        if (strcmp(key, "text") == 0)
            snprintf(last.text, sizeof last.text, "%s", value);
        if (strcmp(key, "once") == 0)
            snprintf(last.once, sizeof last.once, "%s", value);
        if (strcmp(key, "release") == 0)
            snprintf(last.release, sizeof last.release, "%s", value);
        if (strcmp(key, "good") == 0)
            last.good = atoi(value);
        if (strcmp(key, "ms") == 0)
            last.ms = atoi(value);
        if (strcmp(key, "bytes") == 0)
            last.bytes = atoi(value);
        if (strcmp(key, "tell") == 0) {
            /* What it was given, as the error's text. */
            const tickbus_station *station = layout->stations[layout->station_count - 1];
            snprintf(last.text, sizeof last.text, "%s %s role %u, %u ms, %llu ns, %u stations, %s: %u+%u %u+%u of %u %u",
                     config->name, value, config->role, config->timeout_ms, (unsigned long long)config->cycle_ns,
                     layout->station_count, station->name, station->in_offset, station->in_size,
                     station->out_offset, station->out_size, layout->in_size, layout->out_size);
            return TICKBUS_E_CONFIG;
        }
    }
    code = misbehave(&last, OPEN);
    if (code == NO_BUS)
        return TICKBUS_OK;
    if (code != GOOD)
        return code;
    *bus = malloc(sizeof **bus);
    **bus = last;
    return TICKBUS_OK;
}

#ifndef WITHOUT_EXCHANGE
int32_t tickbus_exchange(tickbus_bus *bus, const uint8_t *in, uint8_t *out, uint32_t timeout_ms) {
    size_t common = bus->in_size < bus->out_size ? bus->in_size : bus->out_size;
    (void)timeout_ms;
    if (bus->good > 0) {
        bus->good--;
    } else {
        int32_t code = misbehave(bus, EXCHANGE);
        if (code != GOOD)
            return code;
        if (strcmp(bus->what[EXCHANGE], "beyond") == 0)
            memset(out + bus->out_size, 0xFF, (size_t)bus->bytes);
    }
    memcpy(out, in, common);
    memset(out + common, 0, bus->out_size - common);
    return TICKBUS_TAKEN | TICKBUS_FRESH | TICKBUS_ALIVE;
}
#endif

const char *tickbus_last_error(tickbus_bus *bus) {
    static __thread char longest[5000];
    const char *text = bus == NULL ? last.text : bus->text;
    if (strcmp(text, "null") == 0)
        return NULL;
    if (strcmp(text, "empty") == 0)
        return "";
    if (strcmp(text, "invalid") == 0)
        return "caf\xE9 \xFF\xFE card 3";
    if (strcmp(text, "lines") == 0)
        return "first\r\n\tsecond\x1B[31m third\n";
    if (strcmp(text, "long") == 0)
        return memset(longest, 'x', sizeof longest - 1);
    return text;
}

void tickbus_close(tickbus_bus *bus) {
    misbehave(bus, CLOSE);
    free(bus);
}
