/*
 * Integration of one coordinate without derivatives. A state is (u, v, z...); the program computes its derivatives
 * (v, a, dz...) from registers: 0 u, 1 v, 2 t, 3 force, then the extra channels, the states z, coefficients and shape
 * parameters. `outputs` are the registers of the acceleration and of the slopes of the z.
 */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "program.h"

#define FAR 1e150 /* whose square is still a number, its cube is not */

typedef struct {
    Program program;
    const int64_t *outputs;
    const double *drive; /* two rows a step: at its beginning and half-way */
    int64_t channels, states;
} System;

EXPORT void evaluate(
    const int64_t *code, int64_t count, int64_t first, double *r, const int64_t *columns, int64_t column_count,
    const double *data, int64_t samples, const int64_t *outputs, int64_t output_count, double *out
) {
    for (int64_t i = 0; i < samples; i++) {
        for (int64_t c = 0; c < column_count; c++) r[columns[c]] = data[i * column_count + c];
        run_program(code, count, first, r);
        for (int64_t k = 0; k < output_count; k++) out[i * output_count + k] = r[outputs[k]];
    }
}

/* Derivative of a state, `row` being that of the drive. */
static void slope_of(const System *system, double time, int64_t row, const double *state, double *slope) {
    double *r = system->program.r;
    int64_t channels = system->channels;
    r[0] = state[0];
    r[1] = state[1];
    r[2] = time;
    for (int64_t c = 0; c < channels; c++) r[3 + c] = system->drive[row * channels + c];
    for (int64_t i = 2; i < system->states; i++) r[1 + channels + i] = state[i];
    run_prepared(&system->program);
    slope[0] = state[1];
    for (int64_t i = 1; i < system->states; i++) slope[i] = r[system->outputs[i - 1]];
}

/* One classical Runge-Kutta step in place; `room` has three rows. */
static void rk4_step(const System *system, double time, double h, int64_t row, double *state, double *room) {
    int64_t n = system->states;
    double *trial = room, *slope = room + n, *sum = room + 2 * n;
    memcpy(trial, state, (size_t)n * sizeof(double));
    memcpy(sum, state, (size_t)n * sizeof(double));
    for (int stage = 0; stage < 4; stage++) {
        int late = (stage + 1) / 2;
        slope_of(system, time + 0.5 * h * late, row + late, trial, slope);
        double weight = late == 1 ? h / 3.0 : h / 6.0, ahead = stage == 2 ? h : 0.5 * h;
        for (int64_t i = 0; i < n; i++) {
            sum[i] += weight * slope[i];
            trial[i] = state[i] + ahead * slope[i];
        }
    }
    memcpy(state, sum, (size_t)n * sizeof(double));
}

/* Keep (u, v, a, z...) of one sample; 0 where it is not finite. */
static int keep(const double *state, const double *slope, int64_t n, double *out) {
    out[0] = state[0];
    out[1] = state[1];
    out[2] = slope[1];
    for (int64_t i = 2; i < n; i++) out[i + 1] = state[i];
    return fabs(state[0]) < FAR && fabs(state[1]) < FAR && isfinite(slope[1]);
}

static int64_t along_rk4(
    const System *system, double start, double dt, int64_t steps, double *state, int64_t samples, double *out,
    double *room
) {
    int64_t n = system->states;
    double h = dt / (double)steps;
    for (int64_t sample = 0; sample < samples; sample++) {
        int64_t row = 2 * steps * sample;
        slope_of(system, start + (double)sample * dt, row, state, room);
        if (!keep(state, room, n, out + sample * (n + 1))) return sample;
        if (sample + 1 < samples)
            for (int64_t s = 0; s < steps; s++) {
                double time = start + (double)sample * dt + (double)s * h;
                rk4_step(system, time, h, row + 2 * s, state, room);
            }
    }
    return ALL_FINITE;
}

