/* An FMU of FMI 3.0 with arrays, a structural parameter, an enumeration, and clocks. It refuses every call that the standard does
 * not allow in its mode, a value of a clock that does not tick, and a step across a tick.
 *
 * Value references: 1 n, structural; 2 u[n], inputs; 3 y[n] = gain x u; 4 gain[n]; 5 mode (hold 1, track 2); 6 clock "sample",
 * every 0.1 s; 7 the sum of u at each sample (with mode track also in between); 8 the number of samples; 9 clock "late", counted
 * down for 0.05 s from each sample; 10 its ticks; 13 clock "asked", every 0.2 s from 0.1 s on, as it says when it is asked; 14 its ticks; 11 clock "third", the FMU's own: with each third sample; 12 its ticks, which can be
 * read at these times alone. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

enum { INSTANTIATED, CONFIGURATION, INITIALIZATION, EVENT, STEP };
enum { MOST = 8, ERROR = 3 };

typedef struct {
    int state;
    bool events;
    uint64_t n;
    double u[MOST], gain[MOST], sampled, now, next, countdown;
    int64_t mode;
    int32_t samples, late, thirds, askeds;
    bool sample_ticks, late_ticks, third_ticks, counts, is_known;
} It;

void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging, bool events,
                                  bool early, const uint32_t *required, size_t count, void *env, void *log, void *update) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)early, (void)required, (void)count, (void)env;
    (void)log, (void)update;
    It *it = calloc(1, sizeof *it);
    *it = (It){.events = events, .n = 2, .u = {1, 2, 3, 4}, .gain = {1, 1, 1, 1}, .mode = 1, .countdown = -1};
    return it;
}

void fmi3FreeInstance(It *it) { free(it); }

static int go(It *it, int from, int to) {
    if (it->state != from) return ERROR;
    it->state = to;
    return 0;
}

int fmi3EnterConfigurationMode(It *it) { return go(it, INSTANTIATED, CONFIGURATION); }
int fmi3ExitConfigurationMode(It *it) { return go(it, CONFIGURATION, INSTANTIATED); }
int fmi3EnterInitializationMode(It *it, bool has_tolerance, double tolerance, double start, bool has_stop, double stop) {
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    it->now = it->next = start;
    return go(it, INSTANTIATED, INITIALIZATION);
}
int fmi3ExitInitializationMode(It *it) { return go(it, INITIALIZATION, it->events ? EVENT : STEP); }
int fmi3EnterEventMode(It *it) { return go(it, STEP, EVENT); }
int fmi3EnterStepMode(It *it) {
    it->sample_ticks = it->late_ticks = it->third_ticks = false;
    return go(it, EVENT, STEP);
}
int fmi3Terminate(It *it) { return it->state == STEP ? 0 : ERROR; }

static double sum(It *it) {
    double all = 0;
    for (uint64_t i = 0; i < it->n; i++) all += it->u[i];
    return all;
}

int fmi3SetClock(It *it, const uint32_t *clocks, size_t count, const bool *values) {
    if (it->state != EVENT) return ERROR;
    for (size_t i = 0; i < count; i++) {
        if (!values[i]) return ERROR;
        if (clocks[i] == 6) {
            it->sample_ticks = it->counts = true;
            it->samples++;
            it->next = it->samples * 0.1;
            if (it->samples % 3 == 0) it->third_ticks = true, it->thirds++;
        } else if (clocks[i] == 9) {
            it->late_ticks = true;
            it->late++;
            it->countdown = -1;
        } else if (clocks[i] == 13) {
            double due = 0.1 + 0.2 * it->askeds++;
            if (it->now < due - 1e-9 || it->now > due + 1e-9) return ERROR;
        } else {
            return ERROR;
        }
    }
    return 0;
}

int fmi3GetClock(It *it, const uint32_t *clocks, size_t count, bool *values) {
    for (size_t i = 0; i < count; i++) values[i] = clocks[i] == 11 && it->third_ticks;
    return it->state == EVENT ? 0 : ERROR;
}

int fmi3UpdateDiscreteStates(It *it, bool *again, bool *ends, bool *nominals, bool *values, bool *has_next, double *next) {
    if (it->state != EVENT) return ERROR;
    if (it->sample_ticks) it->sampled = sum(it);
    /* Another iteration after each sample, in which nothing ticks any more. */
    *again = it->sample_ticks;
    it->sample_ticks = it->late_ticks = it->third_ticks = false;
    *ends = *nominals = *values = *has_next = false;
    *next = 0;
    return 0;
}

