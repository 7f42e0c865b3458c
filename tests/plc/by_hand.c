/* A program with the C interface that iec2c gives its own, written by hand: what tickbus needs of it can be
 * tested where there is no iec2c.
 *
 *     lamp AT %QX0.0 := TON(IN := %IX0.0, PT := T#500ms)
 *     %QX0.7 := %IX9.0
 *     %QB1   := the scan's number
 *     %QW1   := %IW1 + 1
 *     %QD1   := %ID1 * 0.5
 *     %QL1   := the time in ns, or the marker %MW0, which counts scans, while %IX0.0 is on
 *
 * With LOOP it comes back from no scan but the first.
 */
#include <stdint.h>
#ifdef LOOP
#include <unistd.h>
#endif

typedef struct {
    long int tv_sec;
    long int tv_nsec;
} time_type;

extern time_type __CURRENT_TIME;
extern uint8_t __DEBUG;

extern uint8_t *__IX0_0, *__IX9_0, *__QX0_0, *__QX0_7, *__QB1;
extern int16_t *__IW1, *__QW1;
extern uint16_t *__MW0;
extern float *__ID1, *__QD1;
extern int64_t *__QL1;

#ifndef TICK_TIME
#define TICK_TIME 20000000ULL
#endif
unsigned long long common_ticktime__ = TICK_TIME * 1ULL;
unsigned long greatest_tick_count__ = 6UL;

static int64_t now, started;
static int running;

void config_init__(void)
{
    *__MW0 = 100;
    *__QX0_7 = 1;
    running = __DEBUG;
}

void config_run__(unsigned long tick)
{
#ifdef LOOP
    volatile int looping = tick > 0;
    while (looping) {
        /* Without the processor, of which other tests are to have some. */
        pause();
    }
#endif
    now = (int64_t)__CURRENT_TIME.tv_sec * 1000000000 + __CURRENT_TIME.tv_nsec;
    if (!*__IX0_0) {
        running = 0;
        *__QX0_0 = 0;
    } else if (!running) {
        running = 1;
        started = now;
    } else if (now >= started + 500000000) {
        *__QX0_0 = 1;
    }
    *__MW0 += 1;
    *__QX0_7 = *__IX9_0;
    *__QB1 = (uint8_t)tick;
    *__QW1 = (int16_t)(*__IW1 + 1);
    *__QD1 = *__ID1 * 0.5f;
    *__QL1 = *__IX0_0 ? *__MW0 : now;
}
