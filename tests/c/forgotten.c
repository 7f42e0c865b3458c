/* forgotten FILE return|exit|fork: ends in the middle of a tick, with its driver open, while another thread ticks a second one. */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <tickbus.h>
#include <unistd.h>

static tb_driver busy;

static void *ticks(void *nothing) {
    while (tb_exchange(busy) >= 0) continue;
    return nothing;
}

int main(int count, char **arguments) {
    tb_driver plc;
    tb_signal level;
    pthread_t thread;
    if (count < 3 || tb_open(arguments[1], "[record]\nfile = \"last.csv\"", &plc) < 0) return 1;
    if (tb_open(arguments[1], NULL, &busy) < 0 || pthread_create(&thread, NULL, ticks, NULL) != 0) return 2;
    if (tb_find(plc, "Level", &level) < 0 || tb_receive(plc) < 0) return 3;
    tb_set(tb_buffer_of(plc), &level, 47.11);
    if (strcmp(arguments[2], "fork") == 0) {
        /* The child has none of the threads that its parent's drivers have, and leaves them alone. */
        int status;
        pid_t child = fork();
        if (child == 0) exit(0);
        if (waitpid(child, &status, 0) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0) return 4;
        if (tb_send(plc) < 0 || tb_receive(plc) < 0) return 5;
    }
    if (strcmp(arguments[2], "exit") == 0) exit(0);
    return 0;
}