int fmi3GetIntervalDecimal(It *it, const uint32_t *clocks, size_t count, double *intervals, int *qualifiers) {
    if (it->state != EVENT || count != 1 || (clocks[0] != 9 && clocks[0] != 13)) return ERROR;
    if (clocks[0] == 13) {
        qualifiers[0] = it->is_known ? 1 : 2;
        intervals[0] = 0.2;
        it->is_known = true;
        return 0;
    }
    qualifiers[0] = it->counts ? 2 : it->countdown < 0 ? 0 : 1;
    intervals[0] = 0.05;
    if (it->counts) it->countdown = it->now + 0.05;
    it->counts = false;
    return 0;
}

int fmi3GetShiftDecimal(It *it, const uint32_t *clocks, size_t count, double *shifts) {
    if (it->state != EVENT || count != 1 || clocks[0] != 13) return ERROR;
    shifts[0] = 0.1;
    return 0;
}

int fmi3DoStep(It *it, double from, double length, bool no_way_back, bool *event, bool *ends, bool *early, double *reached) {
    (void)no_way_back;
    double to = from + length;
    *event = *ends = *early = false;
    *reached = it->now = to;
    if (it->state != STEP || length <= 0) return ERROR;
    if (it->events && (to > it->next + 1e-9 || (it->countdown >= 0 && to > it->countdown + 1e-9))) return ERROR;
    if (it->mode == 2) it->sampled = sum(it);
    return 0;
}

int fmi3SetFloat64(It *it, const uint32_t *references, size_t count, const double *values, size_t value_count) {
    size_t at = 0;
    for (size_t i = 0; i < count; i++) {
        double *array = references[i] == 2 ? it->u : it->gain;
        if (references[i] != 2 && (references[i] != 4 || it->state != INSTANTIATED)) return ERROR;
        for (uint64_t k = 0; k < it->n; k++) array[k] = at < value_count ? values[at++] : 0;
    }
    return at == value_count ? 0 : ERROR;
}

int fmi3GetFloat64(It *it, const uint32_t *references, size_t count, double *values, size_t value_count) {
    size_t at = 0;
    if (it->state == INSTANTIATED) return ERROR;
    for (size_t i = 0; i < count; i++) {
        if (at + (references[i] == 7 ? 1 : it->n) > value_count) return ERROR;
        if (references[i] == 7) values[at++] = it->sampled;
        else
            for (uint64_t k = 0; k < it->n; k++) values[at++] = references[i] == 3 ? it->u[k] * it->gain[k] : it->u[k];
    }
    return at == value_count ? 0 : ERROR;
}

int fmi3SetUInt64(It *it, const uint32_t *references, size_t count, const uint64_t *values, size_t value_count) {
    if (it->state != CONFIGURATION || count != 1 || value_count != 1 || references[0] != 1 || values[0] > MOST) return ERROR;
    it->n = values[0];
    return 0;
}

int fmi3SetInt64(It *it, const uint32_t *references, size_t count, const int64_t *values, size_t value_count) {
    if (it->state != INSTANTIATED || count != 1 || value_count != 1 || references[0] != 5) return ERROR;
    it->mode = values[0];
    return 0;
}

int fmi3GetInt32(It *it, const uint32_t *references, size_t count, int32_t *values, size_t value_count) {
    if (count != value_count || it->state == INSTANTIATED) return ERROR;
    for (size_t i = 0; i < count; i++) {
        if (references[i] == 12 && !it->third_ticks) return ERROR;
        values[i] = references[i] == 8 ? it->samples : references[i] == 10 ? it->late : references[i] == 14 ? it->askeds : it->thirds;
    }
    return 0;
}

#define NONE(name) \
    int fmi3Set##name(void) { return ERROR; } \
    int fmi3Get##name(void) { return ERROR; }
NONE(Float32) NONE(Int8) NONE(UInt8) NONE(Int16) NONE(UInt16) NONE(UInt32) NONE(Boolean)
int fmi3SetInt32(void) { return ERROR; }
int fmi3GetInt64(void) { return ERROR; }
int fmi3GetUInt64(void) { return ERROR; }
