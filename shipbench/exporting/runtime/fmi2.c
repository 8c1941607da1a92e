/* FMI 2.0 for co-simulation (www.fmi-standard.org) of a ship model exported by shipbench.
 * The declarations are those of the standard; -DFMI_HEADERS takes its own headers instead. */
#include <stdio.h>
#include <stdlib.h>

#include "co_simulation.h"

#ifdef FMI_HEADERS
#include "fmi2Functions.h"
#else
#if defined(_WIN32)
#define FMI2_Export __declspec(dllexport)
#elif defined(__GNUC__)
#define FMI2_Export __attribute__((visibility("default")))
#else
#define FMI2_Export
#endif
typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef char fmi2Byte;
typedef const char *fmi2String;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef struct {
  void (*logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
  void *(*allocateMemory)(size_t, size_t);
  void (*freeMemory)(void *);
  void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
  fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;
#endif

typedef struct {
  Model model;
  const fmi2CallbackFunctions *callbacks;
  char name[256];
} Instance;

#define MODEL(c) (&((Instance *)(c))->model)

static fmi2Status failed(fmi2Component c, const char *message) {
  const Instance *i = c;
  if (i->callbacks && i->callbacks->logger)
    i->callbacks->logger(i->callbacks->componentEnvironment, i->name, fmi2Error, "logStatusError", "%s", message);
  return fmi2Error;
}

static fmi2Status absent(fmi2Component c, size_t number) {
  return number ? failed(c, "this FMU has no such variable or function") : fmi2OK;
}

FMI2_Export const char *fmi2GetTypesPlatform(void) { return "default"; }
FMI2_Export const char *fmi2GetVersion(void) { return "2.0"; }
FMI2_Export fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
  (void)c, (void)on, (void)n, (void)categories;
  return fmi2OK;
}

FMI2_Export fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean on) {
  (void)resources, (void)visible, (void)on;
  Instance *i = type == fmi2CoSimulation && guid && !strcmp(guid, MODEL_TOKEN) ? calloc(1, sizeof *i) : NULL;
  if (!i) return NULL;
  i->callbacks = callbacks;
  snprintf(i->name, sizeof i->name, "%s", name ? name : "");
  model_reset(&i->model);
  return i;
}
FMI2_Export void fmi2FreeInstance(fmi2Component c) { free(c); }

FMI2_Export fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
                                           fmi2Real start, fmi2Boolean has_stop, fmi2Real stop) {
  (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
  MODEL(c)->time = start;
  return fmi2OK;
}
FMI2_Export fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
FMI2_Export fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
FMI2_Export fmi2Status fmi2Terminate(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
FMI2_Export fmi2Status fmi2Reset(fmi2Component c) {
  model_reset(MODEL(c));
  return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
  for (size_t k = 0; k < n; k++) {
    const double *from = model_get(MODEL(c), vr[k]);
    if (!from) return absent(c, 1);
    value[k] = *from;
  }
  return fmi2OK;
}
FMI2_Export fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
  for (size_t k = 0; k < n; k++)
    if (model_set(MODEL(c), vr[k], value[k])) return failed(c, "this variable cannot be set now");
  return fmi2OK;
}
#define NO_VARIABLES(Type)                                                                                             \
  FMI2_Export fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2##Type value[]) { \
    (void)vr, (void)value;                                                                                             \
    return absent(c, n);                                                                                               \
  }                                                                                                                    \
  FMI2_Export fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference vr[], size_t n,                       \
                                       const fmi2##Type value[]) {                                                     \
    (void)vr, (void)value;                                                                                             \
    return absent(c, n);                                                                                               \
  }
NO_VARIABLES(Integer)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

FMI2_Export fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
  if (!*state && !(*state = malloc(sizeof(Model)))) return fmi2Error;
  memcpy(*state, MODEL(c), sizeof(Model));
  return fmi2OK;
}
FMI2_Export fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
  memcpy(MODEL(c), state, sizeof(Model));
  return fmi2OK;
}
FMI2_Export fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
  (void)c;
  free(*state);
  *state = NULL;
  return fmi2OK;
}
FMI2_Export fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
  (void)c, (void)state;
  *size = sizeof(Model);
  return fmi2OK;
}
FMI2_Export fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
  if (size < sizeof(Model)) return absent(c, 1);
  memcpy(bytes, state, sizeof(Model));
  return fmi2OK;
}
FMI2_Export fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                               fmi2FMUstate *state) {
  if (size != sizeof(Model)) return absent(c, 1);
  if (!*state && !(*state = malloc(sizeof(Model)))) return fmi2Error;
  memcpy(*state, bytes, sizeof(Model));
  return fmi2OK;
}

FMI2_Export fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real length, fmi2Boolean forward) {
  (void)forward;
  const char *message = model_advance(MODEL(c), length);
  if (message) return failed(c, message);
  MODEL(c)->time = time + length;
  return fmi2OK;
}
FMI2_Export fmi2Status fmi2CancelStep(fmi2Component c) { return absent(c, 1); }

FMI2_Export fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n,
                                                    const fmi2ValueReference known[], size_t m, const fmi2Real dv[],
                                                    fmi2Real dz[]) {
  (void)unknown, (void)known, (void)m, (void)dv, (void)dz;
  return absent(c, n);
}
FMI2_Export fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                                   const fmi2Integer order[], const fmi2Real value[]) {
  (void)vr, (void)order, (void)value;
  return absent(c, n);
}
FMI2_Export fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                                    const fmi2Integer order[], fmi2Real value[]) {
  (void)vr, (void)order, (void)value;
  return absent(c, n);
}
FMI2_Export fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
  (void)c, (void)kind, (void)value;
  return fmi2Discard;
}
FMI2_Export fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
  if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
  *value = MODEL(c)->time;
  return fmi2OK;
}
FMI2_Export fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
  (void)c, (void)kind, (void)value;
  return fmi2Discard;
}
FMI2_Export fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
  (void)c;
  if (kind != fmi2Terminated) return fmi2Discard;
  *value = 0;
  return fmi2OK;
}
FMI2_Export fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
  (void)c, (void)kind, (void)value;
  return fmi2Discard;
}
