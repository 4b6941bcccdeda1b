/* Running a program: one instruction after the other, each into a register. */

#include "program.h"

#include <math.h>
#include <stdlib.h>

/* Each operation of graph.Op in the order of its numbers, with its result: those that a processor does of pairs, */
#define OF_PAIRS(DO) \
    DO(0, a + b)     \
    DO(1, a - b)     \
    DO(2, a * b)     \
    DO(3, a / b)     \
    DO(4, -a)
/* and those of single numbers. */
#define OF_NUMBERS(DO)                             \
    DO(5, fabs(a))                                 \
    DO(6, a > 0.0 ? 1.0 : (a < 0.0 ? -1.0 : 0.0))  \
    DO(7, a > b ? a : b)                           \
    DO(8, a < b ? a : b)                           \
    DO(9, a > b ? 1.0 : 0.0)                       \
    DO(10, sin(a))                                 \
    DO(11, cos(a))                                 \
    DO(12, exp(a))                                 \
    DO(13, log(a))                                 \
    DO(14, sqrt(a))                                \
    DO(15, tanh(a))                                \
    DO(16, pow(a, b))
#define EACH_OPERATION(DO) OF_PAIRS(DO) OF_NUMBERS(DO)

static double result_of(int64_t op, double a, double b) {
    switch (op) {
#define CASE(number, result) \
    case number:             \
        return result;
        EACH_OPERATION(CASE)
    default:
        return NAN;
    }
}

/*
 * An operand that the instruction before has computed is taken from the processor, not from the memory, where it takes
 * as long to come back as two additions: the number of an operation is 4 times that of graph.Op, plus 1 if its first
 * operand is such a one, and 2 if the second is.
 */
#if defined(__GNUC__)
#define OPERATION(Kind, label, one, other, result) \
    label : {                                      \
        const Kind a = one, b = other;             \
        (void)b;                                   \
        last = result;                             \
        *(Kind *)i->to = last;                     \
        i++;                                       \
        goto *i->op;                               \
    }
