/* A damper law as the unit sees it: one input, the stroke, with its rate, the velocity. */
#include <string.h>

#define PAIRS 1
#define RATES PAIRS
#define OUTPUTS 1
#define STATES MODEL_STATES
#define CARRY MODEL_STATES
#define MATRICES 0
#define RATES_GIVEN 1 /* the velocity is an input that counts even where it is zero */
#define NUMBERS_MOVE 1 /* straight over a step */
#define UNUSED(name) ((void)(name))

static void prepare(const model_parameters *p, double h, double *m) { UNUSED(p), UNUSED(h), UNUSED(m); }

static void start(const model_parameters *p, const double *m, const double *u, double *c) {
    UNUSED(m);
    model_init(p, u[0], c);
}

static void resume(const double *m, const double *u, double ratio, double *c) {
    UNUSED(m), UNUSED(u), UNUSED(ratio), UNUSED(c);
}

/* n steps: velocity and numbers are linear in time, the stroke the cubic with these velocities. */
static void advance(const model_parameters *p0, const model_parameters *p1, const double *m, const double *u0,
                    const double *u1, double h, int n, double *c) {
    const double x0 = u0[0], v0 = u0[1], x1 = u1[0], v1 = u1[1];
    const double *from = (const double *)p0, *to = (const double *)p1;
    const int moves = memcmp(from, to, sizeof *p0) != 0;
    model_parameters middle = *p1;
    double x = x0, v = v0;
    int i;
    size_t k;
    UNUSED(m);
    for (i = 1; i <= n; ++i) {
        const double s = (double)i / n, r = 1.0 - s, half = (i - 0.5) / n;
        const double rise = h * (v0 * s * r * r - v1 * s * s * r);
        const double next = i == n ? x1 : x0 * (1.0 + 2.0 * s) * r * r + x1 * s * s * (3.0 - 2.0 * s) + rise;
        const double faster = i == n ? v1 : v0 + s * (v1 - v0);
        for (k = 0; moves && k < sizeof middle / sizeof *to; ++k)
            ((double *)&middle)[k] = from[k] + half * (to[k] - from[k]);
        model_advance(&middle, x, v, next, faster, h / n, c);
        x = next;
        v = faster;
    }
}

static void observe(const model_parameters *p, const double *m, const double *x, const double *u, double *rate,
                    double *y) {
    UNUSED(m);
    model_state_rate(p, u[0], u[1], x, rate);
    y[0] = model_force(p, u[0], u[1], x);
}

static void observe_derivative(const model_parameters *p, const model_parameters *dp, const double *x, const double *dx,
                               const double *u, const double *du, double *drate, double *dy) {
    model_state_rate_derivative(p, dp, u[0], du[0], u[1], du[1], x, dx, drate);
    dy[0] = model_force_derivative(p, dp, u[0], du[0], u[1], du[1], x, dx);
}
