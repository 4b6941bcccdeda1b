/*
 * A force along a known motion, with its exact derivatives; the terms' own states alone are integrated. The registers of
 * the program: 0 u, 1 v, 2 t, 3 unused, then the channels, the states, coefficients and shape parameters.
 */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program.h"

typedef struct {
    Program program;
    const int64_t *slots; /* row 0: registers of the force and its derivatives by states and keys; then of the slopes */
    int64_t slot_width, states, columns, channels;
    const double *drive; /* displacement, velocity, channels: two rows a step */
    double *state, *trial, *slope, *sum;
} Memory;

/* What row `row` of the slots computes, beside its derivatives by keys and by the states at the beginning. */
static void chain(const Memory *memory, int64_t row, double *out) {
    const int64_t *slots = memory->slots + row * memory->slot_width;
    const double *r = memory->program.r;
    int64_t n = memory->states, columns = memory->columns;
    out[0] = r[slots[0]];
    for (int64_t c = 1; c < columns; c++) {
        out[c] = n + c < memory->slot_width ? r[slots[n + c]] : 0.0;
        for (int64_t m = 0; m < n; m++) out[c] += r[slots[1 + m]] * memory->trial[m * columns + c];
    }
}

/* Registers along the motion at the states `trial`, and the derivatives of these. */
static void slopes_along(const Memory *memory, double time, int64_t row) {
    const double *drive = memory->drive + row * (2 + memory->channels);
    double *r = memory->program.r;
    r[0] = drive[0];
    r[1] = drive[1];
    r[2] = time;
    for (int64_t c = 0; c < memory->channels; c++) r[4 + c] = drive[2 + c];
    for (int64_t i = 0; i < memory->states; i++) r[4 + memory->channels + i] = memory->trial[i * memory->columns];
    run_prepared(&memory->program);
    for (int64_t i = 0; i < memory->states; i++) chain(memory, i + 1, memory->slope + i * memory->columns);
}

static void step(const Memory *memory, double begin, int64_t s, double h, int64_t row) {
    int64_t size = memory->states * memory->columns;
    memcpy(memory->trial, memory->state, (size_t)size * sizeof(double));
    memcpy(memory->sum, memory->state, (size_t)size * sizeof(double));
    for (int stage = 0; stage < 4; stage++) {
        int late = (stage + 1) / 2;
        slopes_along(memory, begin + ((double)s + 0.5 * late) * h, row + late);
        double weight = late == 1 ? h / 3.0 : h / 6.0, ahead = stage == 2 ? h : 0.5 * h;
        for (int64_t i = 0; i < size; i++) {
            memory->sum[i] += weight * memory->slope[i];
            memory->trial[i] = memory->state[i] + ahead * memory->slope[i];
        }
    }
    memcpy(memory->state, memory->sum, (size_t)size * sizeof(double));
}

/* One segment from its first sample to before that of the next. */
static int64_t along(
    const Memory *memory, double start, double dt, int64_t steps, int64_t first, int64_t end, double *out
) {
    int64_t size = memory->states * memory->columns;
    for (int64_t sample = first; sample < end; sample++) {
        double time = start + (double)(sample - first) * dt;
        memcpy(memory->trial, memory->state, (size_t)size * sizeof(double));
        slopes_along(memory, time, 2 * steps * sample);
        chain(memory, 0, out + sample * memory->columns);
        if (!isfinite(out[sample * memory->columns])) return sample;
        if (memory->states == 0 || sample + 1 == end) continue;
        for (int64_t s = 0; s < steps; s++) step(memory, time, s, dt / (double)steps, 2 * (steps * sample + s));
    }
    return ALL_FINITE;
}

/* `states` has, of each segment between neighbouring `bounds`, the states beside their sensitivities. */
EXPORT int64_t integrate_known(
    const int64_t *code, int64_t count, int64_t first, double *r, const int64_t *slots, int64_t slot_width,
    const double *starts, double dt, int64_t steps, const double *drive, int64_t channels, const int64_t *bounds,
    int64_t bound_count, const double *states, int64_t state_count, int64_t columns, double *out
) {
    Memory memory = {.slots = slots, .slot_width = slot_width, .states = state_count, .columns = columns,
                     .channels = channels, .drive = drive};
    size_t size = (size_t)(state_count * columns);
    int64_t failed = NO_MEMORY;
    memory.state = calloc(4 * size + 1, sizeof(double));
    if (memory.state && prepare_program(&memory.program, code, count, first, r, 4 + channels + state_count, 0, 0)) {
        memory.trial = memory.state + size;
        memory.slope = memory.state + 2 * size;
        memory.sum = memory.state + 3 * size;
        failed = ALL_FINITE;
        for (int64_t k = 0; k + 1 < bound_count && failed == ALL_FINITE; k++) {
            memcpy(memory.state, states + (size_t)k * size, size * sizeof(double));
            failed = along(&memory, starts[k], dt, steps, bounds[k], bounds[k + 1], out);
        }
        forget_program(&memory.program);
    }
    free(memory.state);
    return failed;
}
