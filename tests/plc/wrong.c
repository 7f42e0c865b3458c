/* Programs with something wrong with their table; MISTAKE says what. */
#include <stddef.h>

#include "tickbus_plc.h"

#define GOOD 0
#define VERSION 1
#define SIZE 2
#define ENTRY_SIZE 3
#define NO_SCAN 4
#define NO_LIST 5
#define NO_VALUE 6
#define NO_INDEX 7
#define TYPE 8
#define THREE_NUMBERS 9
#define OVERLAP 10
#define MARKERS_ONLY 11
#define NO_VARIABLES 12
#define UNDEFINED 13
#define WRONG_SIZE 14

#if MISTAKE != UNDEFINED
static void init(void) {}
#endif
static uint64_t none(void) { return 0; }
static void scan(int64_t seconds, int64_t nanoseconds, uint64_t tick)
{
    (void)seconds, (void)nanoseconds, (void)tick;
}

static uint8_t value[16];
static const uint32_t index[] = {0, 0, 0};

static const struct tickbus_located located[] = {
    {
        .type = MISTAKE == TYPE ? "TIME" : "BOOL",
        .area = MISTAKE == MARKERS_ONLY ? "M" : "Q",
        .size = MISTAKE == TYPE ? "D" : "X",
        .index = MISTAKE == NO_INDEX ? NULL : index,
        .value = MISTAKE == NO_VALUE ? NULL : value,
        .indices = MISTAKE == THREE_NUMBERS ? 3 : MISTAKE == TYPE ? 1 : 2,
        .bytes = MISTAKE == TYPE ? 16 : MISTAKE == WRONG_SIZE ? 2 : 1,
    },
    {
        .type = "BYTE",
        .area = "Q",
        .size = "B",
        .index = index,
        .value = value + 1,
        .indices = 1,
        .bytes = 1,
    },
};

#if MISTAKE == UNDEFINED
void nobody_has_this(void);
#define INIT nobody_has_this
#else
#define INIT init
#endif

const struct tickbus_plc tickbus_plc = {
    .version = MISTAKE == VERSION ? 7 : TICKBUS_PLC_VERSION,
    .bytes = sizeof(struct tickbus_plc) - (MISTAKE == SIZE),
    .located_bytes = sizeof(struct tickbus_located) + (MISTAKE == ENTRY_SIZE),
    .located_count = MISTAKE == NO_VARIABLES ? 0 : MISTAKE == OVERLAP ? 2 : 1,
    .located = MISTAKE == NO_LIST ? NULL : located,
    .init = INIT,
    .tick_time = none,
    .greatest_tick = none,
    .scan = MISTAKE == NO_SCAN ? NULL : scan,
};
