/* Free runs of structures by Runge-Kutta, with their exact derivatives. */

#include "structure.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FAR 1e150

static void evaluate_at(const Structure *s, double time, const double *drive) {
    double *r = s->program.r;
    int64_t moving = 2 * s->coordinates;
    for (int64_t i = 0; i < moving; i++) r[i] = s->trial[i * s->columns];
    r[moving] = time;
    for (int64_t c = 0; c < s->channels; c++) r[moving + 1 + c] = drive[c];
    for (int64_t i = moving; i < s->states; i++) r[1 + s->channels + i] = s->trial[i * s->columns];
    run_prepared(&s->program);
}

/* ds/dt = (df/dx) s + df/dp; columns beyond those of the keys are those of the initial state. */
static void sensitivities(const Structure *s, int64_t columns) {
    const double *r = s->program.r;
    int64_t n = s->coordinates;
    for (const int64_t *entry = s->by_key; entry < s->by_key + 3 * s->by_key_count; entry += 3)
        s->slope[(n + entry[0]) * s->columns + 1 + entry[1]] = r[entry[2]];
    for (const int64_t *entry = s->by_state; entry < s->by_state + 3 * s->by_state_count; entry += 3) {
        double partial = r[entry[2]];
        if (partial == 0.0) continue;
        double *restrict to = s->slope + (n + entry[0]) * s->columns;
        const double *restrict of = s->trial + entry[1] * s->columns;
        for (int64_t c = 1; c < columns; c++) to[c] += partial * of[c];
    }
}

void structure_slopes(Structure *s, double time, const double *drive, int64_t columns) {
    int64_t n = s->coordinates;
    int holding = 0;
    evaluate_at(s, time, drive);
    for (int64_t a = 0; a < s->places; a++) holding = holding || s->held[a] != 0;
    if (holding) hold(s);
    for (int64_t i = 0; i < n; i++)
        memcpy(s->slope + i * s->columns, s->trial + (n + i) * s->columns, (size_t)columns * sizeof(double));
    for (int64_t i = 0; i < s->slope_count; i++) {
        double *row = s->slope + (n + i) * s->columns;
        row[0] = s->program.r[s->slopes[i]];
        for (int64_t c = 1; c < columns; c++) row[c] = 0.0;
    }
    if (columns == 1) return;
    sensitivities(s, columns);
    if (holding) hold_derivatives(s, columns);
}

void structure_step(Structure *s, double time, double h, const double *drive, int64_t columns) {
    int64_t size = s->states * s->columns;
    memcpy(s->trial, s->state, (size_t)size * sizeof(double));
    memset(s->sum, 0, (size_t)size * sizeof(double));
    for (int stage = 0; stage < 4; stage++) {
        int late = (stage + 1) / 2;
        structure_slopes(s, time + 0.5 * h * late, drive + late * s->channels, columns);
        double weight = late == 1 ? h / 3.0 : h / 6.0, ahead = stage == 2 ? h : 0.5 * h;
        for (int64_t i = 0; i < s->states; i++) {
            int64_t at = i * s->columns;
            double *restrict sum = s->sum + at, *restrict trial = s->trial + at;
            const double *restrict slope = s->slope + at, *restrict state = s->state + at;
            for (int64_t c = 0; c < columns; c++) {
                sum[c] += weight * slope[c];
                trial[c] = state[c] + ahead * slope[c];
            }
        }
    }
    for (int64_t i = 0; i < s->states; i++)
        for (int64_t c = 0; c < columns; c++) s->state[i * s->columns + c] += s->sum[i * s->columns + c];
}

/* The motions `rows` (displacements, velocities and accelerations counted through) of a sample; 0 if not finite. */
static int keep(const Structure *s, const int64_t *rows, int64_t row_count, int64_t sample, int64_t samples, double *out) {
    int64_t n = s->coordinates, width = s->columns;
    for (int64_t i = 0; i < n; i++)
        if (!(fabs(s->state[i * width]) < FAR && fabs(s->state[(n + i) * width]) < FAR &&
              isfinite(s->slope[(n + i) * width])))
            return 0;
    for (int64_t k = 0; k < row_count; k++) {
        const double *motion = rows[k] < 2 * n ? s->state + rows[k] * width : s->slope + (rows[k] - n) * width;
        memcpy(out + (k * samples + sample) * width, motion, (size_t)width * sizeof(double));
    }
    return 1;
}

