/* A tank in C on a PLC's fieldbus: README.md's tank.cfg and machine. docs/c-api.md explains how to build it. */
#include <stdio.h>
#include <tickbus.h>

static int check(int status) {
    if (status < 0) fprintf(stderr, "tank: %s\n", tb_last_error());
    return status;
}

int main(int count, char **arguments) {
    tb_driver plc;
    tb_signal valve, low, level;
    if (check(tb_open(count > 1 ? arguments[1] : "tank.cfg", NULL, &plc)) < 0) return 1;
    if (check(tb_find(plc, "Valve", &valve)) < 0 || check(tb_find(plc, "Level low", &low)) < 0 ||
        check(tb_find(plc, "Level", &level)) < 0)
        return 1;

    tb_buffer *values = tb_buffer_of(plc);
    double mm = 100;
    for (int tick = 0; tick < 500; tick++) {
        values->simulation_time = tick * INT64_C(10000000); /* 10 ms per tick; only needed on a stepped bus */
        int status = check(tb_receive(plc));
        if (status < 0) return 1;
        mm += tb_get_bool(values, &valve) ? 2 : -1; /* your machine model */
        tb_set(values, &low, mm < 150);
        tb_set(values, &level, mm);
        if (check(tb_send(plc)) < 0) return 1;
        if (tick % 50 == 0) printf("%3d  %5.1f mm  valve %d  status %d\n", tick, mm, tb_get_bool(values, &valve), status);
    }
    return check(tb_close(plc)) < 0;
}
