/* standin.h: the common part of the stand-ins for vendors' libraries.
 *
 * Two files lie beside the library: `calls`, to which each call is added as a line (without repetitions), and `script`,
 * which a test writes: lines "FUNCTION CODE" or "FUNCTION hang". A function named there returns that code instead of
 * doing its work, or does not return while the line is there; "FUNCTION(ARGUMENT" restricts this to calls with this
 * first argument.
 */
#define _GNU_SOURCE

#include <dlfcn.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static FILE *beside(const char *name, const char *mode) {
    Dl_info self;
    char path[1000];
    const char *slash;
    if (!dladdr((void *)&lock, &self) || (slash = strrchr(self.dli_fname, '/')) == NULL)
        abort();
    snprintf(path, sizeof path, "%.*s/%s", (int)(slash - self.dli_fname), self.dli_fname, name);
    return fopen(path, mode);
}

/* Whether the script has this function; then its code is in `code`. */
static int scripted(const char *function, long *code) {
    char line[200], name[100], what[100];
    for (;;) {
        FILE *script = beside("script", "r");
        int found = 0;
        if (script == NULL)
            return 0;
        while (!found && fgets(line, sizeof line, script) != NULL)
            found = sscanf(line, "%99s %99s", name, what) == 2 && strcmp(name, function) == 0;
        fclose(script);
        if (!found)
            return 0;
        if (strcmp(what, "hang") != 0) {
            *code = (long)strtoll(what, NULL, 0);
            return 1;
        }
        nanosleep(&(struct timespec){0, 2000000}, NULL);
    }
}

/* Adds a call, with its arguments, to the file; returns what `scripted` does. */
static int called(long *code, const char *function, const char *format, ...) {
    static char last[300];
    char arguments[200], line[300];
    size_t first;
    va_list values;
    va_start(values, format);
    vsnprintf(arguments, sizeof arguments, format, values);
    va_end(values);
    snprintf(line, sizeof line, "%s(%s)", function, arguments);
    pthread_mutex_lock(&lock);
    if (strcmp(line, last) != 0) {
        FILE *calls = beside("calls", "a");
        strcpy(last, line);
        if (calls != NULL) {
            fprintf(calls, "%s\n", line);
            fclose(calls);
        }
    }
    pthread_mutex_unlock(&lock);
    *code = 0;
    first = strcspn(line, ",)");
    line[first] = 0;
    return scripted(function, code) || scripted(line, code);
}
