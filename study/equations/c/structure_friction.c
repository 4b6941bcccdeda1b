/* Dry friction at several places of a structure: what is held, and steps that are cut where friction switches. */

#include <math.h>
#include <string.h>

#include "structure.h"
#include "variation.h"

enum { CUTS = 6, CORRECTIONS = 3 }; /* cuts of a step, for each place with friction */
static const double CLOSE = 1e-9;   /* to one: the sign of a held place at which it lets go */

static double sign_of(double x) { return x > 0.0 ? 1.0 : (x < 0.0 ? -1.0 : x); }

static double *sign_at(const Structure *s, int64_t place) { return s->program.r + s->sides[place]; }

/* Relative motion of a place: rows from `offset` of an array of states, or of their slopes. */
static double along_place(const Structure *s, int64_t place, const double *array, int64_t offset, int64_t column) {
    double total = 0.0;
    for (int64_t i = 0; i < s->coordinates; i++)
        total += s->directions[place * s->coordinates + i] * array[(offset + i) * s->columns + column];
    return total;
}

static double relative_velocity(const Structure *s, int64_t place, const double *state) {
    return along_place(s, place, state, s->coordinates, 0);
}

/*
 * Solve in place by elimination with the diagonal as pivots. Where a pivot vanishes nothing holds the place: twice the
 * sign of what pushes, which lets it go.
 */
static void eliminate(double *matrix, double *right, int64_t n, int64_t columns) {
    for (int64_t k = 0; k < n; k++) {
        double pivot = matrix[k * n + k];
        if (pivot == 0.0) continue;
        for (int64_t i = 0; i < n; i++) {
            if (i == k || matrix[i * n + k] == 0.0) continue;
            double ratio = matrix[i * n + k] / pivot;
            for (int64_t m = k; m < n; m++) matrix[i * n + m] -= ratio * matrix[k * n + m];
            for (int64_t c = 0; c < columns; c++) right[i * columns + c] -= ratio * right[k * columns + c];
        }
    }
    for (int64_t k = 0; k < n; k++) {
        double pivot = matrix[k * n + k];
        for (int64_t c = 0; c < columns; c++) {
            double *x = right + k * columns + c;
            *x = pivot != 0.0 ? *x / pivot : (c == 0 ? -2.0 * sign_of(*x) : 0.0);
        }
    }
}

/* Derivatives of the held relative accelerations by their signs into the matrix; how many are held. */
static int64_t held_system(const Structure *s) {
    int64_t held = 0, row = 0;
    for (int64_t a = 0; a < s->places; a++) held += s->held[a] != 0;
    for (int64_t a = 0; a < s->places; a++) {
        if (!s->held[a]) continue;
        int64_t column = 0;
        for (int64_t b = 0; b < s->places; b++) {
            if (!s->held[b]) continue;
            double total = 0.0;
            for (int64_t i = 0; i < s->coordinates; i++)
                total += s->directions[a * s->coordinates + i] * s->program.r[s->by_side[b * s->coordinates + i]];
            s->matrix[row * held + column++] = total;
        }
        row++;
    }
    return held;
}

void hold(Structure *s) {
    for (int64_t a = 0; a < s->places; a++)
        if (s->held[a]) *sign_at(s, a) = 0.0;
    run_prepared(&s->program);
    int64_t count = held_system(s), at = 0;
    for (int64_t a = 0; a < s->places; a++) {
        if (!s->held[a]) continue;
        double total = 0.0;
        for (int64_t i = 0; i < s->coordinates; i++)
            total -= s->directions[a * s->coordinates + i] * s->program.r[s->slopes[i]];
        s->right[at++] = total;
    }
    eliminate(s->matrix, s->right, count, 1);
    at = 0;
    for (int64_t a = 0; a < s->places; a++)
        if (s->held[a]) *sign_at(s, a) = s->right[at++];
    run_prepared(&s->program);
}

