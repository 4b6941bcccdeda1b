/*
 * State and sensitivities s together: ds/dt = (df/dx) s + df/dp, of which the columns beyond those of the p are those of
 * the initial state. Runge-Kutta applied to them gives exactly the derivative of the Runge-Kutta map.
 */

#include "variation.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FAR 1e150
enum { WIDEST = 12 }; /* of the widths that are written out */

static const double ZERO = 0.0;

/*
 * The functions below are written out for each small width: the compiler then leaves out the loops over a row and keeps
 * it in the processor's registers.
 */

/* Registers of what acts from outside. */
static inline void drive_registers(const Variation *v, double time, const double *drive) {
    double *r = v->program.r;
    r[2] = time;
    for (int64_t c = 0; c < v->channels; c++) r[3 + c] = drive[c];
}

static inline int64_t register_of(const Variation *v, int64_t state) {
    return state < 2 ? state : 1 + v->channels + state;
}

/* Slope i of the state, and of its sensitivities, where the program has run. */
static inline void slope_row(const Variation *v, int64_t i, const double *trial, double *total, int64_t width) {
    if (i == 0 || (i == 1 && v->side >= 0 && v->program.r[v->side] == 0.0)) { /* friction holds the mass */
        for (int64_t c = 0; c < width; c++) total[c] = i == 0 ? trial[width + c] : 0.0;
        return;
    }
    const double *const *direct = v->direct + (i - 1) * width;
    for (int64_t c = 0; c < width; c++) total[c] = *direct[c];
    const Partial *end = v->by_state + v->state_ends[i];
    for (const Partial *partial = v->by_state + v->state_ends[i - 1]; partial < end; partial++) {
        double by = *partial->from;
        const double *row = trial + partial->state * width;
        for (int64_t c = 0; c < width; c++) total[c] += by * row[c];
    }
    total[0] = *direct[0];
}

static inline void slopes_of(Variation *v, double time, const double *drive, int64_t width) {
    drive_registers(v, time, drive);
    for (int64_t i = 0; i < v->states; i++) v->program.r[register_of(v, i)] = v->trial[i * width];
    run_prepared(&v->program);
    for (int64_t i = 0; i < v->states; i++) slope_row(v, i, v->trial, v->slope + i * width, width);
}

/*
 * One stage of a step: slopes at `trial`, whose state the registers hold, added to the sum; the next trial and the
 * registers of its state follow. What was just computed goes on in the processor, not by way of the memory.
 */
static inline void stage_of(
    Variation *v, double time, const double *drive, const double *restrict trial, double *restrict next, double weight,
    double ahead, int64_t width
) {
    drive_registers(v, time, drive);
    run_prepared(&v->program);
    for (int64_t i = 0; i < v->states; i++) {
        double own[WIDEST] = {0.0}, *total = width <= WIDEST ? own : v->total;
        double *restrict sum = v->sum + i * width, *restrict to = next + i * width;
        const double *restrict state = v->state + i * width;
        slope_row(v, i, trial, total, width);
        v->program.r[register_of(v, i)] = state[0] + ahead * total[0];
        for (int64_t c = 0; c < width; c++) {
            sum[c] += weight * total[c];
            to[c] = state[c] + ahead * total[c];
        }
    }
}

static inline void step_of(Variation *v, double time, double h, const double *drive, int64_t width) {
    int64_t size = v->states * width;
    double half = h * 0.5, third = h / 3.0, sixth = h / 6.0;
    for (int64_t i = 0; i < v->states; i++) v->program.r[register_of(v, i)] = v->state[i * width];
    for (int64_t i = 0; i < size; i++) v->sum[i] = 0.0;
    stage_of(v, time, drive, v->state, v->trial, sixth, half, width);
    stage_of(v, time + half, drive + v->channels, v->trial, v->slope, third, half, width);
    stage_of(v, time + half, drive + v->channels, v->slope, v->trial, third, h, width);
    stage_of(v, time + h, drive + 2 * v->channels, v->trial, v->slope, sixth, half, width);
    for (int64_t i = 0; i < size; i++) v->state[i] += v->sum[i];
}

#define EACH_WIDTH(DO) DO(2) DO(4) DO(6) DO(8) DO(10) DO(12)

void variation_slopes(Variation *v, double time, const double *drive) {
    switch (v->width) {
#define SLOPES(width)                     \
    case width:                           \
        slopes_of(v, time, drive, width); \
        return;
        EACH_WIDTH(SLOPES)
    default:
        slopes_of(v, time, drive, v->width);
    }
}

void variation_step(Variation *v, double time, double h, const double *drive) {
    switch (v->width) {
#define STEP(width)                        \
    case width:                            \
        step_of(v, time, h, drive, width); \
        return;
        EACH_WIDTH(STEP)
    default:
        step_of(v, time, h, drive, v->width);
    }
}

/*
 * Response `row` (0 displacement, 1 velocity, 2 acceleration) of each sample beside its derivatives into `out`, from the
 * state `y`, which becomes that at the last sample. `drive` has 2 `steps` rows a sample.
 */
