/* A vehicle as the unit sees it: for each wheel an input, the height of the road, with its rate. */
#define PAIRS MODEL_WHEELS
#define RATES PAIRS
#define OUTPUTS MODEL_OUTPUTS
#define STATES MODEL_STATES
#define CARRY MODEL_CARRY
#define MATRICES MODEL_MATRICES
#define RATES_GIVEN 0 /* until one is not zero, co-simulation takes it from the heights */
#define NUMBERS_MOVE 0 /* they hold over a step */
#define UNUSED(name) ((void)(name))

static void prepare(const model_parameters *p, double h, double *m) { model_prepare(p, h, m); }

static void start(const model_parameters *p, const double *m, const double *u, double *c) {
    UNUSED(p);
    model_start(m, u, u + PAIRS, c);
}

static void resume(const double *m, const double *u, double ratio, double *c) {
    model_resume(m, u, u + PAIRS, ratio, c);
}

/* n steps, while the road goes straight. */
static void advance(const model_parameters *p0, const model_parameters *p1, const double *m, const double *u0,
                    const double *u1, double h, int n, double *c) {
    double from[2 * PAIRS], to[2 * PAIRS];
    int i, k;
    UNUSED(p0), UNUSED(p1), UNUSED(h);
    for (i = 0; i < n; ++i) {
        for (k = 0; k < 2 * PAIRS; ++k) {
            from[k] = u0[k] + (double)i / n * (u1[k] - u0[k]);
            to[k] = u0[k] + (double)(i + 1) / n * (u1[k] - u0[k]);
        }
        model_step(m, from, from + PAIRS, to, to + PAIRS, c);
    }
}

static void observe(const model_parameters *p, const double *m, const double *x, const double *u, double *rate,
                    double *y) {
    UNUSED(p);
#ifdef PERIOD
    UNUSED(rate);
#else
    model_state_rate(m, x, u, u + PAIRS, rate);
#endif
    model_outputs(m, x, u, u + PAIRS, y);
}

#ifndef PERIOD
static void observe_derivative(const model_parameters *p, const model_parameters *dp, const double *x, const double *dx,
                               const double *u, const double *du, double *drate, double *dy) {
    model_derivative(p, dp, x, dx, u, du, u + PAIRS, du + PAIRS, drate, dy);
}
#endif
