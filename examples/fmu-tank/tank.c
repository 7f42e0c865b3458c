/* A tank as an FMU, for co-simulation: one C file for FMI 2.0 and, with -DFMI3, for FMI 3.0.
 *
 * A valve fills the tank, a drain empties it, a float switch is on while it is low. The file has the functions that a master needs
 * for such a model, and repeats the standards' types so that it compiles without their headers.
 *
 * Value references: 0 valve (input), 1 level in metres, 2 low (outputs), 3 area in square metres (parameter), 4 counter, 5 leak in
 * cubic metres per second (tunable parameter: a fault can set it).
 */

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { OK = 0, WARNING = 1, DISCARD = 2, FAILED = 3, FATAL = 4 };
enum { VALVE = 0, LEVEL = 1, LOW = 2, AREA = 3, STEPS = 4, LEAK = 5 };

static const double INFLOW = 0.02;  /* cubic metres per second, with the valve open */
static const double OUTFLOW = 0.01; /* at all times */

typedef struct {
    bool valve;
    double level;
    double area;
    double leak;
    int32_t steps;
} Tank;

static Tank *make(void) {
    Tank *tank = calloc(1, sizeof *tank);
    if (tank != NULL) {
        tank->level = 0.5;
        tank->area = 0.5;
    }
    return tank;
}

static void pass(Tank *tank, double seconds) {
    tank->level += ((tank->valve ? INFLOW : 0.0) - OUTFLOW - tank->leak) / tank->area * seconds;
    if (tank->level < 0.0) {
        tank->level = 0.0;
    }
    tank->steps++;
}

static int get_real(const Tank *tank, uint32_t reference, double *value) {
    switch (reference) {
    case LEVEL: *value = tank->level; return OK;
    case AREA: *value = tank->area; return OK;
    case LEAK: *value = tank->leak; return OK;
    default: return FAILED;
    }
}

static int set_real(Tank *tank, uint32_t reference, double value) {
    if (reference == LEAK) {
        tank->leak = value;
        return OK;
    }
    if (reference != AREA || value <= 0.0) {
        return FAILED;
    }
    tank->area = value;
    return OK;
}

static bool is_low(const Tank *tank) { return tank->level < 0.4; }

#define EACH(count, call)                                                                                                           \
    for (size_t i = 0; i < (count); i++) {                                                                                          \
        int status = (call);                                                                                                        \
        if (status != OK) {                                                                                                         \
            return status;                                                                                                          \
        }                                                                                                                           \
    }                                                                                                                               \
    return OK

static int get_bool(const Tank *tank, uint32_t reference, bool *value) {
    switch (reference) {
    case VALVE: *value = tank->valve; return OK;
    case LOW: *value = is_low(tank); return OK;
    default: return FAILED;
    }
}

static int set_bool(Tank *tank, uint32_t reference, bool value) {
    if (reference != VALVE) {
        return FAILED;
    }
    tank->valve = value;
    return OK;
}

/* Functions that this model does not need; many tools look for them anyway. */
#define NONE(name)                                                                                                                  \
    EXPORT int name(void *tank) { return (void)tank, FAILED; }

#ifdef FMI3

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                         bool event_mode, bool early_return, const uint32_t *intermediate, size_t count, void *env,
                                         void *log, void *update) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
    (void)intermediate, (void)count, (void)env, (void)log, (void)update;
    return make();
}

EXPORT void fmi3FreeInstance(void *tank) { free(tank); }

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT int fmi3EnterInitializationMode(void *tank, bool has_tolerance, double tolerance, double start, bool has_stop, double stop) {
    (void)tank, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return OK;
}

EXPORT int fmi3ExitInitializationMode(void *tank) { return (void)tank, OK; }
EXPORT int fmi3Terminate(void *tank) { return (void)tank, OK; }

EXPORT int fmi3GetFloat64(void *tank, const uint32_t *references, size_t count, double *values, size_t value_count) {
    (void)value_count;
    EACH(count, get_real(tank, references[i], &values[i]));
}

EXPORT int fmi3SetFloat64(void *tank, const uint32_t *references, size_t count, const double *values, size_t value_count) {
    (void)value_count;
    EACH(count, set_real(tank, references[i], values[i]));
}

EXPORT int fmi3GetBoolean(void *tank, const uint32_t *references, size_t count, bool *values, size_t value_count) {
    (void)value_count;
    EACH(count, get_bool(tank, references[i], &values[i]));
}

EXPORT int fmi3SetBoolean(void *tank, const uint32_t *references, size_t count, const bool *values, size_t value_count) {
    (void)value_count;
    EACH(count, set_bool(tank, references[i], values[i]));
}

EXPORT int fmi3GetInt32(void *tank, const uint32_t *references, size_t count, int32_t *values, size_t value_count) {
    (void)value_count;
    EACH(count, (references[i] == STEPS ? (values[i] = ((Tank *)tank)->steps, OK) : FAILED));
}

EXPORT int fmi3DoStep(void *tank, double from, double length, bool no_set_prior, bool *event, bool *terminate, bool *early_return,
                      double *last) {
    (void)no_set_prior;
    pass(tank, length);
    *event = *terminate = *early_return = false;
    *last = from + length;
    return OK;
}

EXPORT void *fmi3InstantiateModelExchange(void) { return NULL; }
EXPORT void *fmi3InstantiateScheduledExecution(void) { return NULL; }

