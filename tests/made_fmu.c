/* Ship with three degrees of freedom as an FMU, for tests: FMI 2 or 3 (-DFMI=2, -DFMI=3), co-simulation and model
 * exchange in one library. Compiled by tests/made_fmu.py. */
#include <math.h>
#include <signal.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { N_C, DELTA_C, X, Y, PSI, SURGE, SWAY, YAW, N, DELTA, FIRST }; /* value references of inputs and states */
#define STATES 8
#define PARAMETERS 13 /* the last one: trouble */
#define VALUES (FIRST + PARAMETERS)
enum { XNN = FIRST, XUU, XVR, XDD, YV, YR, YD, NV, NR, NRR, ND, LAG, TROUBLE };

static const double start_values[VALUES] = {
    90.0, 0.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 90.0, 0.0,
    1.2e-6, -4.0e-4, 0.6, -2.0e-3, -0.010, -0.30, 4.0e-4, -8.0e-5, -0.012, -3.0, -6.0e-5, 3.0, 0.0};

typedef struct {
  double v[VALUES], t;
  void (*log)(void *, const char *, int, const char *, const char *, ...); /* FMI 2 */
  void (*log_message)(void *, int, const char *, const char *);            /* FMI 3 */
} Ship;

static void rates(const double *v, double *d) {
  double u = v[SURGE], w = v[SWAY], r = v[YAW], rudder = v[DELTA];
  d[0] = u * cos(v[PSI]) - w * sin(v[PSI]);
  d[1] = u * sin(v[PSI]) + w * cos(v[PSI]);
  d[2] = r;
  d[3] = v[XNN] * v[N] * fabs(v[N]) + v[XUU] * u * fabs(u) + v[XVR] * w * r + v[XDD] * u * u * rudder * rudder;
  d[4] = v[YV] * u * w + v[YR] * u * r - v[YD] * u * u * rudder;
  d[5] = v[NV] * u * w + v[NR] * u * r + v[NRR] * r * fabs(r) - v[ND] * u * u * rudder;
  d[6] = (v[N_C] - v[N]) / v[LAG];
  d[7] = (v[DELTA_C] - v[DELTA]) / v[LAG];
}

static int advance(Ship *s, double h) {
  int trouble = (int)s->v[TROUBLE];
  if (trouble == 1 && s->t > 5.0) raise(SIGSEGV);
  if (trouble == 2 && s->t > 5.0) for (;;) sleep(1);
  if (trouble == 3 && s->t > 5.0) {
    if (s->log) s->log(NULL, "ship", 3, "error", "rudder lost after %g s", s->t);
    if (s->log_message) s->log_message(NULL, 3, "error", "rudder lost");
    return 3;
  }
  int parts = (int)ceil(h / 0.25 - 1e-9);
  for (int i = 0; i < parts; i++) { /* midpoint rule */
    double d[STATES], mid[VALUES], part = h / parts;
    rates(s->v, d);
    memcpy(mid, s->v, sizeof mid);
    for (int k = 0; k < STATES; k++) mid[X + k] += 0.5 * part * d[k];
    rates(mid, d);
    for (int k = 0; k < STATES; k++) s->v[X + k] += part * d[k];
  }
  s->t += h;
  return 0;
}

static Ship *made(void) {
  Ship *s = calloc(1, sizeof *s);
  memcpy(s->v, start_values, sizeof s->v);
  s->t = 0.0;
  return s;
}

static int reset(Ship *s) {
  double kept = s->v[SURGE];
  int trouble = (int)s->v[TROUBLE];
  memcpy(s->v, start_values, sizeof s->v);
  s->t = 0.0;
  if (trouble == 4) s->v[XNN] += 1e-9 * kept; /* leaves something behind */
  return 0;
}

static int set(Ship *s, const unsigned *vr, size_t n, const double *values) {
  for (size_t i = 0; i < n; i++) {
    if (vr[i] >= VALUES) return 3;
    s->v[vr[i]] = values[i];
  }
  return 0;
}

static int get(Ship *s, const unsigned *vr, size_t n, double *values) {
  for (size_t i = 0; i < n; i++) values[i] = s->v[vr[i]];
  return 0;
}

static int derivatives(Ship *s, double *d) { rates(s->v, d); return 0; }

