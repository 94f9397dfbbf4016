/* A host with little memory: of the allocations of an FMU only the first few succeed. */
#include "platform.h"

#include <stdio.h>
#include <stdlib.h>

static int left;

static void *allocated(size_t size) { return left-- > 0 ? malloc(size) : NULL; }

static void *cleared(size_t n, size_t size) { return left-- > 0 ? calloc(n, size) : NULL; }

#define malloc allocated
#define calloc cleared
#include "fmi2.c"

static int failures;

static void note(int status) {
    if (status == FMI_ERROR) failures++;
    if (status == FMI_FATAL) exit(1);
}

static void hear(void *environment, string name, int status, string category, string text, ...) {
    (void)environment, (void)name, (void)status, (void)category, (void)text;
}

static void play(void) {
    const string categories[] = {"logStatusDiscard", "logStatusWarning"};
    const callbacks functions = {hear, NULL, NULL, NULL, NULL};
    const uint32_t unknown = 1000;
    double value = 0.0;
    char bytes[8192];
    void *states[3] = {NULL, NULL, NULL}, *c;
    size_t size = 0;
    c = fmi2Instantiate("little", CO_SIMULATION, NULL, NULL, &functions, 0, 1);
    if (c == NULL) {
        failures++;
        return;
    }
    note(fmi2SetDebugLogging(c, 1, 2, categories));
    note(fmi2Reset(c));
    note(fmi2GetReal(c, &unknown, 1, &value));
    note(fmi2Reset(c));
    note(fmi2GetReal(c, &unknown, 1, &value));
    note(fmi2GetFMUstate(c, &states[0]));
    note(fmi2GetFMUstate(c, &states[0]));
    if (states[0] != NULL) {
        note(fmi2SerializedFMUstateSize(c, states[0], &size));
        note(fmi2SerializeFMUstate(c, states[0], bytes, size));
        note(fmi2DeSerializeFMUstate(c, bytes, size, &states[1]));
        note(fmi2SetFMUstate(c, states[0]));
    }
    note(fmi2DeSerializeFMUstate(c, "garbage", 7, &states[2]));
    if (states[2] != NULL) note(fmi2SetFMUstate(c, states[2]));
    note(fmi2Reset(c));
    note(fmi2EnterInitializationMode(c));
    note(fmi2ExitInitializationMode(c));
    if (fmi2DoStep(c, 0.0, 0.02, 1) != FMI_OK) exit(2);
    fmi2FreeInstance(c);
}

/* Says with how much memory nothing fails. */
int main(void) {
    for (int n = 0;; n++) {
        left = n;
        failures = 0;
        play();
        if (failures > 0) continue;
        printf("%d\n", n);
        return 0;
    }
}
