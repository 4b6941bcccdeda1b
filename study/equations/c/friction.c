/*
 * Steps of one coordinate with dry friction. The register of the side stands for sgn v: 1 or -1 while the mass moves, 0
 * while friction holds it. A step across the switch would be of order 1 only, and its derivative without the jump that
 * the true one has.
 */

#include <math.h>
#include <string.h>

#include "variation.h"

enum { CUTS = 6, CORRECTIONS = 3 };

static void copy(double *to, const double *from, const Variation *v) {
    memcpy(to, from, (size_t)(v->states * v->width) * sizeof(double));
}

double first_zero(double v0, double v1, double mean) {
    double c = 3.0 * (v0 + v1) - 6.0 * mean, b = v1 - v0 - c, square = b * b - 4.0 * c * v0;
    int dips = v0 > 0.0 && c > 0.0 && -2.0 * c < b && b < 0.0 && square > 0.0;
    if (v1 > 0.0 && !dips) return 2.0;
    double root = sqrt(0.0 > square ? 0.0 : square);
    return b < 0.0 ? 2.0 * v0 / (root - b) : (b + root) / (-2.0 * c);
}

void drive_between(const double *drive, int64_t channels, double begin, double end, double *local) {
    for (int i = 0; i < 3; i++) {
        double x = begin + 0.5 * i * (end - begin);
        for (int64_t c = 0; c < channels; c++) {
            double outer = (1.0 - x) * drive[c] - x * drive[2 * channels + c];
            local[i * channels + c] = (1.0 - 2.0 * x) * outer + 4.0 * x * (1.0 - x) * drive[channels + c];
        }
    }
}

double pull(Variation *v, double sign, double time, const double *drive, const double *state) {
    v->program.r[v->side] = sign;
    copy(v->trial, state, v);
    variation_slopes(v, time, drive);
    return v->slope[v->width];
}

/* From where the step began: the part of it between two fractions, sgn v held. */
static void substep(Variation *v, double time, double h, double begin, double end, const double *drive) {
    drive_between(drive, v->channels, begin, end, v->local);
    copy(v->state, v->begun, v);
    variation_step(v, time + begin * h, (end - begin) * h, v->local);
}

/*
 * Step to where v vanishes and switch there; returns that fraction of the step. The guess x, a fraction of what is left
 * of the step, is corrected by Newton. Where v passes through zero, the time at which it does so depends on the
 * parameters, and the derivative of v jumps with the acceleration (saltation): s_v+ = s_v- a+ / a-. Where friction holds
 * the mass, v = 0 whatever they are.
 */
static double to_crossing(Variation *v, double time, double h, double begin, double x, const double *drive) {
    double *side = v->program.r + v->side, *velocity = v->state + v->width;
    const double *late = v->local + 2 * v->channels;
    double sign = *side, span = (1.0 - begin) * h, end = begin, before = 0.0;
    for (int i = 0; i < CORRECTIONS; i++) {
        x = within_one(x);
        end = begin + x * (1.0 - begin);
        substep(v, time, h, begin, end, drive);
        before = pull(v, sign, time + end * h, late, v->state);
        if (before * sign >= 0.0) break;
        x -= velocity[0] / (before * span);
    }
    double after = pull(v, -sign, time + end * h, late, v->state);
    int through = after * sign < 0.0;
    *side = through ? -sign : 0.0;
    velocity[0] = 0.0;
    for (int64_t i = 1; i < v->columns; i++)
        velocity[i] = through && before != 0.0 ? velocity[i] * after / before : 0.0;
    return end;
}

/* Step to where the other forces overcome friction; returns that fraction of the step, 1 if they do not. */
static double to_release(Variation *v, double time, double h, double begin, const double *drive) {
    double *side = v->program.r + v->side, sign = 1.0;
    const double *end_of = v->local + 2 * v->channels;
    double late = pull(v, sign, time + h, end_of, v->state);
    if (late <= 0.0) {
        sign = -1.0;
        late = pull(v, sign, time + h, end_of, v->state);
    }
    if (sign * late <= 0.0) {
        *side = 0.0;
        return 1.0;
    }
    double early = pull(v, sign, time + begin * h, v->local, v->begun), x = within_one(early / (early - late));
    *side = 0.0;
    double end = begin + x * (1.0 - begin);
    substep(v, time, h, begin, end, drive);
    *side = sign;
    return end;
}

void switching_step(Variation *v, double time, double h, const double *drive) {
    double begin = 0.0, *side = v->program.r + v->side, *velocity = v->state + v->width;
    for (int cut = 0; cut < CUTS; cut++) {
        copy(v->begun, v->state, v);
        substep(v, time, h, begin, 1.0, drive);
        if (*side == 0.0)
            begin = to_release(v, time, h, begin, drive);
        else { /* the mean velocity is the change of displacement: it shows a dip below zero between two steps */
            double mean = (v->state[0] - v->begun[0]) / ((1.0 - begin) * h);
            double x = first_zero(*side * v->begun[v->width], *side * velocity[0], *side * mean);
            if (x > 1.0) return;
            begin = to_crossing(v, time, h, begin, x, drive);
        }
        if (begin >= 1.0) return;
    }
    if (*side * velocity[0] < 0.0) *side = -*side;
}
