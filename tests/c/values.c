/* Values of every kind, by a driver with the program "mirror"; and the layout of what both sides share. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <tickbus.h>

_Static_assert(sizeof(tb_buffer) == 88 && sizeof(tb_slot) == 8, "the header is eleven words");
_Static_assert(offsetof(tb_buffer, status) == 8 && offsetof(tb_buffer, age) == 24, "words");
_Static_assert(offsetof(tb_buffer, simulation_time) == 32 && offsetof(tb_buffer, slot_count) == 56, "words");
_Static_assert(sizeof(tb_signal) == 5 * sizeof(char *) + 24, "no gaps");
_Static_assert(sizeof(tb_event) == 24, "three words");

static tb_driver plc;
static tb_buffer *values;

static tb_signal find(const char *name) {
    tb_signal signal;
    if (tb_find(plc, name, &signal) < 0) {
        fprintf(stderr, "%s\n", tb_last_error());
        exit(1);
    }
    return signal;
}

static void same(const char *what, double is, double expected) {
    if (is != expected && !(isnan(is) && isnan(expected))) {
        fprintf(stderr, "values.c: %s is %.17g, expected %.17g\n", what, is, expected);
        exit(1);
    }
}

static void tick(void) {
    static int64_t time;
    values->simulation_time = time += 10000000;
    if (tb_exchange(plc) < 0) {
        fprintf(stderr, "%s\n", tb_last_error());
        exit(1);
    }
}

int main(int count, char **arguments) {
    if (count < 2 || tb_open(arguments[1], NULL, &plc) < 0) {
        fprintf(stderr, "%s\n", tb_last_error());
        return 1;
    }
    values = tb_buffer_of(plc);
    same("version", (double)values->version, 2);
    same("slots", (double)values->slot_count, tb_signal_count(plc) + 1);
    same("time", (double)values->simulation_time, (double)TB_NO_TIME);
    tb_signal whole = find("whole"), natural = find("natural"), pulse = find("pulse"), answer = find("answer");
    same("kind", whole.kind, TB_INTEGER);
    same("kind", natural.kind, TB_NATURAL);

    tb_set(values, &whole, 2.7);
    same("2.7", (double)tb_slots(values)[whole.slot].integer, 3);
    tb_set(values, &whole, -2.5);
    same("-2.5", tb_get(values, &whole), -3);
    tb_set(values, &whole, 1e30);
    same("1e30", tb_slots(values)[whole.slot].integer == INT64_MAX, 1);
    tb_set(values, &whole, -1e30);
    same("-1e30", tb_slots(values)[whole.slot].integer == INT64_MIN, 1);
    tb_set(values, &whole, NAN);
    same("NaN", tb_get(values, &whole), -7);
    same("NaN of a ULINT", (tb_set(values, &natural, NAN), tb_get(values, &natural)), 42);
    same("saturated", (double)values->saturated, 2);
    same("not a number", (double)values->not_a_number, 2);
    tb_set(values, &natural, -1);
    same("-1", tb_get(values, &natural), 0);
    tb_set(values, &natural, 18446744073709551615.0);
    same("2^64", tb_slots(values)[natural.slot].natural == UINT64_MAX, 1);
    tb_slots(values)[natural.slot].natural = UINT64_C(0x8000000000000001);
    same("2^63", tb_get(values, &natural), 9223372036854775808.0);

    same("set what the PLC writes", tb_set(values, &answer, 1), TB_BAD_ARGUMENT);
    same("what the PLC writes", tb_get(values, &answer), 0);

    /* The statistics count them, and those of the other types. */
    tick();
    char text[8192];
    tb_statistics(plc, text, sizeof text);
    same("saturated", strstr(text, "\nsaturated=4\n") != NULL, 1);
    same("not_a_number", strstr(text, "\nnot_a_number=2\n") != NULL, 1);

    /* The mirror brings each pulse back: every edge is counted, and is an event. */
    uint32_t edges = 0;
    for (int i = 0; i < 20; i++) {
        tb_set(values, &pulse, i % 4 == 0);
        tick();
        edges += tb_edges(values, &answer);
    }
    same("edges", edges, 5);
    same("edges of what is written", tb_edges(values, &pulse), 0);
    same("ticks", (double)values->ticks, 21);
    return tb_close(plc) < 0;
}
