/* Dry friction at one place or at several: what is held, and steps that are cut where friction switches. */

#include <math.h>
#include <string.h>

#include "motion.h"

enum { CUTS = 6, CORRECTIONS = 3 }; /* cuts of a step, for each place with friction */
static const double CLOSE = 1e-9;   /* to one: the sign of a held place at which it lets go */

static double sign_of(double x) { return x > 0.0 ? 1.0 : (x < 0.0 ? -1.0 : x); }

static double within_one(double x) {
    x = 0.0 > x ? 0.0 : x;
    return 1.0 < x ? 1.0 : x;
}

static double *sign_at(const Motion *m, int64_t place) { return m->program.r + m->friction.sides[place]; }

static double shift_at(const Motion *m, int64_t place, int64_t order) {
    int64_t at = m->friction.shifts[3 * place + order];
    return at < 0 ? 0.0 : m->program.r[at];
}

/* Column of the relative motion of a place without what is prescribed: rows from `offset` of an array of states. */
static double along_place(const Motion *m, int64_t place, const double *array, int64_t offset, int64_t column) {
    double total = 0.0;
    for (int64_t i = 0; i < m->dofs; i++)
        total += m->friction.directions[place * m->dofs + i] * array[(offset + i) * m->width + column];
    return total;
}

/* Relative displacement, velocity and acceleration where the program has run. */
static double displacement_of(const Motion *m, int64_t place) {
    return along_place(m, place, m->state, 0, 0) + shift_at(m, place, 0);
}

static double velocity_of(const Motion *m, int64_t place) {
    return along_place(m, place, m->state, m->dofs, 0) + shift_at(m, place, 1);
}

static double acceleration_of(const Motion *m, int64_t place) {
    double total = shift_at(m, place, 2);
    for (int64_t i = 0; i < m->dofs; i++)
        total += m->friction.directions[place * m->dofs + i] * *m->direct[i * m->width];
    return total;
}

