/* One instance of a ship model exported by shipbench, and its advance in time. Used by fmi2.c and fmi3.c.
 * Variables by their value reference: 0 time, then the inputs, the states, the start values of the states. */
#ifndef CO_SIMULATION_H
#define CO_SIMULATION_H

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "config.h"

typedef struct {
  double z[MODEL_MEMORY], u[MODEL_INPUTS], s[MODEL_STATES], s0[MODEL_STATES], time;
  int started;
} Model;

static const double model_start_values[MODEL_STATES] = MODEL_START_VALUES;
static const double model_input_values[MODEL_INPUTS] = MODEL_INPUT_VALUES;

static void model_reset(Model *m) {
  memset(m, 0, sizeof *m);
  memcpy(m->s0, model_start_values, sizeof m->s0);
  memcpy(m->u, model_input_values, sizeof m->u);
}

static const double *model_get(const Model *m, unsigned int reference) {
  if (reference == 0) return &m->time;
  reference -= 1;
  if (reference < MODEL_INPUTS) return &m->u[reference];
  reference -= MODEL_INPUTS;
  if (reference < MODEL_STATES) return m->started ? &m->s[reference] : &m->s0[reference];
  reference -= MODEL_STATES;
  return reference < MODEL_STATES ? &m->s0[reference] : NULL;
}

/* 0: done; 1: no variable that may be set now. */
static int model_set(Model *m, unsigned int reference, double value) {
  if (reference >= 1 && reference <= MODEL_INPUTS) {
    m->u[reference - 1] = value;
    return 0;
  }
  if (m->started || reference < 1 + MODEL_INPUTS + MODEL_STATES || !model_get(m, reference)) return 1;
  m->s0[reference - 1 - MODEL_INPUTS - MODEL_STATES] = value;
  return 0;
}

/* Message of what went wrong in a step of `length` seconds, or NULL. The inputs are held over it. */
static const char *model_advance(Model *m, double length) {
  const double number = length / MODEL_DT, whole = floor(number + 1e-8);
  const double rest = number - whole > 1e-8 ? (number - whole) * MODEL_DT : 0.0;
  if (!(length >= 0.0)) return "the communication step is negative";
  if (rest > 0.0 && !MODEL_ANY_STEP)
    return "the communication step is no multiple of the model's sample time; see the description of this FMU";
  if (!m->started) {
    MODEL_START(m->s0, m->u, m->z);
    memcpy(m->s, m->s0, sizeof m->s);
    m->started = 1;
  }
  for (double k = 0.0; k < whole; k += 1.0) MODEL_STEP(m->z, m->u, MODEL_DT, m->z, m->s);
  if (rest > 0.0) MODEL_STEP(m->z, m->u, rest, m->z, m->s);
  for (int i = 0; i < MODEL_STATES; i++)
    if (!(fabs(m->s[i]) <= 1e300)) return "the motion diverged";
  return NULL;
}

#endif
