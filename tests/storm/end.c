/* An end of a line of the storm, in C. See README.md in this folder for its arguments and for what it writes. */
#define _POSIX_C_SOURCE 200809L
#include <fcntl.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <tickbus.h>
#include <time.h>
#include <unistd.h>

enum { STATIONS = 4, STAMP = 0, PULSE, LEVEL, WHOLE, REAL, SIGNALS };

static const char *const NAMES[SIGNALS] = {"stamp", "pulse", "level", "whole", "real"};
static volatile sig_atomic_t is_over;

static void leave(int number) { is_over = number; }

static int64_t now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (int64_t)time.tv_sec * 1000000000 + time.tv_nsec;
}

static int fail(const char *what) {
    fprintf(stderr, "end: %s: %s\n", what, tb_last_error());
    return 1;
}

int main(int count, char **arguments) {
    if (count != 11) return 2;
    uint64_t life = strtoull(arguments[3], NULL, 10), area = arguments[4][0] == 'I';
    int stations = atoi(arguments[5]), pulse_every = atoi(arguments[7]), halves = atoi(arguments[8]);
    int64_t period = atoll(arguments[6]), pause_at = atoll(arguments[9]), pause = atoll(arguments[10]);
    struct sigaction action = {.sa_handler = leave};
    sigaction(SIGTERM, &action, NULL);
    int out = open(arguments[2], O_WRONLY | O_CREAT | O_APPEND, 0600);
    tb_driver plc;
    if (tb_open(arguments[1], NULL, &plc) < 0) return fail("open");
    tb_buffer *values = tb_buffer_of(plc);
    tb_signal written[STATIONS][SIGNALS], read[STATIONS][SIGNALS];
    for (int station = 0; station < stations; station++)
        for (int signal = 0; signal < SIGNALS; signal++)
            for (int side = 0; side < 2; side++) {
                char name[32];
                snprintf(name, sizeof name, "%s%c%d", NAMES[signal], "QI"[side], station);
                tb_signal *place = side == (int)area ? &written[station][signal] : &read[station][signal];
                if (tb_find(plc, name, place) < 0) return fail(name);
            }
    tb_turn turn = {0};
    for (uint64_t tick = 1; !is_over; tick++) {
        tb_every(period, &turn);
        int64_t began = now(), received = began;
        if (halves && tb_receive(plc) < 0) fail("receive");
        if (halves) received = now();
        for (int station = 0; station < stations; station++) {
            uint64_t stamp = life << 48 | area << 44 | (uint64_t)station << 40 | tick, mixed = stamp * UINT64_C(0x9E3779B97F4A7C15);
            const tb_signal *to = written[station];
            tb_slots(values)[to[STAMP].slot].natural = stamp;
            tb_set(values, &to[PULSE], tick % (uint64_t)pulse_every == 0);
            tb_set(values, &to[LEVEL], (double)(mixed >> 63));
            tb_set(values, &to[WHOLE], (int16_t)(mixed >> 32));
            tb_set(values, &to[REAL], (int16_t)(mixed >> 16) / 2.0);
        }
        if ((halves ? tb_send(plc) : tb_exchange(plc)) < 0) fail("tick");
        int64_t ended = now();
        char line[1024];
        size_t length = (size_t)snprintf(line, sizeof line, "%" PRIu64 " %" PRId64 " %" PRId64 " %" PRId64 " %d %" PRId64 " %" PRIu64, tick,
            began, halves ? received : ended, ended, (int)values->status, values->age, values->sequence);
        for (int station = 0; station < stations; station++) {
            const tb_signal *from = read[station];
            length += (size_t)snprintf(line + length, sizeof line - length, " %" PRIu64 " %d %u %g %g", tb_slots(values)[from[STAMP].slot].natural,
                tb_get_bool(values, &from[LEVEL]), tb_edges(values, &from[PULSE]), tb_get(values, &from[WHOLE]), tb_get(values, &from[REAL]));
        }
        line[length++] = '\n';
        if (write(out, line, length) < 0) return 3;
        if ((int64_t)tick == pause_at) nanosleep(&(struct timespec){pause / 1000000000, pause % 1000000000}, NULL);
    }
    return tb_close(plc) < 0 ? fail("close") : 0;
}
