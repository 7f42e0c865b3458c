/* exchange FILE: exchanges through the door of C, as tickbus.bench.ByTurns makes them through that of Java; and a library's
 * function that does nothing, for ctypes. Prints lines for tools/bench-table. */
#include <stdio.h>
#include <stdlib.h>
#include <tickbus.h>
#include <time.h>

enum { ROUNDS = 15, CALLS = 500000 };

/* For the measurement in Python. */
int empty(void) { return 0; }

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + (double)time.tv_nsec / 1e9;
}

static int by_size(const void *one, const void *other) {
    double a = *(const double *)one, b = *(const double *)other;
    return (a > b) - (a < b);
}

int main(int count, char **arguments) {
    tb_driver plc;
    if (count != 2 || tb_open(arguments[1], NULL, &plc) < 0) {
        fprintf(stderr, "exchange: %s\n", tb_last_error());
        return 1;
    }
    tb_buffer *values = tb_buffer_of(plc);
    double rates[ROUNDS];
    int64_t time = 0;
    for (int round = 0; round < ROUNDS; round++) {
        double begin = now();
        for (int call = 0; call < CALLS; call++) {
            values->simulation_time = time += 1000000;
            if (tb_exchange(plc) < 0) return 1;
        }
        rates[round] = CALLS / (now() - begin);
    }
    qsort(rates, ROUNDS, sizeof rates[0], by_size);
    printf("rust doors.c %.0f\n", rates[ROUNDS / 2]);
    return tb_close(plc) < 0;
}
