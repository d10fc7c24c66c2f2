/* The laws. Each has parameters p[..][lane] as prepared once per run from those of the table, a stroke x, a velocity v
   and at most one state s, which is SMOOTH if it has no kink where the velocity has one; if not, `predict` gives the
   state at the end of a step roughly. `memory` is what a law may keep from one call to the next, such as the last root
   of a search. */
#ifndef LAWS_H
#define LAWS_H

#include "lanes.h"

/* Newton steps from a start that is close already: the last root. */
#ifndef RATE_NEWTON
#define RATE_NEWTON 1
#define STAGE_NEWTON 2
#endif

#define LAW_ARGUMENTS const Row *p, int i, double x, double v, double s

/* Besinger: c1, c2, C_b, v_lim, 1/alpha; then the force at v_lim. */

static inline double besinger(const Row *p, int i, double v)
{
    double closed = v < p[3][i] ? v : p[3][i];
    double u = closed * p[4][i] - 1.0;
    return (p[0][i] * u / sqrt(1.0 + u * u) + p[1][i]) * closed + p[2][i] * (v - closed);
}

static inline void prepare_besinger(const double *from, Row *p, int i)
{
    p[0][i] = 0.5 * (from[1] - from[0]);
    p[1][i] = 0.5 * (from[1] + from[0]);
    p[2][i] = from[2];
    p[3][i] = from[3];
    p[4][i] = 1.0 / from[4];
    p[5][i] = besinger(p, i, from[3]);
}

#define besinger_PARAMETERS 5
#define besinger_SMOOTH 0
static inline void besinger_prepare(const double *from, Row *p, int i, double dt)
{
    prepare_besinger(from, p, i);
}

static inline double besinger_force(LAW_ARGUMENTS) { return besinger(p, i, v); }
static inline double besinger_rate(LAW_ARGUMENTS, double *memory) { return 0.0; }
static inline double besinger_predict(LAW_ARGUMENTS, double v0, double dt, double *memory) { return 0.0; }
static inline double besinger_advance(LAW_ARGUMENTS, double v0, double dt, double *memory) { return 0.0; }

/* Lag: Besinger behind a first-order lag; 1/tau, then what carries the force over a step. The state is the force. */

#define lag_PARAMETERS 6
#define lag_SMOOTH 1
static inline void lag_prepare(const double *from, Row *p, int i, double dt)
{
    double z = dt / from[5], kept = exp(-z), mean = (1.0 - kept) / z;
    prepare_besinger(from, p, i);
    p[6][i] = 1.0 / from[5];
    p[7][i] = kept;
    p[8][i] = mean - kept;
    p[9][i] = 1.0 - mean;
}

static inline double lag_force(LAW_ARGUMENTS) { return s; }
static inline double lag_rate(LAW_ARGUMENTS, double *memory) { return (besinger(p, i, v) - s) * p[6][i]; }

/* Called once a step, so `memory` has Besinger's force at v0. */
static inline double lag_advance(LAW_ARGUMENTS, double v0, double dt, double *memory)
{
    double before = *memory, after = *memory = besinger(p, i, v);
    return p[7][i] * s + p[8][i] * before + p[9][i] * after;
}

/* Series spring: k1, k3. The state is the deflection of the spring. */

#define series_spring_PARAMETERS 7
#define series_spring_SMOOTH 1
static inline void series_spring_prepare(const double *from, Row *p, int i, double dt)
{
    prepare_besinger(from, p, i);
    p[6][i] = from[5];
    p[7][i] = from[6];
}

static inline double series_spring_force(LAW_ARGUMENTS) { return (p[6][i] + p[7][i] * s * s) * s; }

/* The valve is open where the force exceeds that at v_lim: there the law is a straight line. Elsewhere Newton, whose
   step is multiplied out, so that it takes one root and one division. */
static inline double series_spring_rate(LAW_ARGUMENTS, double *memory)
{
    double force = series_spring_force(p, i, x, v, s), over = force - p[5][i], w = *memory;
    for (int k = 0; k < RATE_NEWTON; k++) {
        double u = w * p[4][i] - 1.0, n = 1.0 + u * u, root = sqrt(n), rate = p[0][i] * u + p[1][i] * root;
        w -= n * (rate * w - force * root) / (n * rate + p[0][i] * p[4][i] * w);
        w = w < p[3][i] ? w : p[3][i];
    }
    *memory = w;
    return v - (over > 0.0 ? p[3][i] + over / p[2][i] : w);
}

/* The end of a stage that lasts h: F_law(w) = F_spring(free - h w), by Newton on the side of v_lim where the root is. */
static inline double series_spring_stage(const Row *p, int i, double free, double h, double *memory)
{
    double over = series_spring_force(p, i, 0.0, 0.0, free - h * p[3][i]) - p[5][i], last = *memory;
    double w = over > 0.0 ? fmax(last, p[3][i]) : fmin(last, p[3][i]);
    for (int k = 0; k < STAGE_NEWTON; k++) {
        double d = free - h * w, carried = series_spring_force(p, i, 0.0, 0.0, d);
        double stiffness = h * (p[6][i] + 3.0 * p[7][i] * d * d);
        double u = w * p[4][i] - 1.0, n = 1.0 + u * u, root = sqrt(n), rate = p[0][i] * u + p[1][i] * root;
        double surplus = over > 0.0 ? p[5][i] + p[2][i] * (w - p[3][i]) - carried : n * (rate * w - carried * root);
        double slope = over > 0.0 ? p[2][i] + stiffness : n * (rate + stiffness * root) + p[0][i] * p[4][i] * w;
        w -= surplus / slope;
    }
    *memory = w;
    return free - h * w;
}