#if FMI == 2
typedef struct { int needed, end, nominals, changed, defined; double next; } Event;
void *fmi2Instantiate(const char *n, int k, const char *g, const char *r, void *const *c, int v, int l) {
  Ship *s = made();
  s->log = c[0];
  return s;
}
void fmi2FreeInstance(Ship *s) { free(s); }
int fmi2SetupExperiment(Ship *s, int a, double b, double t, int c, double d) { s->t = t; return 0; }
int fmi2EnterInitializationMode(Ship *s) { return 0; }
int fmi2ExitInitializationMode(Ship *s) { return 0; }
int fmi2Terminate(Ship *s) { return 0; }
int fmi2Reset(Ship *s) { return reset(s); }
int fmi2SetReal(Ship *s, const unsigned *vr, size_t n, const double *x) { return set(s, vr, n, x); }
int fmi2GetReal(Ship *s, const unsigned *vr, size_t n, double *x) { return get(s, vr, n, x); }
int fmi2DoStep(Ship *s, double t, double h, int a) { return advance(s, h); }
int fmi2NewDiscreteStates(Ship *s, Event *e) { memset(e, 0, sizeof *e); return 0; }
int fmi2EnterEventMode(Ship *s) { return 0; }
int fmi2EnterContinuousTimeMode(Ship *s) { return 0; }
int fmi2CompletedIntegratorStep(Ship *s, int a, int *e, int *t) { *e = *t = 0; return 0; }
int fmi2SetTime(Ship *s, double t) { s->t = t; return 0; }
int fmi2SetContinuousStates(Ship *s, const double *x, size_t n) { memcpy(s->v + X, x, n * sizeof *x); return 0; }
int fmi2GetContinuousStates(Ship *s, double *x, size_t n) { memcpy(x, s->v + X, n * sizeof *x); return 0; }
int fmi2GetDerivatives(Ship *s, double *x, size_t n) { return derivatives(s, x); }
#else
#include <stdbool.h>
void *fmi3InstantiateCoSimulation(const char *n, const char *t, const char *r, bool v, bool l, bool e, bool a,
                                  const unsigned *q, size_t k, void *i, void *m, void *u) {
  Ship *s = made();
  s->log_message = m;
  return s;
}
void *fmi3InstantiateModelExchange(const char *n, const char *t, const char *r, bool v, bool l, void *i, void *m) {
  return made();
}
void fmi3FreeInstance(Ship *s) { free(s); }
int fmi3EnterInitializationMode(Ship *s, bool a, double b, double t, bool c, double d) { s->t = t; return 0; }
int fmi3ExitInitializationMode(Ship *s) { return 0; }
int fmi3Terminate(Ship *s) { return 0; }
int fmi3Reset(Ship *s) { return reset(s); }
int fmi3SetFloat64(Ship *s, const unsigned *vr, size_t n, const double *x, size_t m) { return set(s, vr, n, x); }
int fmi3GetFloat64(Ship *s, const unsigned *vr, size_t n, double *x, size_t m) { return get(s, vr, n, x); }
int fmi3DoStep(Ship *s, double t, double h, bool a, bool *e, bool *d, bool *f, double *l) {
  *e = *d = *f = false;
  *l = t + h;
  return advance(s, h);
}
int fmi3UpdateDiscreteStates(Ship *s, bool *a, bool *b, bool *c, bool *d, bool *e, double *t) {
  *a = *b = *c = *d = *e = false;
  return 0;
}
int fmi3EnterEventMode(Ship *s) { return 0; }
int fmi3EnterContinuousTimeMode(Ship *s) { return 0; }
int fmi3CompletedIntegratorStep(Ship *s, bool a, bool *e, bool *t) { *e = *t = false; return 0; }
int fmi3SetTime(Ship *s, double t) { s->t = t; return 0; }
int fmi3SetContinuousStates(Ship *s, const double *x, size_t n) { memcpy(s->v + X, x, n * sizeof *x); return 0; }
int fmi3GetContinuousStates(Ship *s, double *x, size_t n) { memcpy(x, s->v + X, n * sizeof *x); return 0; }
int fmi3GetContinuousStateDerivatives(Ship *s, double *x, size_t n) { return derivatives(s, x); }
#endif
STUBS