#define OPERATIONS_OF(Kind, number, result)                                                 \
    OPERATION(Kind, from_memory_##number, *(const Kind *)i->a, *(const Kind *)i->b, result) \
    OPERATION(Kind, first_##number, last, *(const Kind *)i->b, result)                      \
    OPERATION(Kind, second_##number, *(const Kind *)i->a, last, result)                     \
    OPERATION(Kind, both_##number, last, last, result)
#define OF_NUMBER(number, result) OPERATIONS_OF(double, number, result)
#define OF_PAIR(number, result) OPERATIONS_OF(Pair, number, result)
#define OF_EACH(number, result) OF_PAIR(number, pair(result_of(number, a[0], b[0]), result_of(number, a[1], b[1])))
#define LABELS(number, result) &&from_memory_##number, &&first_##number, &&second_##number, &&both_##number,

/*
 * Each operation jumps to the next one itself: a processor foresees that better than the one jump of a switch. Returns
 * where each is written out, by its number; without instructions it does nothing else.
 */
#if !defined(__clang__)
__attribute__((optimize("no-crossjumping"))) /* gcc would merge these jumps again */
#endif
static const Operation *run_from(const Instruction *i) {
    static const Operation OPERATIONS[] = {EACH_OPERATION(LABELS) &&end};
    double last = 0.0;
    if (!i) return OPERATIONS;
    goto *i->op;
    EACH_OPERATION(OF_NUMBER)
end:
    return OPERATIONS;
}

static Operation operation_of(int64_t number) { return run_from(0)[number]; }

/* The same of pairs; a compiler that hoists would compute before each jump what some operations begin with. */
#if !defined(__clang__)
__attribute__((optimize("no-crossjumping", "no-code-hoisting")))
#endif
static const Operation *run_pairs_from(const Instruction *i) {
    static const Operation OPERATIONS[] = {EACH_OPERATION(LABELS) &&end};
    Pair last = pair(0.0, 0.0);
    if (!i) return OPERATIONS;
    goto *i->op;
    OF_PAIRS(OF_PAIR)
    OF_NUMBERS(OF_EACH)
end:
    return OPERATIONS;
}

static Operation pair_operation_of(int64_t number) { return run_pairs_from(0)[number]; }
#else
static void run_from(const Instruction *i) {
    for (; i->op != END; i++) *i->to = result_of(i->op / 4, *i->a, *i->b);
}

static void run_pairs_from(const Instruction *i) {
    for (; i->op != END; i++)
        for (int lane = 0; lane < 2; lane++) i->to[lane] = result_of(i->op / 4, i->a[lane], i->b[lane]);
}

static Operation operation_of(int64_t number) { return number; }

static Operation pair_operation_of(int64_t number) { return number; }
#endif

void run_prepared(const Program *program) { run_from(program->code); }

void run_rest(const Program *program) { run_from(program->rest); }

void run_pairs(const Instruction *code) { run_pairs_from(code); }

int prepare_program(
    Program *program, const int64_t *code, int64_t count, int64_t split, int64_t first, double *r, int64_t changing,
    const int64_t *others, int64_t other_count, const char *needed
) {
    char *changes = calloc((size_t)(first + count + 1), 1);
    Instruction *next = program->code = malloc((size_t)(count + 2) * (sizeof(Instruction) + 1));
    unsigned char *number = program->numbers = (unsigned char *)(next + count + 2);
    program->r = r;
    if (!changes || !program->code) {
        free(changes);
        forget_program(program);
        return 0;
    }
    for (int64_t i = 0; i < changing && i < first; i++) changes[i] = 1;
    for (int64_t i = 0; i < other_count; i++) changes[others[i]] = 1;
    const double *last = 0; /* register of the instruction before */
    for (int64_t i = 0; i <= count; i++) {
        if (i == split || i == count) {
            *next++ = (Instruction){operation_of(END), r, r, r};
            *number++ = END;
            last = 0;
            if (i == split) program->rest = next;
        }
        if (i == count) break;
        int64_t op = code[3 * i], a = code[3 * i + 1], b = code[3 * i + 2], to = first + i;
        changes[to] = changes[a] || changes[b];
        if (changes[to]) {
            if (needed && !needed[to]) continue;
            op = 4 * op + (r + a == last) + 2 * (r + b == last);
            *next++ = (Instruction){operation_of(op), r + a, r + b, r + to};
            *number++ = (unsigned char)op;
            last = r + to;
        } else
            r[to] = result_of(op, r[a], r[b]);
    }
    if (split == count) program->rest = next - 1;
    program->count = next - program->code;
    free(changes);
    return 1;
}

int prepare_pairs(Program *pairs, const Program *single, int64_t registers) {
    size_t of_code = (size_t)single->count * sizeof(Instruction);
    Instruction *code = pairs->code = malloc(of_code + 2 * (size_t)registers * sizeof(double));
    double *r = pairs->r = (double *)((char *)code + of_code);
    if (!code) return 0;
    pairs->rest = code + (single->rest - single->code);
    for (int64_t i = 0; i < registers; i++) r[2 * i] = r[2 * i + 1] = single->r[i];
    for (int64_t i = 0; i < single->count; i++) {
        const Instruction *one = single->code + i;
        int64_t a = one->a - single->r, b = one->b - single->r, to = one->to - single->r;
        code[i] = (Instruction){pair_operation_of(single->numbers[i]), r + 2 * a, r + 2 * b, r + 2 * to};
    }
    return 1;
}

void forget_program(Program *program) {
    free(program->code);
    program->code = 0;
}

/* Run the code for every sample: its data into the registers `columns`, the registers `outputs` into `out`. */
EXPORT int64_t evaluate(
    const int64_t *code, int64_t count, int64_t first, double *r, const int64_t *columns, int64_t column_count,
    const double *data, int64_t samples, const int64_t *outputs, int64_t output_count, double *out
) {
    Program program;
    if (!prepare_program(&program, code, count, count, first, r, 0, columns, column_count, 0)) return NO_MEMORY;
    for (int64_t i = 0; i < samples; i++) {
        for (int64_t c = 0; c < column_count; c++) r[columns[c]] = data[i * column_count + c];
        run_prepared(&program);
        for (int64_t k = 0; k < output_count; k++) out[i * output_count + k] = r[outputs[k]];
    }
    forget_program(&program);
    return ALL_FINITE;
}
