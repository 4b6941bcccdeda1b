/* The steps of motion.c for two motions at once: what one of them waits for leaves a processor time for the other. */

#include "two_motions.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#if defined(__GNUC__)
#define ALWAYS_INLINE static inline __attribute__((always_inline)) /* code of its own for each number of columns */
#else
#define ALWAYS_INLINE static inline
#endif

static const Pair NONE[1]; /* zeros */

int prepare_two(TwoMotions *two, const Motion *one, int64_t registers) {
    size_t size = (size_t)(one->states * one->columns), rows = (size_t)one->rows;
    int64_t partials = one->ends[one->rows];
    const double *r = one->program.r;
    two->one = one;
    two->state = calloc(4 * size + 1, sizeof(Pair));
    two->direct = malloc((rows * (size_t)one->columns + 1) * sizeof(Pair *));
    two->by_state = malloc(((size_t)partials + 1) * sizeof(PairPartial));
    if (!prepare_pairs(&two->program, &one->program, registers)) return 0;
    if (!two->state || !two->direct || !two->by_state) return 0;
    two->trial = two->state + size;
    two->other = two->trial + size;
    two->sum = two->other + size;
    two->r = (Pair *)two->program.r;
    for (int64_t row = 0; row < one->rows; row++)
        for (int64_t c = 0; c < one->columns; c++) {
            const double *from = one->direct[row * one->width + c];
            two->direct[row * one->columns + c] = from == &NO_DERIVATIVE ? NONE : two->r + (from - r);
        }
    for (int64_t i = 0; i < partials; i++)
        two->by_state[i] = (PairPartial){one->by_state[i].of, two->r + (one->by_state[i].from - r)};
    return 1;
}

void forget_two(TwoMotions *two) {
    forget_program(&two->program);
    free(two->state);
    free(two->direct);
    free(two->by_state);
}

/* So many columns of a row, from `first` on, where the program has run at the states `at`. */
ALWAYS_INLINE void row_of_both(
    const TwoMotions *two, int64_t row, const Pair *at, Pair *restrict to, int64_t columns, int64_t first, int64_t count
) {
    const Pair *const *direct = two->direct + row * columns + first;
    const PairPartial *state = two->by_state + two->one->ends[row], *last = two->by_state + two->one->ends[row + 1];
    for (int64_t c = 0; c < count; c++) to[c] = *direct[c];
    for (; state < last && columns > 1; state++) {
        Pair by = *state->from;
        const Pair *row_of_state = at + state->of * columns + first;
        for (int64_t c = first == 0; c < count; c++) to[c] = plus_product(to[c], by, row_of_state[c]);
    }
}

/* Columns of a state in one stage of a step, as `advance` of one motion. */
ALWAYS_INLINE void advance_both(
    const TwoMotions *two, int64_t i, const Pair *at, Pair *next, double weight, double ahead, int64_t columns,
    int64_t first, int64_t count
) {
    const int64_t dofs = two->one->dofs, begin = i * columns + first;
    Pair by = pair(weight, weight), on = pair(ahead, ahead), *registers = two->r + 1 + two->one->drives;
    Pair slope[WIDEST] = {{0.0, 0.0}}, *restrict sum = two->sum + begin, *restrict to = next + begin;
    const Pair *restrict state = two->state + begin, *velocity = at + dofs * columns + begin;
    if (i < dofs)
        for (int64_t c = 0; c < count; c++) slope[c] = velocity[c];
    else
        row_of_both(two, i - dofs, at, slope, columns, first, count);
    if (first == 0) registers[i] = plus_product(state[0], on, slope[0]);
    for (int64_t c = 0; c < count; c++) {
        sum[c] = plus_product(sum[c], by, slope[c]);
        to[c] = plus_product(state[c], on, slope[c]);
    }
}

#define EACH_COUNT(DO) DO(1) DO(2) DO(3) DO(4) DO(5) DO(6) DO(7) DO(8) DO(9) DO(10) DO(11) DO(12)

/* A row wider than WIDEST in parts. */
static void advance_in_parts(
    const TwoMotions *two, int64_t i, const Pair *at, Pair *next, double weight, double ahead, int64_t columns
) {
    int64_t first = 0;
    for (; columns - first > WIDEST; first += WIDEST)
        advance_both(two, i, at, next, weight, ahead, columns, first, WIDEST);
    switch (columns - first) {
#define REST(count)                                                           \
    case count:                                                               \
        advance_both(two, i, at, next, weight, ahead, columns, first, count); \
        break;
        EACH_COUNT(REST)
    }
}

/* One stage of a step, as `stage_of` of one motion. */
ALWAYS_INLINE void stage_of_both(
    const TwoMotions *two, int64_t ran, const Pair *at, Pair *next, double weight, double ahead, int64_t columns
) {
    const TwoMotions t = *two; /* whose pointers no pair that is written can change */
    const int64_t states = t.one->states;
    if (!ran) run_pairs(t.program.code);
    for (int64_t i = 0; i < states; i++)
        if (columns <= WIDEST)
            advance_both(&t, i, at, next, weight, ahead, columns, 0, columns);
        else
            advance_in_parts(two, i, at, next, weight, ahead, columns);
}

