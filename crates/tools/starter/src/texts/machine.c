/* {{name}}: the simulated machine. */
#include <signal.h>
#include <stdio.h>
#include <tickbus.h>

static volatile sig_atomic_t stopped;

static void stop(int number) {
    (void)number;
    stopped = 1;
}

static int failed(void) {
    fprintf(stderr, "machine: %s\n", tb_last_error());
    return 1;
}

int main(void) {
    tb_driver plc;
    tb_turn turn = {0};
    if (tb_open("driver.cfg", NULL, &plc) < 0) return failed();
{{signals}}    tb_buffer *values = tb_buffer_of(plc);
    signal(SIGINT, stop);
    signal(SIGTERM, stop);
    for (int number = 0; !stopped && tb_is_over(plc) == 0 && tb_every(10000000, &turn) == TB_FRESH; number++) {
        values->simulation_time = turn.time;
        int status = tb_receive(plc); /* 0 fresh, 1 unchanged, 2 stale */
        if (status < 0) return failed();
{{model}}        if (tb_send(plc) < 0) return failed(); /* the PLC is answered within the turn */
        if (number % 100 == 0) {
            printf({{shown}});
            fflush(stdout);
        }
    }
    return tb_close(plc) < 0 ? failed() : 0;
}