/* The derivatives of the held signs keep those of each held e.a at zero. */
void hold_derivatives(Structure *s, int64_t columns) {
    int64_t n = s->coordinates, count = held_system(s), at = 0;
    memset(s->right, 0, (size_t)(count * columns) * sizeof(double));
    for (int64_t a = 0; a < s->places; a++) {
        if (!s->held[a]) continue;
        for (int64_t i = 0; i < n; i++)
            for (int64_t c = 1; c < columns; c++)
                s->right[at * columns + c] -= s->directions[a * n + i] * s->slope[(n + i) * s->columns + c];
        at++;
    }
    eliminate(s->matrix, s->right, count, columns);
    at = 0;
    for (int64_t a = 0; a < s->places; a++) {
        if (!s->held[a]) continue;
        for (int64_t i = 0; i < n; i++) {
            double push = s->program.r[s->by_side[a * n + i]];
            if (push == 0.0) continue;
            for (int64_t c = 1; c < columns; c++)
                s->slope[(n + i) * s->columns + c] += push * s->right[at * columns + c];
        }
        at++;
    }
}

/* The slopes of the states alone, at where the step stands. */
static void slopes_here(Structure *s, double time, const double *drive) {
    for (int64_t i = 0; i < s->states; i++) s->trial[i * s->columns] = s->state[i * s->columns];
    structure_slopes(s, time, drive, 1);
}

/*
 * From where the step began: the part of it between two fractions, what is held staying held. The program has then run at
 * the end, and the slopes of the states are those there. A search for an event takes one column.
 */
static void part(
    Structure *s, double time, double h, double begin, double end, const double *drive, int64_t columns
) {
    drive_between(drive, s->channels, begin, end, s->local);
    memcpy(s->state, s->begun, (size_t)(s->states * s->columns) * sizeof(double));
    structure_step(s, time + begin * h, (end - begin) * h, s->local, columns);
    slopes_here(s, time + end * h, s->local + 2 * s->channels);
}

/* Fraction of a part of a step, which took `span`, after which the friction of a place switches; 2 if it does not. */
static double next_of(const Structure *s, int64_t place, double span) {
    double sign = *sign_at(s, place), early = s->early[place];
    if (!s->held[place]) { /* the mean velocity is the change of displacement: it shows a dip between two steps */
        double mean = (along_place(s, place, s->state, 0, 0) - along_place(s, place, s->begun, 0, 0)) / span;
        double v0 = sign * relative_velocity(s, place, s->begun);
        v0 = s->fresh[place] || 0.0 > v0 ? 0.0 : v0; /* what set off did so from zero, but for rounding */
        return first_zero(v0, sign * relative_velocity(s, place, s->state), sign * mean);
    }
    if (fabs(early) > 1.0) return 0.0; /* what else switched has set it free */
    if (fabs(sign) <= 1.0) return 2.0;
    double begin = sign > 0.0 ? early : -early;
    return fabs(sign) > begin ? within_one((1.0 - begin) / (fabs(sign) - begin)) : 0.0;
}

/*
 * Step to where the relative velocity of a place vanishes and switch there; returns that fraction of the step. The guess
 * x, a fraction of what is left of it, is corrected by Newton. The time at which a velocity passes through zero depends
 * on the parameters, and the derivatives of all velocities jump with the accelerations (saltation):
 * s+ = s- - (a- - a+) (e.s-) / (e.a-).
 */
