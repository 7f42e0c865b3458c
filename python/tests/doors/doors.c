/* doors FILE TABLES TICKS: the run of test_doors.py, in C. */
#include <stdio.h>
#include <stdlib.h>
#include <tickbus.h>

enum { MOST = 256 };

static tb_signal signals[MOST];

static int check(int status) {
    if (status < 0) {
        fprintf(stderr, "doors: %s\n", tb_last_error());
        exit(1);
    }
    return status;
}

int main(int count, char **arguments) {
    tb_driver plc;
    if (count != 4) return 2;
    check(tb_open(arguments[1], arguments[2], &plc));
    tb_buffer *values = tb_buffer_of(plc);
    int size = check(tb_signal_count(plc));
    if (size > MOST) return 3;
    for (int i = 0; i < size; i++) check(tb_signal_at(plc, i, &signals[i]));
    uint64_t seed = 1;
    for (int tick = 1; tick <= atoi(arguments[3]); tick++) {
        values->simulation_time = tick * INT64_C(2000000);
        if (tick % 2) check(tb_receive(plc));
        for (int i = 0; i < size; i++) {
            if (!signals[i].is_written) continue;
            seed = seed * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
            if (seed >> 58) continue;
            tb_slot *slot = tb_slots(values) + signals[i].slot;
            if (signals[i].kind != TB_REAL) slot->natural = seed;
            else if (signals[i].type[0] == 'B' && signals[i].type[1] == 'O') slot->real = (double)(seed >> 40 & 1);
            else slot->real = (double)(seed >> 20 & 0xFFFFFF) / 16 - 1000;
        }
        check(tick % 2 ? tb_send(plc) : tb_exchange(plc));
    }
    return check(tb_close(plc));
}
