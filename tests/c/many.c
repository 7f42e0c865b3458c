/* Ticks of many drivers in one call, and resets: values, statuses, and misuse. */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <tickbus.h>

enum { MANY = 100, MOST = 4096 };

static void expect(int line, int found, int expected) {
    if (found == expected) return;
    fprintf(stderr, "many.c:%d: %d, expected %d; the last error is: %s\n", line, found, expected, tb_last_error());
    exit(1);
}

#define EXPECT(found, expected) expect(__LINE__, (int)(found), expected)

static tb_driver drivers[MANY];

static void *ticks(void *failures) {
    int32_t statuses[MANY];
    for (int round = 0; round < 500; round++) {
        int failed = tb_exchange_many(drivers, MANY, NULL, statuses);
        for (int at = 0; at < MANY; at++) {
            if (statuses[at] < 0) EXPECT(statuses[at], TB_BUSY);
            failed -= statuses[at] < 0;
        }
        EXPECT(failed, 0);
        *(int *)failures += 1;
    }
    return NULL;
}

int main(int count, char **arguments) {
    if (count < 2) return 2;
    static int32_t statuses[MANY];
    static int64_t times[MANY];
    tb_signal level, valve;
    for (int at = 0; at < MANY; at++) EXPECT(tb_open(arguments[1], NULL, &drivers[at]), TB_FRESH);
    EXPECT(tb_find(drivers[0], "Level", &level), TB_FRESH);
    EXPECT(tb_find(drivers[0], "Valve", &valve), TB_FRESH);

    /* Each driver has its own time and its own values; the mirror switches the valve as it finds "Level low". */
    tb_signal low;
    EXPECT(tb_find(drivers[0], "Level low", &low), TB_FRESH);
    for (int tick = 0; tick < 3; tick++) {
        for (int at = 0; at < MANY; at++) {
            times[at] = tick * (10000000 + at);
            EXPECT(tb_set(tb_buffer_of(drivers[at]), &low, at % 3 == 0), TB_FRESH);
        }
        EXPECT(tb_exchange_many(drivers, MANY, times, statuses), 0);
    }
    for (int at = 0; at < MANY; at++) {
        tb_buffer *values = tb_buffer_of(drivers[at]);
        EXPECT(statuses[at], TB_FRESH);
        EXPECT(values->status, TB_FRESH);
        EXPECT(values->ticks, 3);
        EXPECT(values->simulation_time, 20000000 + 2 * at);
        EXPECT(tb_get_bool(values, &valve), at % 3 == 0);
    }
    EXPECT(tb_receive_many(drivers, MANY, NULL, statuses), 0);
    EXPECT(tb_send_many(drivers, MANY, statuses), 0);

    /* What fails stops no other one. */
    EXPECT(tb_close(drivers[7]), TB_FRESH);
    times[3] = 0;
    tb_driver twice = drivers[20];
    tb_driver real = drivers[21];
    drivers[21] = twice;
    tb_driver never = drivers[40];
    drivers[40] = 12345678;
    EXPECT(tb_exchange_many(drivers, MANY, times, statuses), 4);
    for (int at = 0; at < MANY; at++) {
        int wanted = at == 3 ? TB_BUS_FAILED : at == 7 ? TB_CLOSED : at == 21 ? TB_BAD_ARGUMENT : at == 40 ? TB_NOT_OPEN : 0;
        if (wanted < 0) EXPECT(statuses[at], wanted);
        else EXPECT(statuses[at] >= 0, 1);
    }
    EXPECT(tb_buffer_of(twice)->ticks, 5);
    EXPECT(strstr(tb_last_error(), "NOT_OPEN") != NULL, 1);
    EXPECT(tb_exchange_many(&drivers[20], 2, NULL, statuses), 1);
    EXPECT(strstr(tb_last_error(), "twice") != NULL, 1);
    drivers[21] = real;
    drivers[40] = never;

    /* Wrong lists. */
    static tb_driver crowd[MOST + 1];
    static int32_t answers[MOST + 1];
    EXPECT(tb_exchange_many(NULL, 0, NULL, NULL), 0);
    EXPECT(tb_exchange_many(NULL, 1, NULL, statuses), TB_BAD_ARGUMENT);
    EXPECT(strstr(tb_last_error(), "drivers is NULL") != NULL, 1);
    EXPECT(tb_receive_many(drivers, 1, NULL, NULL), TB_BAD_ARGUMENT);
    EXPECT(strstr(tb_last_error(), "statuses is NULL") != NULL, 1);
    EXPECT(tb_send_many(crowd, MOST + 1, answers), TB_BAD_ARGUMENT);
    EXPECT(strstr(tb_last_error(), "count is 4097; expected at most 4096") != NULL, 1);
    EXPECT(tb_send_many(crowd, MOST, answers), MOST);
    EXPECT(answers[MOST - 1], TB_NOT_OPEN);

    /* The next episode. */
    tb_buffer *values = tb_buffer_of(drivers[3]);
    EXPECT(tb_reset(drivers[3]), TB_FRESH);
    EXPECT(values->ticks, 0);
    EXPECT(values->simulation_time == TB_NO_TIME, 1);
    EXPECT(tb_get_bool(values, &valve), 0);
    EXPECT(tb_exchange_many(&drivers[3], 1, &times[3], statuses), 0);
    EXPECT(tb_reset(drivers[7]), TB_CLOSED);
    EXPECT(tb_reset(0), TB_NOT_OPEN);

    /* A bus in step with the simulation keeps its settings. */
    EXPECT(tb_reload(drivers[3]), TB_UNSUPPORTED);

    /* Two threads at once. */
    EXPECT(tb_open(arguments[1], NULL, &drivers[7]), TB_FRESH);
    pthread_t threads[2];
    int done[2] = {0, 0};
    for (int at = 0; at < 2; at++) EXPECT(pthread_create(&threads[at], NULL, ticks, &done[at]), 0);
    for (int at = 0; at < 2; at++) EXPECT(pthread_join(threads[at], NULL), 0);
    EXPECT(done[0] + done[1], 1000);
    puts("many: ok");
    return 0;
}
