/* An FMU of FMI 2.0 that misbehaves as its token says. Value reference 0 is its one input, 1 its one output. */

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef void (*Logger)(void *env, const char *name, int status, const char *category, const char *format, ...);

typedef struct {
    Logger logger;
    void *allocate, *release, *finished, *env;
} Callbacks;

static const Callbacks *callbacks;
static char how[40];
static double now;

/* Some look there, though by the standard they may not. */
static int has_description(const char *resources) {
    char path[1024];
    snprintf(path, sizeof path, "%s/../modelDescription.xml", resources + strlen("file://"));
    return access(path, R_OK) == 0;
}

static int is(const char *what) { return strcmp(how, what) == 0; }

static void say(int status, const char *text) { callbacks->logger(callbacks->env, "it", status, "logAll", "%s", text); }

void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources, const Callbacks *with, int visible,
                      int logging) {
    (void)name, (void)kind, (void)visible, (void)logging;
    callbacks = with;
    strncpy(how, guid, sizeof how - 1);
    now = 0.0;
    callbacks->logger(NULL, "it", 0, "logAll", "%s", "without its environment");
    if (is("looks") && !has_description(resources)) {
        say(3, "there is no model description");
        return NULL;
    }
    if (is("null")) {
        say(3, "no licence on this computer");
        return NULL;
    }
    return how;
}

void fmi2FreeInstance(void *it) { (void)it; }

int fmi2SetupExperiment(void *it, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    (void)it;
    if (is("setup")) {
        callbacks->logger(callbacks->env, "it", 3, "logAll", "tolerance %d %g, from %g, to %d %g", has_tolerance, tolerance, start, has_stop, stop);
        return 3;
    }
    return 0;
}
int fmi2EnterInitializationMode(void *it) { return (void)it, 0; }
int fmi2ExitInitializationMode(void *it) { return (void)it, is("refuses") ? 3 : 0; }
int fmi2Terminate(void *it) { return (void)it, 0; }

int fmi2GetReal(void *it, const uint32_t *vr, size_t n, double *values) {
    (void)it, (void)vr;
    for (size_t i = 0; i < n; i++) {
        values[i] = now;
    }
    return 0;
}

int fmi2SetReal(void *it, const uint32_t *vr, size_t n, const double *values) { return (void)it, (void)vr, (void)n, (void)values, 0; }
int fmi2GetInteger(void *it, const uint32_t *vr, size_t n, int *values) { return (void)it, (void)vr, (void)n, (void)values, 3; }
int fmi2SetInteger(void *it, const uint32_t *vr, size_t n, const int *values) { return (void)it, (void)vr, (void)n, (void)values, 3; }
int fmi2GetBoolean(void *it, const uint32_t *vr, size_t n, int *values) { return (void)it, (void)vr, (void)n, (void)values, 3; }
int fmi2SetBoolean(void *it, const uint32_t *vr, size_t n, const int *values) { return (void)it, (void)vr, (void)n, (void)values, 3; }

int fmi2SetString(void *it, const uint32_t *vr, size_t n, const char *const *values) {
    (void)it;
    callbacks->logger(callbacks->env, "it", 3, "logAll", "text %u of %zu is %s", vr[0], n, values[0]);
    return 3;
}

int fmi2DoStep(void *it, double from, double length, int prior) {
    (void)it, (void)prior;
    if (is("slow")) {
        usleep(25000);
        return 0;
    }
    /* The third step, whatever the rounding. */
    if (from < 2.5 * length) {
        if (is("grumbles")) {
            say(1, "the tolerance was relaxed");
        }
        now = from + length;
        return is("grumbles");
    }
    if (is("crash")) {
        *(volatile int *)0 = 1;
    } else if (is("abort")) {
        abort();
    } else if (is("exit")) {
        exit(7);
    } else if (is("discard") || is("ended") || is("lost")) {
        return 2;
    } else if (is("fatal")) {
        say(4, "the solver has lost its matrix");
        return 4;
    } else if (is("formats") || is("stray")) {
        /* More arguments than registers; and an environment that is no address of the importer's. */
        callbacks->logger(is("stray") ? (void *)1 : callbacks->env, "it", 3, "logAll", "%s at %g s: %d %d %d|%g %g %g %g %g %g %g %g %s", "V7",
                          from, 1, 2, 3, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5, 8.5, "end");
        return 3;
    } else if (is("error") || is("grumbles")) {
        return 3;
    } else if (is("print")) {
        write(1, "hello\n", 6);
    } else if (is("close") || is("hang")) {
        write(1, "hangs\n", 6);
        for (int file = 0; is("close") && file < 100; file++) {
            close(file);
        }
        for (;;) {
            pause();
        }
    }
    now = from + length;
    return 0;
}

int fmi2GetBooleanStatus(void *it, int kind, int *value) { return (void)it, (void)kind, *value = is("ended"), is("lost") ? 4 : 0; }

int fmi2GetRealStatus(void *it, int kind, double *value) {
    if (is("lost")) {
        abort(); /* nothing may be called after a fatal answer */
    }
    return (void)it, (void)kind, *value = now, 0;
}
