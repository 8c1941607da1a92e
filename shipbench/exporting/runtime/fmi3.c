/* FMI 3.0 for co-simulation (www.fmi-standard.org) of a ship model exported by shipbench.
 * The declarations are those of the standard; -DFMI_HEADERS takes its own headers instead. */
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

#include "co_simulation.h"

#ifdef FMI_HEADERS
#include "fmi3Functions.h"
#else
#if defined(_WIN32)
#define FMI3_Export __declspec(dllexport)
#elif defined(__GNUC__)
#define FMI3_Export __attribute__((visibility("default")))
#else
#define FMI3_Export
#endif
typedef void *fmi3Instance, *fmi3InstanceEnvironment, *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8, fmi3Byte;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean, fmi3Clock;
typedef const char *fmi3String;
typedef const fmi3Byte *fmi3Binary;
typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum {
  fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent
} fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;
typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String, fmi3String);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean, fmi3Boolean,
                                               fmi3Boolean, fmi3Boolean, fmi3Boolean *, fmi3Float64 *);
typedef void (*fmi3LockPreemptionCallback)();
typedef void (*fmi3UnlockPreemptionCallback)();
#endif

typedef struct {
  Model model;
  fmi3InstanceEnvironment environment;
  fmi3LogMessageCallback log;
} Instance;

#define MODEL(c) (&((Instance *)(c))->model)

static fmi3Status failed(fmi3Instance c, const char *message) {
  const Instance *i = c;
  if (i && i->log) i->log(i->environment, fmi3Error, "logStatusError", message);
  return fmi3Error;
}

FMI3_Export const char *fmi3GetVersion(void) { return "3.0"; }
FMI3_Export fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String categories[]) {
  (void)c, (void)on, (void)n, (void)categories;
  return fmi3OK;
}

FMI3_Export fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean on, fmi3Boolean events,
    fmi3Boolean early, const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
  (void)name, (void)resources, (void)visible, (void)on, (void)events, (void)early, (void)required, (void)n;
  (void)update;
  Instance *i = token && !strcmp(token, MODEL_TOKEN) ? calloc(1, sizeof *i) : NULL;
  if (!i) return NULL;
  i->environment = environment;
  i->log = log;
  model_reset(&i->model);
  return i;
}
FMI3_Export fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                                      fmi3Boolean visible, fmi3Boolean on,
                                                      fmi3InstanceEnvironment environment,
                                                      fmi3LogMessageCallback log) {
  (void)name, (void)token, (void)resources, (void)visible, (void)on, (void)environment, (void)log;
  return NULL;
}
FMI3_Export fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean on,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
    fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock) {
  (void)name, (void)token, (void)resources, (void)visible, (void)on, (void)environment, (void)log, (void)update;
  (void)lock, (void)unlock;
  return NULL;
}
FMI3_Export void fmi3FreeInstance(fmi3Instance c) { free(c); }

FMI3_Export fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                                   fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop) {
  (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
  MODEL(c)->time = start;
  return fmi3OK;
}
FMI3_Export fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
FMI3_Export fmi3Status fmi3EnterStepMode(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
FMI3_Export fmi3Status fmi3Terminate(fmi3Instance c) { return c ? fmi3OK : fmi3Error; }
FMI3_Export fmi3Status fmi3Reset(fmi3Instance c) {
  model_reset(MODEL(c));
  return fmi3OK;
}

FMI3_Export fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 values[],
                                      size_t size) {
  for (size_t k = 0; k < n && k < size; k++) {
    const double *from = model_get(MODEL(c), vr[k]);
    if (!from) return failed(c, "this FMU has no such variable");
    values[k] = *from;
  }
  return n == size ? fmi3OK : failed(c, "the numbers of variables and of values differ");
}
FMI3_Export fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n,
                                      const fmi3Float64 values[], size_t size) {
  for (size_t k = 0; k < n && k < size; k++)
    if (model_set(MODEL(c), vr[k], values[k])) return failed(c, "this variable cannot be set now");
  return n == size ? fmi3OK : failed(c, "the numbers of variables and of values differ");
}

FMI3_Export fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) {
  if (!*state && !(*state = malloc(sizeof(Model)))) return fmi3Error;
  memcpy(*state, MODEL(c), sizeof(Model));
  return fmi3OK;
}
FMI3_Export fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) {
  memcpy(MODEL(c), state, sizeof(Model));
  return fmi3OK;
}
FMI3_Export fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) {
  (void)c;
  free(*state);
  *state = NULL;
  return fmi3OK;
}
FMI3_Export fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
  (void)c, (void)state;
  *size = sizeof(Model);
  return fmi3OK;
}
FMI3_Export fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
  if (size < sizeof(Model)) return failed(c, "too few bytes for the state");
  memcpy(bytes, state, sizeof(Model));
  return fmi3OK;
}
FMI3_Export fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size,
                                               fmi3FMUState *state) {
  if (size != sizeof(Model)) return failed(c, "these bytes are no state of this FMU");
  if (!*state && !(*state = malloc(sizeof(Model)))) return fmi3Error;
  memcpy(*state, bytes, sizeof(Model));
  return fmi3OK;
}