static inline void drive_both(const TwoMotions *two, const double times[2], double later, const double *const drive[2]) {
    const double *one = drive[0], *other = drive[1];
    Pair *r = two->r;
    int64_t drives = two->one->drives;
    r[0] = pair(times[0] + later, times[1] + later);
    for (int64_t c = 0; c < drives; c++) r[1 + c] = pair(one[c], other[c]);
}

static inline void states_into_registers(const TwoMotions *two) {
    for (int64_t i = 0; i < two->one->states; i++)
        two->r[1 + two->one->drives + i] = two->state[i * two->one->columns];
}

ALWAYS_INLINE void step_of_both(
    const TwoMotions *two, int64_t ran, const double times[2], double h, const double *const drive[2], int64_t columns
) {
    const TwoMotions t = *two;
    const int64_t size = t.one->states * columns, drives = t.one->drives, onto = t.one->onto;
    const double half = h * 0.5, third = h / 3.0, sixth = h / 6.0;
    const double *middle[2] = {drive[0] + drives, drive[1] + drives};
    const double *end[2] = {middle[0] + drives, middle[1] + drives};
    for (int64_t c = 0; c < size; c++) t.sum[c] = onto ? t.state[c] : pair(0.0, 0.0);
    if (!ran) {
        states_into_registers(two);
        drive_both(two, times, 0.0, drive);
    }
    stage_of_both(two, ran, t.state, t.trial, sixth, half, columns);
    drive_both(two, times, half, middle);
    stage_of_both(two, 0, t.trial, t.other, third, half, columns);
    stage_of_both(two, 0, t.other, t.trial, third, h, columns);
    drive_both(two, times, h, end);
    stage_of_both(two, 0, t.trial, t.other, sixth, half, columns);
    for (int64_t c = 0; c < size; c++)
        t.state[c] = onto ? t.sum[c] : plus_product(t.state[c], pair(1.0, 1.0), t.sum[c]);
}

static void step_both(
    const TwoMotions *two, int64_t ran, const double times[2], double h, const double *const drive[2]
) {
    switch (two->one->columns) {
#define STEP(columns)                                     \
    case columns:                                         \
        step_of_both(two, ran, times, h, drive, columns); \
        return;
        EACH_COUNT(STEP)
    default:
        step_of_both(two, ran, times, h, drive, two->one->columns);
    }
}

static int are_finite(Pair a) { return isfinite(first_of(a)) && isfinite(second_of(a)); }

static int are_near(Pair a) { return fabs(first_of(a)) < FAR && fabs(second_of(a)) < FAR; }

/* As `observe` of one motion. */
static int observe_both(TwoMotions *two, const int64_t *observed, int64_t count, double *const out[2]) {
    const Motion *m = two->one;
    int64_t columns = m->columns, own = 0;
    for (int64_t i = 0; i < m->dofs; i++)
        if (!(are_near(two->state[i * columns]) && are_near(two->state[(m->dofs + i) * columns]) &&
              are_finite(*two->direct[i * columns])))
            return 0;
    for (int64_t k = 0; k < count; k++) own += observed[k] >= m->states;
    if (own) run_pairs(two->program.rest);
    for (int64_t k = 0; k < count; k++) {
        const Pair *found = two->state + observed[k] * columns;
        if (observed[k] >= m->states) {
            row_of_both(two, observed[k] - m->states, two->state, two->sum, columns, 0, columns);
            if (!are_finite(two->sum[0])) return 0;
            found = two->sum;
        }
        for (int64_t c = 0; c < columns; c++) {
            out[0][k * columns + c] = first_of(found[c]);
            out[1][k * columns + c] = second_of(found[c]);
        }
    }
    return 1;
}

int along_both(
    TwoMotions *two, double *const states[2], const double starts[2], double dt, int64_t steps,
    const double *const drive[2], const int64_t *observed, int64_t count, int64_t samples, double *const out[2],
    double *begun
) {
    const Motion *m = two->one;
    int64_t size = m->states * m->columns;
    double h = dt / (double)steps;
    for (int64_t c = 0; c < size; c++) two->state[c] = pair(states[0][c], states[1][c]);
    for (int64_t sample = 0; sample < samples; sample++) {
        int64_t row = 2 * steps * sample * m->drives, target = sample * count * m->columns;
        const double *at[2] = {drive[0] + row, drive[1] + row};
        double *const to[2] = {out[0] + target, out[1] + target};
        double times[2] = {starts[0] + (double)sample * dt, starts[1] + (double)sample * dt};
        states_into_registers(two);
        drive_both(two, times, 0.0, at);
        run_pairs(two->program.code);
        if (!observe_both(two, observed, count, to)) return 0;
        if (sample == 0) memcpy(begun, to[1], (size_t)(count * m->columns) * sizeof(double));
        for (int64_t s = 0; s < steps && sample + 1 < samples; s++) {
            double now[2] = {times[0] + (double)s * h, times[1] + (double)s * h};
            step_both(two, s == 0, now, h, at);
            at[0] += 2 * m->drives;
            at[1] += 2 * m->drives;
        }
    }
    for (int64_t c = 0; c < size; c++) {
        states[0][c] = first_of(two->state[c]);
        states[1][c] = second_of(two->state[c]);
    }
    return 1;
}
