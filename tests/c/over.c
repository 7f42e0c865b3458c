/* Exchanges until the run on virtual time of its driver.cfg is over, and prints the number of turns. */
#include "tickbus.h"
#include <stdio.h>

int main(int count, char **arguments) {
    tb_driver plc;
    if (count != 2 || tb_open(arguments[1], NULL, &plc) < 0) {
        fprintf(stderr, "over: %s\n", tb_last_error());
        return 1;
    }
    tb_buffer *values = tb_buffer_of(plc);
    tb_turn turn = {0};
    int turns = 0;
    while (tb_is_over(plc) == 0 && tb_every(1000000, &turn) == TB_FRESH) {
        values->simulation_time = turns++ * INT64_C(10000000);
        if (tb_exchange(plc) < 0) {
            fprintf(stderr, "over: %s\n", tb_last_error());
            return 1;
        }
    }
    printf("over: turns=%d status=%d\n", turns, (int)values->status);
    return tb_close(plc) < 0;
}
