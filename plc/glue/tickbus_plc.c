/* Makes a program that iec2c has compiled to C loadable by tickbus.
 *
 * Compile it together with the C files that iec2c wrote, in the folder of their LOCATED_VARIABLES.h:
 *
 *     cc -shared -fPIC -I . -I <the C folder of iec2c's library> config.c resource1.c tickbus_plc.c -o program.so
 *
 * It includes none of iec2c's headers: the few types that matter are repeated below, as iec2c has them.
 *
 * SPDX-License-Identifier: MIT OR Apache-2.0
 */
#include "tickbus_plc.h"

/* Exported by iec2c. */
void config_init__(void);
void config_run__(unsigned long tick);
extern unsigned long long common_ticktime__;
extern unsigned long greatest_tick_count__;

/* Expected by iec2c from its host: the time, which is all that its timers ever read, and a switch. */
typedef struct {
    long int tv_sec;
    long int tv_nsec;
} tickbus_time;

tickbus_time __CURRENT_TIME;
uint8_t __DEBUG;

/* The number of the scan, which the hosts of Beremiz and OpenPLC have: blocks of OSCAT read their clock by it. */
unsigned long __tick;

/* The types of located variables, as iec2c has them. */
typedef uint8_t tickbus_BOOL;
typedef int8_t tickbus_SINT;
typedef int16_t tickbus_INT;
typedef int32_t tickbus_DINT;
typedef int64_t tickbus_LINT;
typedef uint8_t tickbus_USINT;
typedef uint16_t tickbus_UINT;
typedef uint32_t tickbus_UDINT;
typedef uint64_t tickbus_ULINT;
typedef uint8_t tickbus_BYTE;
typedef uint16_t tickbus_WORD;
typedef uint32_t tickbus_DWORD;
typedef uint64_t tickbus_LWORD;
typedef float tickbus_REAL;
typedef double tickbus_LREAL;
/* These types have no place in a process image. They compile, so that tickbus can report them by name. */
typedef tickbus_time tickbus_TIME;
typedef tickbus_time tickbus_DATE;
typedef tickbus_time tickbus_TOD;
typedef tickbus_time tickbus_DT;
typedef struct {
    uint8_t len;
    uint8_t body[126];
} tickbus_STRING;

/* Two programs of one project can name the same address, which is then in the list twice. Definitions
 * without a value may be repeated, so each variable is defined that way, and its pointer is set later. */
#define __LOCATED_VAR(type, name, ...) \
    static tickbus_##type value##name; \
    tickbus_##type *name;
#include "LOCATED_VARIABLES.h"
#undef __LOCATED_VAR

#define TICKBUS_COUNT(...) (sizeof((const uint32_t[]){__VA_ARGS__}) / sizeof(uint32_t))
#define __LOCATED_VAR(type, name, area, size, ...) \
    {#type, #area, #size, (const uint32_t[]){__VA_ARGS__}, &value##name, TICKBUS_COUNT(__VA_ARGS__), \
     sizeof(tickbus_##type)},
static const struct tickbus_located located[] = {
#include "LOCATED_VARIABLES.h"
    {0} /* an array in C cannot be empty */
};
#undef __LOCATED_VAR

static void init(void)
{
#define __LOCATED_VAR(type, name, ...) name = &value##name;
#include "LOCATED_VARIABLES.h"
#undef __LOCATED_VAR
    config_init__();
}

static uint64_t tick_time(void)
{
    return common_ticktime__;
}

static uint64_t greatest_tick(void)
{
    return greatest_tick_count__;
}

static void scan(int64_t seconds, int64_t nanoseconds, uint64_t tick)
{
    __CURRENT_TIME.tv_sec = (long int)seconds;
    __CURRENT_TIME.tv_nsec = (long int)nanoseconds;
    __tick = (unsigned long)tick;
    config_run__(__tick);
}

const struct tickbus_plc tickbus_plc = {
    .version = TICKBUS_PLC_VERSION,
    .bytes = sizeof(struct tickbus_plc),
    .located_bytes = sizeof(struct tickbus_located),
    .located_count = sizeof(located) / sizeof(located[0]) - 1,
    .located = located,
    .init = init,
    .tick_time = tick_time,
    .greatest_tick = greatest_tick,
    .scan = scan,
};