static void set_held(Motion *m, int64_t place, int64_t held) {
    Friction *f = &m->friction;
    f->held[place] = held;
    f->held_any = 0;
    for (int64_t a = 0; a < f->places; a++) f->held_any |= f->held[a];
    f->alone = f->held_any && f->places == 1 && m->dofs == 1 && f->shifts[0] < 0;
    m->ran = 0;
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
static int64_t held_system(const Motion *m) {
    const Friction *f = &m->friction;
    int64_t count = 0, row = 0;
    for (int64_t a = 0; a < f->places; a++) count += f->held[a];
    for (int64_t a = 0; a < f->places; a++) {
        if (!f->held[a]) continue;
        int64_t column = 0;
        for (int64_t b = 0; b < f->places; b++) {
            if (!f->held[b]) continue;
            double total = 0.0;
            for (int64_t i = 0; i < m->dofs; i++)
                total += f->directions[a * m->dofs + i] * m->program.r[f->by_side[b * m->rows + i]];
            f->matrix[row * count + column++] = total;
        }
        row++;
    }
    return count;
}

void hold(Motion *m) {
    const Friction *f = &m->friction;
    for (int64_t a = 0; a < f->places; a++)
        if (f->held[a]) *sign_at(m, a) = 0.0;
    run_prepared(&m->program);
    int64_t count = held_system(m), at = 0;
    for (int64_t a = 0; a < f->places; a++)
        if (f->held[a]) f->right[at++] = -acceleration_of(m, a);
    eliminate(f->matrix, f->right, count, 1);
    at = 0;
    for (int64_t a = 0; a < f->places; a++)
        if (f->held[a]) *sign_at(m, a) = f->right[at++];
    run_prepared(&m->program);
}

/* The derivatives of the held signs keep those of each held e.a at zero. */
void held_slopes(Motion *m, const double *at_states, int64_t columns) {
    const Friction *f = &m->friction;
    int64_t n = m->dofs, width = m->width, count = held_system(m), at = 0;
    memcpy(f->slope, at_states + n * width, (size_t)(n * width) * sizeof(double));
    for (int64_t i = n; i < m->states; i++) {
        if (columns == 1)
            f->slope[i * width] = *m->direct[(i - n) * width];
        else
            row_of(m, i - n, at_states, f->slope + i * width);
    }
    if (columns == 1) return;
    memset(f->right, 0, (size_t)(count * width) * sizeof(double));
    for (int64_t a = 0; a < f->places; a++) {
        if (!f->held[a]) continue;
        for (int64_t c = 1; c < columns; c++) f->right[at * width + c] = -along_place(m, a, f->slope, n, c);
        at++;
    }
    eliminate(f->matrix, f->right, count, width);
    for (int64_t i = n; i < m->states; i++) add_held(m, i - n, f->slope + i * width);
}

int stands_still(const Motion *m, int64_t row) {
    const Friction *f = &m->friction;
    for (int64_t a = 0; a < f->places && row < m->dofs; a++) {
        const double *direction = f->directions + a * m->dofs;
        int64_t others = f->shifts[3 * a + 2] >= 0;
        for (int64_t i = 0; i < m->dofs; i++) others += i != row && direction[i] != 0.0;
        if (f->held[a] && direction[row] != 0.0 && others == 0) return 1;
    }
    return 0;
}

void add_held(const Motion *m, int64_t row, double *to) {
    const Friction *f = &m->friction;
    const double *by = f->right;
    for (int64_t a = 0; a < f->places; a++) {
        if (!f->held[a]) continue;
        double push = m->program.r[f->by_side[a * m->rows + row]];
        for (int64_t c = 1; c < m->columns && push != 0.0; c++) to[c] += push * by[c];
        by += m->width;
    }
}

static void drive_between(const double *drive, int64_t columns, double begin, double end, double *local) {
    for (int i = 0; i < 3; i++) { /* from the parabola through the step's three rows */
        double x = begin + 0.5 * i * (end - begin);
        for (int64_t c = 0; c < columns; c++) {
            double outer = (1.0 - x) * drive[c] - x * drive[2 * columns + c];
            local[i * columns + c] = (1.0 - 2.0 * x) * outer + 4.0 * x * (1.0 - x) * drive[columns + c];
        }
    }
}

/*
 * From the state, which is where the step began: the part of it between two fractions, what is held staying held. The
 * program has then run at the end. A search for an event takes one column.
 */
static void part(Motion *m, double time, double h, double begin, double end, const double *drive, int64_t columns) {
    double *local = m->friction.local;
    drive_between(drive, m->drives, begin, end, local);
    step_on(m, time + begin * h, (end - begin) * h, local, columns);
    run_here(m, time + end * h, local + 2 * m->drives);
}

/* The same from the beginning of the step. */
static void part_again(
    Motion *m, double time, double h, double begin, double end, const double *drive, int64_t columns
) {
    memcpy(m->state, m->friction.begun, (size_t)(m->states * m->width) * sizeof(double));
    m->ran = 0;
    part(m, time, h, begin, end, drive, columns);
}

/* First zero in (0, 1) of the parabola with these ends and mean, v0 >= 0; 2 if it has none. */
static double first_zero(double v0, double v1, double mean) {
    double c = 3.0 * (v0 + v1) - 6.0 * mean, b = v1 - v0 - c, square = b * b - 4.0 * c * v0;
    int dips = v0 > 0.0 && c > 0.0 && -2.0 * c < b && b < 0.0 && square > 0.0;
    if (v1 > 0.0 && !dips) return 2.0;
    double root = sqrt(0.0 > square ? 0.0 : square);
    return b < 0.0 ? 2.0 * v0 / (root - b) : (b + root) / (-2.0 * c);
}

/* Fraction of a part of a step, which took `span`, after which the friction of a place switches; 2 if it does not. */
static double next_of(const Motion *m, int64_t place, double span) {
    const Friction *f = &m->friction;
    double sign = *sign_at(m, place), early = f->early[place];
    if (!f->held[place]) { /* the mean velocity is the change of displacement: it shows a dip between two steps */
        double mean = (displacement_of(m, place) - f->early_motion[2 * place]) / span;
        double v0 = sign * f->early_motion[2 * place + 1];
        v0 = f->fresh[place] || 0.0 > v0 ? 0.0 : v0; /* what set off did so from zero, but for rounding */
        return first_zero(v0, sign * velocity_of(m, place), sign * mean);
    }
    if (fabs(early) > 1.0) return 0.0; /* what else switched has set it free */
    if (fabs(sign) <= 1.0) return 2.0;
    double begin = sign > 0.0 ? early : -early;
    return fabs(sign) > begin ? within_one((1.0 - begin) / (fabs(sign) - begin)) : 0.0;
}

/*
 * Step to where the relative velocity of a place vanishes and switch there; returns that fraction of the step. The
 * guess x, a fraction of what is left of it, is corrected by Newton. The time at which a velocity passes through zero
 * depends on the parameters, and the derivatives of all velocities jump with the accelerations (saltation):
 * s+ = s- - (a- - a+) (e.s-) / (e.a-).
 */
static double switch_at(Motion *m, int64_t a, double time, double h, double begin, double x, const double *drive) {
    int64_t n = m->dofs, width = m->width;
    double sign = *sign_at(m, a), span = (1.0 - begin) * h, end = begin, before = 0.0;
    for (int i = 0; i < CORRECTIONS; i++) {
        x = within_one(x);
        end = begin + x * (1.0 - begin);
        part_again(m, time, h, begin, end, drive, 1);
        before = acceleration_of(m, a);
        if (before * sign >= 0.0) break;
        x -= velocity_of(m, a) / (before * span);
    }
    part_again(m, time, h, begin, end, drive, m->columns);
    double left = before != 0.0 ? velocity_of(m, a) / before : 0.0; /* time by which Newton misses */
    for (int64_t i = 0; i < n; i++) m->friction.before[i] = *m->direct[i * width];
    for (int64_t i = 0; i < n; i++) {
        m->state[i * width] -= m->state[(n + i) * width] * left;
        m->state[(n + i) * width] -= m->friction.before[i] * left;
    }
    *sign_at(m, a) = -sign;
    run_here(m, 0.0, 0);
    if (acceleration_of(m, a) * sign >= 0.0) {
        set_held(m, a, 1);
        run_here(m, 0.0, 0);
    }
    for (int64_t c = 1; c < m->columns; c++) {
        double rate = before != 0.0 ? along_place(m, a, m->state, n, c) / before : 0.0;
        for (int64_t i = 0; i < n; i++)
            m->state[(n + i) * width + c] -= (m->friction.before[i] - *m->direct[i * width]) * rate;
    }
    return end;
}

/*
 * Step to where the other forces overcome friction at a held place and let it go; returns that fraction. The guess x, a
 * fraction of what is left of the step, is corrected by secants: what is let go too early would turn back at once.
 */
static double release(Motion *m, int64_t a, double time, double h, double begin, double x, const double *drive) {
    double early = m->friction.early[a], low = 0.0, at_low = fabs(early), end = begin;
    double sign = copysign(1.0, fabs(early) > 1.0 ? early : *sign_at(m, a));
    for (int i = 0; i < CORRECTIONS; i++) {
        end = begin + x * (1.0 - begin);
        part_again(m, time, h, begin, end, drive, 1);
        double now = sign * *sign_at(m, a);
        if (now == at_low || fabs(now - 1.0) < CLOSE) break;
        double rise = x != low ? (now - at_low) / (x - low) : 0.0;
        low = x;
        at_low = now;
        if (rise <= 0.0) break;
        x = within_one(x + (1.0 - now) / rise);
    }
    part_again(m, time, h, begin, end, drive, m->columns);
    set_held(m, a, 0);
    *sign_at(m, a) = sign;
    return end;
}

void switching_step(Motion *m, double time, double h, const double *drive) {
    Friction *f = &m->friction;
    double begin = 0.0;
    memset(f->fresh, 0, (size_t)f->places * sizeof(int64_t));
    for (int64_t cut = 0; cut <= CUTS * f->places; cut++) {
        memcpy(f->begun, m->state, (size_t)(m->states * m->width) * sizeof(double));
        for (int64_t a = 0; a < f->places; a++) {
            f->early[a] = *sign_at(m, a);
            f->early_motion[2 * a] = displacement_of(m, a);
            f->early_motion[2 * a + 1] = velocity_of(m, a);
        }
        part(m, time, h, begin, 1.0, drive, m->columns);
        int64_t first = -1;
        double least = 1.0;
        for (int64_t a = 0; a < f->places; a++) {
            double x = next_of(m, a, (1.0 - begin) * h);
            if (x <= least) {
                first = a;
                least = x;
            }
        }
        if (first < 0 || cut == CUTS * f->places) return;
        memset(f->fresh, 0, (size_t)f->places * sizeof(int64_t));
        if (f->held[first]) {
            f->fresh[first] = 1;
            begin = release(m, first, time, h, begin, least, drive);
        } else
            begin = switch_at(m, first, time, h, begin, least, drive);
        if (begin >= 1.0) return;
    }
}

void set_sides(Motion *m, double time, const double *drive) {
    const Friction *f = &m->friction;
    for (int64_t a = 0; a < f->places; a++) set_held(m, a, 0);
    run_here(m, time, drive);
    for (int64_t a = 0; a < f->places; a++) {
        double velocity = velocity_of(m, a);
        set_held(m, a, velocity == 0.0);
        *sign_at(m, a) = sign_of(velocity);
    }
    for (int64_t round = 0; round < f->places; round++) {
        run_here(m, time, drive);
        for (int64_t a = 0; a < f->places; a++)
            if (f->held[a] && fabs(*sign_at(m, a)) > 1.0) {
                set_held(m, a, 0);
                *sign_at(m, a) = copysign(1.0, *sign_at(m, a));
            }
    }
}
