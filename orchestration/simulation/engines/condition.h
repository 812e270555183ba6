/* The condition of divergence, with a bound on the difference of each number from the one that Python computes: 0 where
   both do the same operations of IEEE 754, some rounding errors where a root or a source is involved. Where the bounds
   do not decide, Python does. */

enum { NUMBER, TIME, SIGNAL, SOURCE, OPERATOR }; /* leaves, and the first operator */
enum { DEEPEST = 256 };                          /* the size of the stack */

typedef struct {
    int64_t code, operands; /* an operator of operators.h, or a leaf; of SIGNAL and SOURCE `operands` is the place */
    double number;
} Operation;

typedef struct {
    double value, error;
} Known;

#define SOURCES_AGREE 1e-9 /* relative difference between a source over many times and at one time */

static Known known(double value, double error) {
    if (!isfinite(value) || !isfinite(error)) return (Known){0.0, INFINITY};
    return (Known){value, error > 0.0 ? error * 1.000001 + fabs(value) * 1e-15 : 0.0};
}

static Known product(Known a, Known b) {
    return known(a.value * b.value, fabs(a.value) * b.error + fabs(b.value) * a.error + a.error * b.error);
}

static Known quotient(Known a, Known b) {
    double q = a.value / b.value;
    if (fabs(b.value) <= b.error) return (Known){0.0, INFINITY};
    return known(q, (a.error + fabs(q) * b.error) / (fabs(b.value) - b.error));
}

static Known norm(const Known *parts, int64_t count) {
    double sum = 0.0, error = 0.0;
    for (int64_t i = 0; i < count; i++) sum += parts[i].value * parts[i].value, error += parts[i].error;
    double value = sqrt(sum);
    return known(value, error + value * 1e-13 + 1e-150);
}

static Known truth(int is, int undecided) { return undecided ? (Known){1.0, INFINITY} : (Known){is, 0.0}; }

static int is_close(Known a, Known b) {
    double error = a.error + b.error;
    return error > 0.0 && !(fabs(a.value - b.value) > error);
}

static int is_undecided(Known a) { return a.error > 0.0 && !(fabs(a.value) > a.error); }

/* `ends`: the truth value of one part that decides the result. */
static Known joined(int ends, const Known *parts, int64_t count) {
    int open = 0;
    for (int64_t i = 0; i < count; i++) {
        if (is_undecided(parts[i]))
            open = 1;
        else if ((parts[i].value != 0.0) == ends)
            return truth(ends, 0);
    }
    return truth(!ends, open);
}

#include "operators.h"

/* Whether the condition may hold: it does, or the bounds do not decide. */
static int may_hold(const Operation *program, int64_t length, double t, const double *row, const double *sources) {
    Known stack[DEEPEST];
    int64_t top = 0;
    for (const Operation *o = program; o < program + length; o++) {
        int64_t n = o->operands;
        if (o->code < OPERATOR) {
            stack[top++] = o->code == NUMBER ? known(o->number, 0.0)
                : o->code == TIME            ? known(t, 0.0)
                : o->code == SIGNAL          ? known(row[n], 0.0)
                                             : known(sources[n], SOURCES_AGREE * (1.0 + fabs(sources[n])));
            continue;
        }
        Known *a = stack + top - n;
        *a = applied(o->code, a, n);
        top += 1 - n;
    }
    return is_undecided(stack[0]) || stack[0].value != 0.0;
}