NONE(fmi3GetFloat32) NONE(fmi3SetFloat32) NONE(fmi3GetInt8) NONE(fmi3SetInt8) NONE(fmi3GetUInt8) NONE(fmi3SetUInt8)
NONE(fmi3GetInt16) NONE(fmi3SetInt16) NONE(fmi3GetUInt16) NONE(fmi3SetUInt16) NONE(fmi3SetInt32) NONE(fmi3GetUInt32)
NONE(fmi3SetUInt32) NONE(fmi3GetInt64) NONE(fmi3SetInt64) NONE(fmi3GetUInt64) NONE(fmi3SetUInt64) NONE(fmi3GetString)
NONE(fmi3SetString) NONE(fmi3GetBinary) NONE(fmi3SetBinary) NONE(fmi3GetClock) NONE(fmi3SetClock) NONE(fmi3SetDebugLogging)
NONE(fmi3Reset) NONE(fmi3GetFMUState) NONE(fmi3SetFMUState) NONE(fmi3FreeFMUState) NONE(fmi3SerializedFMUStateSize)
NONE(fmi3SerializeFMUState) NONE(fmi3DeserializeFMUState) NONE(fmi3GetVariableDependencies)
NONE(fmi3GetNumberOfVariableDependencies) NONE(fmi3GetDirectionalDerivative) NONE(fmi3GetAdjointDerivative)
NONE(fmi3GetIntervalDecimal) NONE(fmi3GetIntervalFraction) NONE(fmi3GetShiftDecimal) NONE(fmi3GetShiftFraction)
NONE(fmi3SetIntervalDecimal) NONE(fmi3SetIntervalFraction) NONE(fmi3SetShiftDecimal) NONE(fmi3SetShiftFraction)
NONE(fmi3EvaluateDiscreteStates) NONE(fmi3UpdateDiscreteStates) NONE(fmi3EnterEventMode) NONE(fmi3EnterStepMode)
NONE(fmi3EnterConfigurationMode) NONE(fmi3ExitConfigurationMode) NONE(fmi3EnterContinuousTimeMode)
NONE(fmi3CompletedIntegratorStep) NONE(fmi3SetTime) NONE(fmi3SetContinuousStates) NONE(fmi3GetContinuousStateDerivatives)
NONE(fmi3GetEventIndicators) NONE(fmi3GetContinuousStates) NONE(fmi3GetNominalsOfContinuousStates)
NONE(fmi3GetNumberOfEventIndicators) NONE(fmi3GetNumberOfContinuousStates) NONE(fmi3GetOutputDerivatives)
NONE(fmi3ActivateModelPartition)

#else

EXPORT void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources, const void *callbacks, int visible,
                             int logging) {
    (void)name, (void)guid, (void)resources, (void)callbacks, (void)visible, (void)logging;
    return kind == 1 ? make() : NULL;
}

EXPORT void fmi2FreeInstance(void *tank) { free(tank); }

EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT int fmi2SetupExperiment(void *tank, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    (void)tank, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return OK;
}

EXPORT int fmi2EnterInitializationMode(void *tank) { return (void)tank, OK; }
EXPORT int fmi2ExitInitializationMode(void *tank) { return (void)tank, OK; }
EXPORT int fmi2Terminate(void *tank) { return (void)tank, OK; }

EXPORT int fmi2GetReal(void *tank, const uint32_t *references, size_t count, double *values) {
    EACH(count, get_real(tank, references[i], &values[i]));
}

EXPORT int fmi2SetReal(void *tank, const uint32_t *references, size_t count, const double *values) {
    EACH(count, set_real(tank, references[i], values[i]));
}

EXPORT int fmi2GetBoolean(void *tank, const uint32_t *references, size_t count, int *values) {
    for (size_t i = 0; i < count; i++) {
        bool value = false;
        int status = get_bool(tank, references[i], &value);
        if (status != OK) {
            return status;
        }
        values[i] = value;
    }
    return OK;
}

EXPORT int fmi2SetBoolean(void *tank, const uint32_t *references, size_t count, const int *values) {
    EACH(count, set_bool(tank, references[i], values[i] != 0));
}

EXPORT int fmi2GetInteger(void *tank, const uint32_t *references, size_t count, int *values) {
    EACH(count, (references[i] == STEPS ? (values[i] = ((Tank *)tank)->steps, OK) : FAILED));
}

EXPORT int fmi2SetInteger(void *tank, const uint32_t *references, size_t count, const int *values) {
    (void)tank, (void)references, (void)count, (void)values;
    return FAILED;
}

EXPORT int fmi2DoStep(void *tank, double from, double length, int no_set_prior) {
    (void)from, (void)no_set_prior;
    pass(tank, length);
    return OK;
}

EXPORT int fmi2GetBooleanStatus(void *tank, int kind, int *value) { return (void)tank, (void)kind, *value = 0, OK; }
EXPORT int fmi2GetRealStatus(void *tank, int kind, double *value) { return (void)tank, (void)kind, (void)value, DISCARD; }

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }

NONE(fmi2GetString) NONE(fmi2SetString) NONE(fmi2SetDebugLogging) NONE(fmi2Reset) NONE(fmi2GetFMUstate) NONE(fmi2SetFMUstate)
NONE(fmi2FreeFMUstate) NONE(fmi2SerializedFMUstateSize) NONE(fmi2SerializeFMUstate) NONE(fmi2DeSerializeFMUstate)
NONE(fmi2GetDirectionalDerivative) NONE(fmi2SetRealInputDerivatives) NONE(fmi2GetRealOutputDerivatives) NONE(fmi2CancelStep)
NONE(fmi2GetStatus) NONE(fmi2GetIntegerStatus) NONE(fmi2GetStringStatus)

#endif