static double switch_at(Structure *s, int64_t a, double time, double h, double begin, double x, const double *drive) {
    int64_t n = s->coordinates, width = s->columns;
    double sign = *sign_at(s, a), span = (1.0 - begin) * h, end = begin, before = 0.0;
    const double *late = s->local + 2 * s->channels;
    for (int i = 0; i < CORRECTIONS; i++) {
        x = within_one(x);
        end = begin + x * (1.0 - begin);
        part(s, time, h, begin, end, drive, 1);
        before = along_place(s, a, s->slope, n, 0);
        if (before * sign >= 0.0) break;
        x -= relative_velocity(s, a, s->state) / (before * span);
    }
    part(s, time, h, begin, end, drive, width);
    double left = before != 0.0 ? relative_velocity(s, a, s->state) / before : 0.0; /* time by which Newton misses */
    for (int64_t i = 0; i < n; i++) s->before[i] = s->slope[(n + i) * width];
    for (int64_t i = 0; i < n; i++) {
        s->state[i * width] -= s->state[(n + i) * width] * left;
        s->state[(n + i) * width] -= s->before[i] * left;
    }
    *sign_at(s, a) = -sign;
    slopes_here(s, time + end * h, late);
    if (along_place(s, a, s->slope, n, 0) * sign >= 0.0) {
        s->held[a] = 1;
        slopes_here(s, time + end * h, late);
    }
    for (int64_t c = 1; c < width; c++) {
        double rate = before != 0.0 ? along_place(s, a, s->state, n, c) / before : 0.0;
        for (int64_t i = 0; i < n; i++)
            s->state[(n + i) * width + c] -= (s->before[i] - s->slope[(n + i) * width]) * rate;
    }
    return end;
}

/*
 * Step to where the other forces overcome friction at a held place and let it go; returns that fraction. The guess x, a
 * fraction of what is left of the step, is corrected by secants: what is let go too early would turn back at once.
 */
static double release(Structure *s, int64_t a, double time, double h, double begin, double x, const double *drive) {
    double early = s->early[a], low = 0.0, at_low = fabs(early), end = begin;
    double sign = copysign(1.0, fabs(early) > 1.0 ? early : *sign_at(s, a));
    for (int i = 0; i < CORRECTIONS; i++) {
        end = begin + x * (1.0 - begin);
        part(s, time, h, begin, end, drive, 1);
        double now = sign * *sign_at(s, a);
        if (now == at_low || fabs(now - 1.0) < CLOSE) break;
        double rise = x != low ? (now - at_low) / (x - low) : 0.0;
        low = x;
        at_low = now;
        if (rise <= 0.0) break;
        x = within_one(x + (1.0 - now) / rise);
    }
    part(s, time, h, begin, end, drive, s->columns);
    s->held[a] = 0;
    *sign_at(s, a) = sign;
    return end;
}

void structure_switching_step(Structure *s, double time, double h, const double *drive) {
    double begin = 0.0;
    memset(s->fresh, 0, (size_t)s->places * sizeof(int64_t));
    for (int64_t cut = 0; cut <= CUTS * s->places; cut++) {
        memcpy(s->begun, s->state, (size_t)(s->states * s->columns) * sizeof(double));
        for (int64_t a = 0; a < s->places; a++) s->early[a] = *sign_at(s, a);
        part(s, time, h, begin, 1.0, drive, s->columns);
        int64_t first = -1;
        double least = 1.0;
        for (int64_t a = 0; a < s->places; a++) {
            double x = next_of(s, a, (1.0 - begin) * h);
            if (x <= least) {
                first = a;
                least = x;
            }
        }
        if (first < 0 || cut == CUTS * s->places) return;
        memset(s->fresh, 0, (size_t)s->places * sizeof(int64_t));
        if (s->held[first]) {
            s->fresh[first] = 1;
            begin = release(s, first, time, h, begin, least, drive);
        } else
            begin = switch_at(s, first, time, h, begin, least, drive);
        if (begin >= 1.0) return;
    }
}

void set_sides(Structure *s, double time, const double *drive) {
    for (int64_t a = 0; a < s->places; a++) {
        double velocity = relative_velocity(s, a, s->state);
        s->held[a] = velocity == 0.0;
        *sign_at(s, a) = sign_of(velocity);
    }
    for (int64_t round = 0; round < s->places; round++) {
        memcpy(s->trial, s->state, (size_t)(s->states * s->columns) * sizeof(double));
        structure_slopes(s, time, drive, 1);
        for (int64_t a = 0; a < s->places; a++)
            if (s->held[a] && fabs(*sign_at(s, a)) > 1.0) {
                s->held[a] = 0;
                *sign_at(s, a) = copysign(1.0, *sign_at(s, a));
            }
    }
}