/* The two-stage SDIRK step, second order, L-stable. */
static inline double series_spring_advance(LAW_ARGUMENTS, double v0, double dt, double *memory)
{
    const double gamma = 1.0 - 0.70710678118654752440, h = gamma * dt;
    double first = s + h * (v0 + gamma * (v - v0));
    double d = series_spring_stage(p, i, first, h, &memory[0]);
    double spent = (1.0 - gamma) / gamma * (first - d);
    return series_spring_stage(p, i, s + 0.5 * dt * (v0 + v) - spent, h, &memory[LANES]);
}

/* Bouc-Wen: c0, k0, F_y, 1/x_y, shape, exponent; then a half to the exponent. The state is z. */

#define bouc_wen_PARAMETERS 6
#define bouc_wen_SMOOTH 0
static inline void bouc_wen_prepare(const double *from, Row *p, int i, double dt)
{
    for (int k = 0; k < 6; k++)
        p[k][i] = from[k];
    p[3][i] = 1.0 / from[3];
    p[6][i] = pow(0.5, from[5]);
}

static inline double power(double size, double exponent)
{
    return exp(exponent * log(size > 1e-30 ? size : 1e-30));
}

static inline double bouc_wen_force(LAW_ARGUMENTS) { return p[0][i] * v + p[1][i] * x + p[2][i] * s; }
static inline double bouc_wen_rate(LAW_ARGUMENTS, double *memory)
{
    double size = fabs(s), flat = power(size, p[5][i] - 1.0), u = v * p[3][i], shape = p[4][i];
    return u * (1.0 - (1.0 - shape) * size * flat) - shape * fabs(u) * s * flat;
}

/* (1 - w^n) / (1 - w^2), and its series next to w = 1. */
static inline double loading_factor(double w, double to_the_n, double n)
{
    double left = 1.0 - w;
    double series = 0.5 * n * (1.0 - (n - 2.0) * left * (0.5 - (2.0 * n - 5.0) / 12.0 * left));
    return left < 1.220703125e-4 ? series : (1.0 - to_the_n) / (left * (1.0 + w));
}

/* One step along the net travel u: unloading by the midpoint rule, loading by w <- (w + t)/(1 + w t), which cannot pass
   one, with t = tanh(r u), to midway something like it. The power of the old state serves either way, and that of half
   of it, where all of it unloads. */
static inline double bouc_wen_advance(LAW_ARGUMENTS, double v0, double dt, double *memory)
{
    double travel = 0.5 * dt * (v0 + v) * p[3][i], n = p[5][i], beyond = 2.0 * p[4][i] - 1.0;
    double way = travel >= 0.0 ? 1.0 : -1.0, u = way * travel, w = way * s;
    double begin = power(fabs(s), n), held = w < 0.0 ? -w : 0.0, loaded = w > 0.0 ? w : 0.0;
    double unloading = held - 0.5 * u * (1.0 + beyond * begin);
    int stays = unloading > 0.5 * held;
    double steep = 1.0 + beyond * (w < 0.0 ? begin * p[6][i] : 0.0);
    double left = fmax(u - held / steep, 0.0);
    double half = 0.5 * left * loading_factor(loaded, w > 0.0 ? begin : 0.0, n), t = half / sqrt(1.0 + half * half);
    double loading = (loaded + t) / (1.0 + loaded * t);
    double midway = power(stays ? unloading : loading, n);
    steep = stays ? 1.0 + beyond * midway : steep;
    left = fmax(u - held / steep, 0.0);
    double stretch = left * (stays ? 1.0 : loading_factor(loading, midway, n));
    double e = exp(fmin(2.0 * stretch, 600.0)), up = e + 1.0, down = e - 1.0;
    return way * ((loaded * up + down) / (up + loaded * down) - fmax(held - u * steep, 0.0));
}

/* Heun's step, kept between -1 and 1, half as dear. */
static inline double bouc_wen_moved(const Row *p, int i, double travel, double z)
{
    double to_the_n = power(fabs(z), p[5][i]);
    return travel * (travel * z > 0.0 ? 1.0 - to_the_n : 1.0 + (2.0 * p[4][i] - 1.0) * to_the_n);
}

static inline double within_one(double z)
{
    return fmin(fmax(z, -1.0), 1.0);
}

static inline double bouc_wen_predict(LAW_ARGUMENTS, double v0, double dt, double *memory)
{
    double travel = 0.5 * dt * (v0 + v) * p[3][i];
    double first = bouc_wen_moved(p, i, travel, s);
    double second = bouc_wen_moved(p, i, travel, within_one(s + first));
    return within_one(s + 0.5 * (first + second));
}

#endif