static int64_t along(
    Structure *s, double start, double dt, int64_t steps, const double *drive, const int64_t *rows, int64_t row_count,
    int64_t samples, double *out
) {
    double h = dt / (double)steps;
    if (s->places) set_sides(s, start, drive);
    for (int64_t sample = 0; sample < samples; sample++) {
        const double *at = drive + 2 * steps * sample * s->channels;
        memcpy(s->trial, s->state, (size_t)(s->states * s->columns) * sizeof(double));
        structure_slopes(s, start + (double)sample * dt, at, s->columns);
        if (!keep(s, rows, row_count, sample, samples, out)) return sample;
        if (sample + 1 == samples) break;
        for (int64_t m = 0; m < steps; m++) {
            double time = start + (double)sample * dt + (double)m * h;
            const double *now = at + 2 * m * s->channels;
            if (s->places)
                structure_switching_step(s, time, h, now);
            else
                structure_step(s, time, h, now, s->columns);
        }
    }
    return ALL_FINITE;
}

/* Room for the states and what friction needs; 0 where there is none. */
static int prepare_room(Structure *s) {
    size_t size = (size_t)(s->states * s->columns), places = (size_t)s->places;
    size_t friction = places * places + places * (size_t)s->columns + (size_t)s->coordinates + places;
    s->state = calloc(5 * size + 3 * (size_t)s->channels + friction + 1, sizeof(double));
    s->held = calloc(2 * places + 1, sizeof(int64_t));
    if (!s->state || !s->held) return 0;
    s->trial = s->state + size;
    s->slope = s->state + 2 * size;
    s->sum = s->state + 3 * size;
    s->begun = s->state + 4 * size;
    s->local = s->state + 5 * size;
    s->matrix = s->local + 3 * s->channels;
    s->right = s->matrix + places * places;
    s->before = s->right + places * (size_t)s->columns;
    s->early = s->before + s->coordinates;
    s->fresh = s->held + places;
    return 1;
}

/*
 * `y`, states rows of 1 + derivatives, is the state at the first sample and becomes that at the last. `out`, shape
 * (rows, samples, 1 + derivatives), gets the motions. `drive` has 2 steps rows a sample.
 */
EXPORT int64_t integrate_structure(
    const int64_t *code, int64_t count, int64_t first, double *r, const int64_t *slopes, int64_t slope_count,
    const int64_t *by_state, int64_t by_state_count, const int64_t *by_key, int64_t by_key_count, const int64_t *sides,
    int64_t places, const int64_t *by_side, const double *directions, int64_t coordinates, double start, double dt,
    int64_t steps, const double *drive, int64_t channels, double *y, int64_t states, int64_t columns,
    const int64_t *rows, int64_t row_count, int64_t samples, double *out
) {
    Structure s = {.coordinates = coordinates, .states = states, .columns = columns, .channels = channels,
                   .places = places, .slopes = slopes, .slope_count = slope_count, .by_state = by_state,
                   .by_state_count = by_state_count, .by_key = by_key, .by_key_count = by_key_count, .sides = sides,
                   .by_side = by_side, .directions = directions};
    int64_t failed = NO_MEMORY;
    size_t size = (size_t)(states * columns) * sizeof(double);
    if (prepare_room(&s) && prepare_program(&s.program, code, count, first, r, 1 + channels + states, sides, places)) {
        memcpy(s.state, y, size);
        failed = along(&s, start, dt, steps, drive, rows, row_count, samples, out);
        memcpy(y, s.state, size);
        forget_program(&s.program);
    }
    free(s.state);
    free(s.held);
    return failed;
}
