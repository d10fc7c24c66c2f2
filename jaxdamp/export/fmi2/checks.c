/* Whether numbers are allowed and results are numbers; `why` takes the text for the logger. It stands before unit.c. */
#include <float.h>
#include <math.h>
#include <stdio.h>

#define NUMBERS (sizeof(model_parameters) / sizeof(double))
#define TEXT 1000

static int is_number(double value) { return value >= -DBL_MAX && value <= DBL_MAX; }

static int is_outside(size_t k, double value, char *why) {
    if (value >= model_limits[k].lower && value <= model_limits[k].upper) return 0;
    snprintf(why, TEXT, "%s must be %s, but is %g.", model_limits[k].name, model_limits[k].must, value);
    return 1;
}

/* What holds between numbers, which are set one after the other. */
static int is_inconsistent(const model_parameters *p, char *why) {
    const double *number = (const double *)p;
    size_t k;
    for (k = 1; k < NUMBERS; ++k)
        if (model_limits[k].rises && !(number[k] > number[k - 1])) {
            snprintf(why, TEXT, "%s must be greater than %s, but they are %g and %g.", model_limits[k].name,
                     model_limits[k - 1].name, number[k], number[k - 1]);
            return 1;
        }
#if MODEL_CONDITIONS
    {
        double margin[MODEL_CONDITIONS];
        model_margins(p, margin);
        for (k = 0; k < MODEL_CONDITIONS; ++k)
            if (!(margin[k] > 0.0)) {
                snprintf(why, TEXT, "%s It is too low by %g.", model_conditions[k], -margin[k]);
                return 1;
            }
    }
#endif
    return 0;
}
