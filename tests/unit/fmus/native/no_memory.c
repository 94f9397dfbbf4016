/* A host with little memory: of the allocations of an FMU only the first few succeed. */
#include "platform.h"

#include <stdio.h>
#include <stdlib.h>

static int left, failures;

static int succeeds(void) {
    if (left > 0) return left--;
    failures++;
    return 0;
}

static void *allocated(size_t size) { return succeeds() ? malloc(size) : NULL; }

static void *cleared(size_t n, size_t size) { return succeeds() ? calloc(n, size) : NULL; }

#define malloc allocated
#define calloc cleared
#include "fmi2.c"

/* Calls for which there is enough memory are answered as usual. */
static void note(int status, int expected) {
    if (status != FMI_ERROR && status != expected) exit(1);
    if (status != expected && failures == 0) exit(3);
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
    if (c == NULL) return;
    note(fmi2SetDebugLogging(c, 1, 2, categories), FMI_OK);
    note(fmi2Reset(c), FMI_OK);
    note(fmi2GetReal(c, &unknown, 1, &value), FMI_ERROR);
    note(fmi2Reset(c), FMI_OK);
    note(fmi2GetReal(c, &unknown, 1, &value), FMI_ERROR);
    note(fmi2GetFMUstate(c, &states[0]), FMI_OK);
    note(fmi2GetFMUstate(c, &states[0]), FMI_OK);
    if (states[0] != NULL) {
        note(fmi2SerializedFMUstateSize(c, states[0], &size), FMI_OK);
        note(fmi2SerializeFMUstate(c, states[0], bytes, size), FMI_OK);
        note(fmi2DeSerializeFMUstate(c, bytes, size, &states[1]), FMI_OK);
        note(fmi2SetFMUstate(c, states[0]), FMI_OK);
    }
    note(fmi2DeSerializeFMUstate(c, "garbage", 7, &states[2]), FMI_OK);
    if (states[2] != NULL) note(fmi2SetFMUstate(c, states[2]), FMI_ERROR);
    note(fmi2Reset(c), FMI_OK);
    note(fmi2EnterInitializationMode(c), FMI_OK);
    note(fmi2ExitInitializationMode(c), FMI_OK);
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
