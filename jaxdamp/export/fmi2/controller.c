/* A controller as the unit sees it: inputs without rates, held until they are set again. */
#define PAIRS MODEL_INPUTS
#define RATES 0
#define OUTPUTS MODEL_OUTPUTS
#define STATES 0
#define CARRY MODEL_CARRY
#define MATRICES MODEL_MATRICES
#define RATES_GIVEN 0
#define NUMBERS_MOVE 0 /* they hold over a step */
#define UNUSED(name) ((void)(name))

static void prepare(const model_parameters *p, double h, double *m) { model_prepare(p, h, m); }

static void start(const model_parameters *p, const double *m, const double *u, double *c) {
    UNUSED(p);
    model_start(m, u, c);
}

static void resume(const double *m, const double *u, double ratio, double *c) {
    UNUSED(m), UNUSED(u);
    model_resume(ratio, c);
}

/* n steps, while the inputs go straight. */
static void advance(const model_parameters *p0, const model_parameters *p1, const double *m, const double *u0,
                    const double *u1, double h, int n, double *c) {
    double u[PAIRS];
    int i, k;
    UNUSED(p0), UNUSED(p1), UNUSED(h);
    for (i = 1; i <= n; ++i) {
        for (k = 0; k < PAIRS; ++k) u[k] = i == n ? u1[k] : u0[k] + (double)i / n * (u1[k] - u0[k]);
        model_step(m, u, c);
    }
}

static void observe(const model_parameters *p, const double *m, const double *x, const double *u, double *rate,
                    double *y) {
    UNUSED(p), UNUSED(m), UNUSED(u), UNUSED(rate);
    model_outputs(x, y);
}