static int64_t along(
    Variation *v, double start, double dt, int64_t steps, const double *drive, double *y, int64_t row, int64_t samples,
    double *out
) {
    int64_t columns = v->columns, width = v->width;
    size_t of_row = (size_t)columns * sizeof(double);
    double h = dt / (double)steps;
    for (int64_t i = 0; i < v->states; i++) memcpy(v->state + i * width, y + i * columns, of_row);
    if (v->side >= 0) {
        double velocity = v->state[width], *side = v->program.r + v->side;
        if (velocity != 0.0)
            *side = copysign(1.0, velocity);
        else if (pull(v, 1.0, start, drive, v->state) <= 0.0)
            *side = pull(v, -1.0, start, drive, v->state) >= 0.0 ? 0.0 : -1.0;
    }
    for (int64_t sample = 0; sample < samples; sample++) {
        const double *at = drive + 2 * steps * sample * v->channels;
        memcpy(v->trial, v->state, (size_t)(v->states * width) * sizeof(double));
        variation_slopes(v, start + (double)sample * dt, at);
        if (!(fabs(v->state[0]) < FAR && fabs(v->state[width]) < FAR && isfinite(v->slope[width]))) return sample;
        memcpy(out + sample * columns, row < 2 ? v->state + row * width : v->slope + width, of_row);
        if (sample + 1 < samples)
            for (int64_t m = 0; m < steps; m++) {
                double time = start + (double)sample * dt + (double)m * h;
                const double *now = at + 2 * m * v->channels;
                if (v->side < 0)
                    variation_step(v, time, h, now);
                else
                    switching_step(v, time, h, now);
            }
    }
    for (int64_t i = 0; i < v->states; i++) memcpy(y + i * columns, v->state + i * width, of_row);
    return ALL_FINITE;
}

static void forget_variation(Variation *v) {
    forget_program(&v->program);
    free(v->direct);
    free(v->by_state);
    free(v->state_ends);
    free(v->state);
}

/*
 * Where slopes and derivatives are read; `slots` has a row for each slope: its register, those of its derivatives by the
 * states and by the keys. What is a constant zero, below `first` but no input, is left out.
 */
static void find_derivatives(Variation *v, const int64_t *slots, int64_t slot_width, int64_t inputs, int64_t first) {
    const double *r = v->program.r;
    int64_t found = 0;
    v->state_ends[0] = 0;
    for (int64_t i = 1; i < v->states; i++, slots += slot_width) {
        const double **direct = v->direct + (i - 1) * v->width;
        direct[0] = r + slots[0];
        for (int64_t c = 1; c < v->width; c++) {
            int64_t at = v->states + c;
            direct[c] = at < slot_width && c < v->columns ? r + slots[at] : &ZERO;
        }
        for (int64_t m = 0; m < v->states; m++) {
            int64_t at = slots[1 + m];
            if (at < inputs || at >= first || r[at] != 0.0) v->by_state[found++] = (Partial){m, r + at};
        }
        v->state_ends[i] = found;
    }
}

static int prepare_variation(Variation *v, const int64_t *code, int64_t count, int64_t first, double *r) {
    v->width = v->columns + v->columns % 2;
    size_t states = (size_t)v->states, size = states * (size_t)v->width;
    if (!prepare_program(&v->program, code, count, first, r, 1 + v->channels + v->states, &v->side, 1)) return 0;
    v->direct = malloc(size * sizeof(double *));
    v->by_state = malloc(states * states * sizeof(Partial));
    v->state_ends = malloc(states * sizeof(int64_t));
    v->state = calloc(5 * size + 3 * (size_t)v->channels + (size_t)v->width, sizeof(double));
    if (!v->direct || !v->by_state || !v->state_ends || !v->state) return 0;
    v->trial = v->state + size;
    v->slope = v->state + 2 * size;
    v->sum = v->state + 3 * size;
    v->begun = v->state + 4 * size;
    v->local = v->state + 5 * size;
    v->total = v->local + 3 * v->channels;
    return 1;
}

/*
 * Segments between neighbouring `bounds`, each from its own of the `states` and from its time in `starts`. A segment runs
 * on to the first sample of the next, which overwrites it; the last one does not write that sample, which another thread
 * may own. `inputs` is the number of the program's inputs; `slots` has a row for each state but displacement.
 */
EXPORT int64_t integrate_segments(
    const int64_t *code, int64_t count, int64_t inputs, int64_t first, double *r, const int64_t *slots,
    int64_t slot_width, int64_t side, const double *starts, double dt, int64_t steps, const double *drive,
    int64_t channels, const int64_t *bounds, int64_t bound_count, double *states, int64_t state_count, int64_t columns,
    int64_t row, int64_t samples, double *out
) {
    Variation v = {.states = state_count, .columns = columns, .channels = channels, .side = side};
    int64_t failed = NO_MEMORY, segments = bound_count - 1;
    int64_t begin = bounds[segments - 1], end = bounds[segments] + 1 < samples ? bounds[segments] + 1 : samples;
    double *last = malloc((size_t)((end - begin) * columns + 1) * sizeof(double));
    if (prepare_variation(&v, code, count, first, r) && last) {
        find_derivatives(&v, slots, slot_width, inputs, first);
        failed = ALL_FINITE;
        for (int64_t i = 0; i < segments && failed == ALL_FINITE; i++) {
            int64_t from = bounds[i], length = i + 1 < segments ? bounds[i + 1] + 1 - from : end - from;
            double *target = i + 1 < segments ? out + from * columns : last;
            failed = along(
                &v, starts[i], dt, steps, drive + 2 * steps * from * channels, states + i * state_count * columns, row,
                length, target
            );
            if (failed >= 0) failed += from;
        }
        if (failed == ALL_FINITE)
            memcpy(out + begin * columns, last, (size_t)((bounds[segments] - begin) * columns) * sizeof(double));
    }
    free(last);
    forget_variation(&v);
    return failed;
}
