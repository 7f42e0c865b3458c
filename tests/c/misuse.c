/* What a caller in C can do wrong: each is answered by a status and a text, and nothing goes down. */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <tickbus.h>

static int line;

static void expect(int at, int status, int expected, const char *words) {
    if (status != expected) {
        fprintf(stderr, "misuse.c:%d: %d, expected %d; the last error is: %s\n", at, status, expected, tb_last_error());
        exit(1);
    }
    if (words != NULL && strstr(tb_last_error(), words) == NULL) {
        fprintf(stderr, "misuse.c:%d: \"%s\" is not in: %s\n", at, words, tb_last_error());
        exit(1);
    }
    line = at;
}

#define EXPECT(call, expected, words) expect(__LINE__, (int)(call), expected, words)

static tb_driver shared;

static void *ticks(void *counts) {
    int *count = counts;
    for (int i = 0; i < 20000; i++) {
        int status = tb_exchange(shared);
        if (status >= 0) {
            count[0]++;
        } else if (status == TB_BUSY) {
            count[1]++;
        } else {
            expect(__LINE__, status, TB_BUSY, NULL);
        }
    }
    return NULL;
}

static void *ticks_until_closed(void *nothing) {
    for (;;) {
        int status = tb_exchange(shared);
        if (status == TB_CLOSED) return nothing;
        EXPECT(status >= 0, 1, NULL);
    }
}

/* When static objects and the thread's own are gone. */
static void at_the_end(void) {
    if (tb_exchange(shared) != TB_CLOSED || tb_close(shared) != TB_CLOSED) _Exit(3);
    tb_last_error();
}