FMI3_Export fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 length, fmi3Boolean forward,
                                  fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
  (void)forward;
  const char *message = model_advance(MODEL(c), length);
  if (!message) MODEL(c)->time = time + length;
  *event = *terminate = *early = false;
  *last = MODEL(c)->time;
  return message ? failed(c, message) : fmi3OK;
}

/* What a co-simulation with real variables alone does not have. */
#define NO_VARIABLES(Type)                                                                                             \
  FMI3_Export fmi3Status fmi3Get##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3##Type values[],   \
                                       size_t size) {                                                                  \
    (void)vr, (void)values, (void)size;                                                                                \
    return n ? failed(c, "this FMU has no variables of type " #Type) : fmi3OK;                                         \
  }                                                                                                                    \
  FMI3_Export fmi3Status fmi3Set##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t n,                        \
                                       const fmi3##Type values[], size_t size) {                                       \
    (void)vr, (void)values, (void)size;                                                                                \
    return n ? failed(c, "this FMU has no variables of type " #Type) : fmi3OK;                                         \
  }
NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(Int32)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)

#define ABSENT(function, parameters)                                                                                   \
  FMI3_Export fmi3Status function parameters {                                                                         \
    return failed(c, "this FMU does not offer " #function);                                                            \
  }
#define REFERENCES fmi3Instance c, const fmi3ValueReference vr[], size_t n
#define PARTIAL                                                                                                        \
  const fmi3ValueReference unknowns[], size_t n, const fmi3ValueReference knowns[], size_t m,                          \
      const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity
ABSENT(fmi3GetBinary, (REFERENCES, size_t sizes[], fmi3Binary values[], size_t size))
ABSENT(fmi3SetBinary, (REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t size))
ABSENT(fmi3GetClock, (REFERENCES, fmi3Clock values[]))
ABSENT(fmi3SetClock, (REFERENCES, const fmi3Clock values[]))
ABSENT(fmi3GetNumberOfVariableDependencies, (fmi3Instance c, fmi3ValueReference vr, size_t *n))
ABSENT(fmi3GetVariableDependencies,
       (fmi3Instance c, fmi3ValueReference vr, size_t of[], fmi3ValueReference on[], size_t elements[],
        fmi3DependencyKind kinds[], size_t n))
ABSENT(fmi3GetDirectionalDerivative, (fmi3Instance c, PARTIAL))
ABSENT(fmi3GetAdjointDerivative, (fmi3Instance c, PARTIAL))
ABSENT(fmi3EnterConfigurationMode, (fmi3Instance c))
ABSENT(fmi3ExitConfigurationMode, (fmi3Instance c))
ABSENT(fmi3EnterEventMode, (fmi3Instance c))
ABSENT(fmi3GetIntervalDecimal, (REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]))
ABSENT(fmi3GetIntervalFraction, (REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
       fmi3IntervalQualifier qualifiers[]))
ABSENT(fmi3GetShiftDecimal, (REFERENCES, fmi3Float64 shifts[]))
ABSENT(fmi3GetShiftFraction, (REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[]))
ABSENT(fmi3SetIntervalDecimal, (REFERENCES, const fmi3Float64 intervals[]))
ABSENT(fmi3SetIntervalFraction, (REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]))
ABSENT(fmi3SetShiftDecimal, (REFERENCES, const fmi3Float64 shifts[]))
ABSENT(fmi3SetShiftFraction, (REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]))
ABSENT(fmi3EvaluateDiscreteStates, (fmi3Instance c))
ABSENT(fmi3UpdateDiscreteStates, (fmi3Instance c, fmi3Boolean *update, fmi3Boolean *terminate, fmi3Boolean *nominals,
       fmi3Boolean *values, fmi3Boolean *defined, fmi3Float64 *time))
ABSENT(fmi3EnterContinuousTimeMode, (fmi3Instance c))
ABSENT(fmi3CompletedIntegratorStep, (fmi3Instance c, fmi3Boolean forward, fmi3Boolean *event, fmi3Boolean *terminate))
ABSENT(fmi3SetTime, (fmi3Instance c, fmi3Float64 time))
ABSENT(fmi3SetContinuousStates, (fmi3Instance c, const fmi3Float64 states[], size_t n))
ABSENT(fmi3GetContinuousStateDerivatives, (fmi3Instance c, fmi3Float64 derivatives[], size_t n))
ABSENT(fmi3GetEventIndicators, (fmi3Instance c, fmi3Float64 indicators[], size_t n))
ABSENT(fmi3GetContinuousStates, (fmi3Instance c, fmi3Float64 states[], size_t n))
ABSENT(fmi3GetNominalsOfContinuousStates, (fmi3Instance c, fmi3Float64 nominals[], size_t n))
ABSENT(fmi3GetNumberOfEventIndicators, (fmi3Instance c, size_t *n))
ABSENT(fmi3GetNumberOfContinuousStates, (fmi3Instance c, size_t *n))
ABSENT(fmi3GetOutputDerivatives, (REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t size))
ABSENT(fmi3ActivateModelPartition, (fmi3Instance c, fmi3ValueReference clock, fmi3Float64 time))