/* Adams-Bashforth predictor, Adams-Moulton corrector of order 4 (PECE), started by Runge-Kutta. */
static int64_t along_abm4(
    const System *system, double start, double dt, int64_t steps, double *state, int64_t samples, double *out,
    double *room
) {
    int64_t n = system->states, total = (samples - 1) * steps;
    double h = dt / (double)steps, *trial = room, *late = room + n, *ring = room + 3 * n;
    for (int64_t step = 0; step <= total; step++) {
        double time = start + (double)step * h;
        double *f0 = ring + (step & 3) * n, *f1 = ring + ((step + 3) & 3) * n; /* slopes of this step and the last */
        double *f2 = ring + ((step + 2) & 3) * n, *f3 = ring + ((step + 1) & 3) * n;
        slope_of(system, time, 2 * step, state, f0);
        if (step % steps == 0 && !keep(state, f0, n, out + step / steps * (n + 1))) return step / steps;
        if (step == total) break;
        if (step < 3) {
            rk4_step(system, time, h, 2 * step, state, room);
            continue;
        }
        for (int64_t i = 0; i < n; i++) {
            double past = -59.0 * f1[i] + 37.0 * f2[i] - 9.0 * f3[i];
            trial[i] = state[i] + h / 24.0 * (55.0 * f0[i] + past);
        }
        slope_of(system, time + h, 2 * step + 2, trial, late);
        for (int64_t i = 0; i < n; i++) {
            double past = 19.0 * f0[i] - 5.0 * f1[i] + f2[i];
            state[i] += h / 24.0 * (9.0 * late[i] + past);
        }
    }
    return ALL_FINITE;
}

/*
 * `method` 0: classical Runge-Kutta; 1: Adams. `steps` steps a sample; `drive` has 2 steps rows a sample. `state`, with
 * which the motion begins, is overwritten; `out`, samples rows of 1 + states, gets (u, v, a, z...).
 */
EXPORT int64_t integrate(
    int64_t method, const int64_t *code, int64_t count, int64_t first, double *r, const int64_t *outputs, double start,
    double dt, int64_t steps, const double *drive, int64_t channels, double *state, int64_t states, int64_t samples,
    double *out
) {
    System system = {.outputs = outputs, .drive = drive, .channels = channels, .states = states};
    double *room = calloc((size_t)(7 * states), sizeof(double));
    int64_t failed = NO_MEMORY;
    if (room && prepare_program(&system.program, code, count, first, r, 1 + channels + states, 0, 0)) {
        failed = (method ? along_abm4 : along_rk4)(&system, start, dt, steps, state, samples, out, room);
        forget_program(&system.program);
    }
    free(room);
    return failed;
}

/*
 * State z of a term under a known motion by Runge-Kutta in steps h, from rest. `columns` are the registers of the data,
 * which have 2 steps rows a sample; `state` and `output` are those of z and dz/dt.
 */
EXPORT void integrate_state(
    const int64_t *code, int64_t count, int64_t first, double *r, const int64_t *columns, int64_t column_count,
    int64_t state, int64_t output, double h, int64_t steps, const double *data, int64_t samples, double *out
) {
    static const double SHIFT[4] = {0.0, 0.5, 0.5, 1.0};
    double z = 0.0, slopes[4];
    for (int64_t sample = 0; sample < samples; sample++) {
        out[sample] = z;
        if (sample + 1 == samples) break;
        for (int64_t s = 0; s < steps; s++) {
            for (int stage = 0; stage < 4; stage++) {
                const double *row = data + (2 * (steps * sample + s) + (stage + 1) / 2) * column_count;
                for (int64_t c = 0; c < column_count; c++) r[columns[c]] = row[c];
                r[state] = stage > 0 ? z + SHIFT[stage] * h * slopes[stage - 1] : z;
                run_program(code, count, first, r);
                slopes[stage] = r[output];
            }
            z += h / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3]);
        }
    }
}