int main(int count, char **arguments) {
    atexit(at_the_end);
    tb_driver driver = 77, other;
    tb_signal signal;
    char text[64];
    if (count < 3) return 2;
    if (*tb_last_error() != 0) return 2;
    EXPECT(tb_open(NULL, NULL, &driver), TB_BAD_ARGUMENT, "path is NULL");
    EXPECT(driver, 0, NULL);
    EXPECT(tb_open("x", NULL, NULL), TB_BAD_ARGUMENT, "driver is NULL");
    EXPECT(tb_open("\xff.cfg", NULL, &driver), TB_BAD_ARGUMENT, "UTF-8");
    EXPECT(tb_open("no such.cfg", NULL, &driver), TB_BAD_CONFIG, "no such.cfg");
    EXPECT(tb_open(arguments[2], NULL, &driver), TB_BAD_CONFIG, "did you mean");
    EXPECT(tb_open(arguments[1], "[fieldbus]\nkind = \"modbos-server\"", &driver), TB_BAD_CONFIG, "modbus-server");

    const tb_driver never[] = {0, 1, -1, 255, INT64_MAX, INT64_MIN};
    for (size_t i = 0; i < sizeof never / sizeof *never; i++) {
        EXPECT(tb_exchange(never[i]), TB_NOT_OPEN, "NOT_OPEN (-1)");
        EXPECT(tb_close(never[i]), TB_NOT_OPEN, "open the driver first");
        EXPECT(tb_buffer_of(never[i]) == NULL, 1, "NOT_OPEN");
        EXPECT(tb_signal_count(never[i]), TB_NOT_OPEN, NULL);
        EXPECT(tb_statistics(never[i], text, sizeof text), TB_NOT_OPEN, NULL);
        EXPECT(tb_page(never[i], text, sizeof text), TB_NOT_OPEN, NULL);
    }

    EXPECT(tb_open(arguments[1], NULL, &driver), TB_FRESH, NULL);
    EXPECT(tb_signal_count(driver), 3, NULL);
    EXPECT(tb_find(driver, "Valv", &signal), TB_BAD_ARGUMENT, "did you mean \"Valve\"?");
    /* A caller who does not look at that reads 0, and sets nothing. */
    tb_buffer *values = tb_buffer_of(driver);
    EXPECT(tb_set(values, &signal, 1), TB_BAD_ARGUMENT, NULL);
    EXPECT(tb_get(values, &signal) == 0 && tb_edges(values, &signal) == 0 && *signal.name == 0, 1, NULL);
    EXPECT(tb_find(driver, NULL, &signal), TB_BAD_ARGUMENT, "name is NULL");
    EXPECT(tb_find(driver, "Valve", NULL), TB_BAD_ARGUMENT, "signal is NULL");
    EXPECT(tb_signal_at(driver, 3, &signal), TB_BAD_ARGUMENT, "expected 0 to 2");
    EXPECT(tb_signal_at(driver, -1, &signal), TB_BAD_ARGUMENT, "there is no signal -1");
    EXPECT(tb_signal_at(driver, 2, &signal), TB_FRESH, NULL);
    EXPECT(strcmp(signal.name, "Level") | strcmp(signal.address, "%IW2") | strcmp(signal.type, "INT"), 0, NULL);
    EXPECT(strcmp(signal.unit, "mm") | strcmp(signal.station, ""), 0, NULL);
    EXPECT(signal.is_written == 1 && signal.kind == TB_REAL && signal.edges == -1, 1, NULL);

    /* The clock of a loop: a turn begins when it is due, or late; and those that were missed are left out. */
    tb_turn turn = {0};
    EXPECT(tb_every(1000000, NULL), TB_BAD_ARGUMENT, "turn is NULL");
    EXPECT(tb_every(0, &turn), TB_BAD_ARGUMENT, "period");
    EXPECT(tb_every(1000000, &turn), TB_FRESH, NULL);
    EXPECT(turn.time % 1000000 == 0 && turn.time / 1000000 == turn.missed, 1, NULL);
    int64_t passed = turn.time;
    EXPECT(tb_every(1000000, &turn), TB_FRESH, NULL);
    EXPECT(turn.time == passed + (turn.missed + 1) * 1000000 && turn.lag >= 0 && turn.lag < 1000000, 1, NULL);
    /* As if the loop had stalled for 2.5 periods. */
    passed = turn.time;
    turn.begun -= 2500000;
    turn.due -= 2500000;
    EXPECT(tb_every(1000000, &turn), TB_FRESH, NULL);
    EXPECT(turn.missed >= 1 && turn.lag >= 0 && turn.lag < 1000000, 1, NULL);
    EXPECT(turn.time == passed + (turn.missed + 1) * 1000000, 1, NULL);
    EXPECT(tb_is_over(driver), 0, NULL);
    EXPECT(tb_is_over(driver + 1), TB_NOT_OPEN, "no driver was ever opened");
    EXPECT(strcmp(tb_version(), "0.1.0"), 0, NULL);

    /* A text that does not fit is cut and ends with 0; the call returns its whole length. */
    int length = tb_statistics(driver, NULL, 0);
    EXPECT(length > 64, 1, NULL);
    memset(text, 'x', sizeof text);
    EXPECT(tb_statistics(driver, text, 10) > 64, 1, NULL);
    EXPECT(strlen(text), 9, NULL);
    EXPECT(text[10], 'x', NULL);

    /* Its driver.cfg asks for no page. */
    EXPECT(tb_page(driver, text, sizeof text), 0, NULL);
    EXPECT(strlen(text), 0, NULL);

    EXPECT(tb_inject(driver, "kind = \"stukc\""), TB_BAD_ARGUMENT, "stuck");
    int fault = tb_inject(driver, "kind = \"stuck\"\nsignal = \"Level\"\nvalue = 12.0");
    EXPECT(fault > 0, 1, NULL);
    EXPECT(tb_faults(driver, text, sizeof text) > 0, 1, NULL);
    EXPECT(tb_end_fault(driver, fault), 1, NULL);
    EXPECT(tb_end_fault(driver, 4711), 0, NULL);
    EXPECT(tb_events(driver, NULL, 1), TB_BAD_ARGUMENT, "events is NULL");

    /* Faults of the model: unknown before they are declared, told once in the tick in which they begin and in which they end. */
    const char *names[] = {"leak", "wear"}, *twice[] = {"leak", "leak"}, *missing[] = {"leak", NULL};
    tb_model_fault changes[4];
    EXPECT(tb_inject(driver, "kind = \"model\"\nname = \"leak\""), TB_BAD_ARGUMENT, "declare it before its first tick");
    EXPECT(tb_declare_faults(driver, twice, 2), TB_BAD_ARGUMENT, "a name of its own");
    EXPECT(tb_declare_faults(driver, missing, 2), TB_BAD_ARGUMENT, "a name is NULL");
    EXPECT(tb_declare_faults(driver, NULL, 1), TB_BAD_ARGUMENT, "names is NULL");
    EXPECT(tb_declare_faults(driver, names, 2), TB_FRESH, NULL);
    EXPECT(tb_inject(driver, "kind = \"model\"\nname = \"leek\""), TB_BAD_ARGUMENT, "did you mean \"leak\"?");
    EXPECT((fault = tb_inject(driver, "kind = \"model\"\nname = \"wear\"\nvalue = 0.4")) > 0, 1, NULL);
    EXPECT(tb_inject(driver, "kind = \"model\"\nname = \"leak\"\nvalue = 0") > 0, 1, NULL);
    EXPECT(tb_model_faults(driver, changes, 4), 0, NULL);
    EXPECT(tb_exchange(driver) >= 0, 1, NULL);
    EXPECT(tb_model_faults(driver, NULL, 4), TB_BAD_ARGUMENT, "faults is NULL");
    EXPECT(tb_model_faults(driver, changes, 1), 1, NULL);
    EXPECT(changes[0].fault == 0 && changes[0].is_on && changes[0].value == 0, 1, NULL);
    EXPECT(tb_model_faults(driver, changes, 4), 1, NULL);
    EXPECT(changes[0].fault == 1 && changes[0].is_on && changes[0].value == 0.4, 1, NULL);
    EXPECT(tb_end_fault(driver, fault), 1, NULL);
    EXPECT(tb_exchange(driver) >= 0, 1, NULL);
    EXPECT(tb_model_faults(driver, changes, 4), 1, NULL);
    EXPECT(changes[0].fault == 1 && !changes[0].is_on && changes[0].value == 0, 1, NULL);

    /* Two threads: now and then, one of them gets TB_BUSY. */
    shared = driver;
    uint64_t before = values->ticks;
    int counts[2][2] = {{0, 0}, {0, 0}};
    pthread_t thread;
    if (pthread_create(&thread, NULL, ticks, counts[0]) != 0) return 2;
    ticks(counts[1]);
    pthread_join(thread, NULL);
    EXPECT(values->ticks - before, counts[0][0] + counts[1][0], NULL);
    EXPECT(values->ticks > 0, 1, NULL);

    /* Beside a thread that ticks without a pause, everything else gets in; and closing, too. */
    EXPECT(pthread_create(&thread, NULL, ticks_until_closed, NULL), 0, NULL);
    for (int i = 0; i < 200; i++) {
        EXPECT(tb_statistics(driver, text, sizeof text) > 0, 1, NULL);
        EXPECT((fault = tb_inject(driver, "kind = \"stuck\"\nsignal = \"Level\"\nvalue = 12.0\nat = \"1000h\"")) > 0, 1, NULL);
        EXPECT(tb_end_fault(driver, fault), 1, NULL);
    }

    /* After closing, the buffer is memory still. */
    EXPECT(tb_close(driver), TB_FRESH, NULL);
    pthread_join(thread, NULL);
    tb_set(values, &signal, 1.0);
    EXPECT(tb_exchange(driver), TB_CLOSED, "CLOSED (-3)");
    EXPECT(tb_close(driver), TB_CLOSED, "open it again");
    EXPECT(strcmp(signal.name, "Level"), 0, NULL);
    for (int i = 0; i < 200; i++) {
        EXPECT(tb_open(arguments[1], NULL, &other), TB_FRESH, NULL);
        EXPECT(tb_buffer_of(other) == values, 1, NULL);
        EXPECT(tb_close(other), TB_FRESH, NULL);
    }
    EXPECT(tb_exchange(driver), TB_CLOSED, NULL);

    /* A tick that fails says why the line is down. */
    EXPECT(tb_open(arguments[1], "[fieldbus]\nkind = \"sdsp\"\naddress = \"127.0.0.1:1\"\ntimeout = \"50ms\"", &other), TB_FRESH, NULL);
    EXPECT(tb_exchange(other), TB_BUS_FAILED, "127.0.0.1:1");
    EXPECT(tb_close(other), TB_FRESH, NULL);
    printf("misuse: ok last=%d\n", line);
    return 0;
}
