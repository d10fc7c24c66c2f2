/* A quarter car under linear skyhook: a damper with a soft and a hard rate, its command sampled every `every` steps,
   rounded at its limits and at low velocity as `jaxdamp.control.Controlled` says, and followed with a lag. The step is
   the exponential one of `quarter_car.h`; where a command is applied, the force a step before is that which the new
   target would have had. Parameters: soft and hard rate [N s/m], gain of skyhook [N s/m]. */

typedef struct {
    Row zs, zu, vs, vu, sum, force, before, rate, target, soft, range, gain;
} Skyhook;

/* A sample: the rate nearest to the demanded force becomes the target; then the force a step of dt before. */
static inline void skyhook_sample(Skyhook *restrict b, const Car *car, double dt, double height, double still,
                                  double rise)
{
    const double ks = car->spring_rate, kt = car->tyre_stiffness;
    const double per_ms = 1.0 / car->sprung_mass, per_mu = 1.0 / car->unsprung_mass;
    FOR_LANES
    {
        double v = b->vs[i] - b->vu[i], range = b->range[i], more = range * v, least = range * still;
        double share = (b->gain[i] * b->vs[i] - b->soft[i] * v) * more / (more * more + least * least + 1e-12);
        double above = share - 1.0;
        share = 0.5 * (1.0 + sqrt(share * share + 0.01) - sqrt(above * above + 0.01));
        double target = b->soft[i] + range * share, f = b->rate[i] * v;
        double pull = ks * (b->zs[i] - b->zu[i]) + f;
        double a = -pull * per_ms - (pull - kt * (b->zu[i] - height)) * per_mu;
        b->target[i] = target;
        b->force[i] = f;
        b->before[i] = (b->rate[i] + rise * (b->rate[i] - target)) * (v - dt * a);
    }
}

static inline void skyhook_step(Skyhook *restrict b, const Car *car, const double *restrict m,
                                const double *restrict driven, double decay)
{
    const double ks = car->spring_rate, per_ms = 1.0 / car->sprung_mass;
    const double d0 = driven[0], d1 = driven[1], d2 = driven[2], d3 = driven[3];
    FOR_LANES
    {
        double zs = b->zs[i], zu = b->zu[i], vs = b->vs[i], vu = b->vu[i], f = b->force[i], g = b->before[i];
        double rate = b->target[i] + decay * (b->rate[i] - b->target[i]), a = (ks * (zs - zu) + f) * per_ms;
        b->sum[i] += a * a;
        double h0 = d0 + m[0] * zs + m[1] * zu + m[2] * vs + m[3] * vu + m[20] * g + m[16] * f;
        double h1 = d1 + m[4] * zs + m[5] * zu + m[6] * vs + m[7] * vu + m[21] * g + m[17] * f;
        double h2 = d2 + m[8] * zs + m[9] * zu + m[10] * vs + m[11] * vu + m[22] * g + m[18] * f;
        double h3 = d3 + m[12] * zs + m[13] * zu + m[14] * vs + m[15] * vu + m[23] * g + m[19] * f;
        double bend = rate * (h2 - h3) - 2.0 * f + g;
        b->zs[i] = h0 + m[24] * bend;
        b->zu[i] = h1 + m[25] * bend;
        b->vs[i] = h2 += m[26] * bend;
        b->vu[i] = h3 += m[27] * bend;
        b->rate[i] = rate;
        b->before[i] = f;
        b->force[i] = rate * (h2 - h3);
    }
}

/* `matrices` as in `quarter_car.h`; then the steps of a period, the lag [s] and the velocity that counts as still. */
void skyhook_exponential(const Car *car, const double *table, long cars, const double *road, long steps, double dt,
                         const double *matrices, int threads, double *rms)
{
    const long every = (long)matrices[36];
    const double lag = matrices[37], still = matrices[38], decay = exp(-dt / lag), rise = exp(dt / lag) - 1.0;
#pragma omp parallel for schedule(static) num_threads(threads)
    for (long first = 0; first < cars; first += LANES) {
        Skyhook b ALIGNED;
        for (int i = 0; i < LANES; i++) {
            const double *own = table + 3 * (first + i < cars ? first + i : cars - 1);
            b.zs[i] = b.zu[i] = road[0];
            b.vs[i] = b.vu[i] = b.sum[i] = b.force[i] = b.before[i] = 0.0;
            b.soft[i] = b.rate[i] = b.target[i] = own[0];
            b.range[i] = own[1] - own[0];
            b.gain[i] = own[2];
        }
        for (long k = 0; k < steps; k++) {
            double driven[4];
            for (int r = 0; r < 4; r++)
                driven[r] = matrices[28 + r] * road[k] + matrices[32 + r] * road[k + 1];
            if (k % every == 0)
                skyhook_sample(&b, car, dt, road[k], still, rise);
            skyhook_step(&b, car, matrices, driven, decay);
        }
        for (int i = 0; i < LANES && first + i < cars; i++) {
            double a = (car->spring_rate * (b.zs[i] - b.zu[i]) + b.force[i]) / car->sprung_mass;
            rms[first + i] = sqrt((b.sum[i] + a * a) / (steps + 1));
        }
    }
}
