/* instructions CASE TICKS FILE: makes that many ticks through the door of C, in the function `ticks`, for tools/instructions. The
 * bus of the driver.cfg must stand still meanwhile. `instructions --list` lists the cases. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <tickbus.h>

static tb_driver driver;
static tb_buffer *values;

__attribute__((noinline)) static int ticks(int count, int is_halved) {
    int status = TB_FRESH;
    while (count-- > 0 && status >= 0) {
        values->simulation_time += 1000000;
        if (is_halved) tb_receive(driver);
        status = is_halved ? tb_send(driver) : tb_exchange(driver);
    }
    return status;
}

int main(int count, char **arguments) {
    if (count == 2 && strcmp(arguments[1], "--list") == 0) return puts("tb_exchange.free.16\ntb_receive-tb_send.free.16") < 0;
    if (count != 4 || tb_open(arguments[3], NULL, &driver) < 0) {
        fprintf(stderr, "instructions: %s\n", tb_last_error());
        return 1;
    }
    values = tb_buffer_of(driver);
    values->simulation_time = 0;
    /* Until the program's first values have arrived. */
    tb_turn turn = {0};
    while (tb_exchange(driver) != TB_UNCHANGED)
        if (tb_every(1000000, &turn) < 0) return 1;
    int status = ticks(atoi(arguments[2]), strstr(arguments[1], "receive") != NULL);
    return tb_close(driver) < 0 || status != TB_UNCHANGED;
}
