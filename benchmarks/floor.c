/* The paper's flight, sampled with jitter, written by hand for nothing else: law, rigid body, wind and one loop.

   How fast such flights can be, as a measure for the engines (floor.py). Lanes are the compiler's vectors; functions are
   those of the FMUs. One lane is one flight; lanes of a hold that have ended wait with steps of length 0. With ORDER, steps are
   Taylor series (taylor.py). */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "mathematics.h"

enum { LANES = QUADCOSIM_LANES };
typedef q_real R;
typedef struct {
    R x, y, z;
} V3;
typedef struct {
    V3 p, v, q, w; /* position, velocity, quaternion and angular velocity */
    R q0;
} State;
typedef struct {
    R thrust;
    V3 torque;
} Command;

static const double G = 9.81, K_T = 2.0 + 0.99, K_S = 5.0, BETA_T = 0.99, EPSILON = 1e-3, K = 15.0, KAPPA = 1.0;

#define CROSS(a, b) \
    ((V3){(a).y * (b).z - (a).z * (b).y, (a).z * (b).x - (a).x * (b).z, (a).x * (b).y - (a).y * (b).x})
#define DOT(a, b) ((a).x * (b).x + (a).y * (b).y + (a).z * (b).z)

static inline V3 add(V3 a, V3 b) { return (V3){a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline V3 sub(V3 a, V3 b) { return (V3){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline V3 scaled(R s, V3 a) { return (V3){s * a.x, s * a.y, s * a.z}; }
static inline V3 times(V3 a, V3 b) { return (V3){a.x * b.x, a.y * b.y, a.z * b.z}; }

/* (q0² - q·q) v + 2 q (q·v) ∓ 2 q0 (q × v): to the body, and with `back` to the inertial frame. */
static inline V3 turned(V3 q, R q0, V3 v, double back) {
    V3 across = CROSS(q, v);
    R along = 2.0 * DOT(q, v), own = q0 * q0 - DOT(q, q), side = -2.0 * back * q0;
    return (V3){own * v.x + along * q.x + side * across.x, own * v.y + along * q.y + side * across.y,
                own * v.z + along * q.z + side * across.z};
}

/* The rate of a quaternion under an angular velocity. */
static inline V3 rate_of(V3 q, R q0, V3 w, R *rate0) {
    V3 across = CROSS(q, w);
    *rate0 = -0.5 * DOT(q, w);
    return (V3){0.5 * (q0 * w.x + across.x), 0.5 * (q0 * w.y + across.y), 0.5 * (q0 * w.z + across.z)};
}

static inline void surface(R e, R *slope, R *slope2, R *gamma) {
    R size = q_fabs(e), inside, sign;
    q_mask in = q_lt(size, q_all(EPSILON));
    size = q_select(in, q_all(EPSILON), size);
    inside = K_S * q_pow(size, q_all(BETA_T - 1.0));
    sign = q_select(q_lt(e, q_all(0.0)), q_all(-1.0), q_all(1.0));
    *gamma = q_select(in, q_all(K_S), inside);
    *slope = q_select(in, q_all(K_S), BETA_T * inside);
    *slope2 = q_select(in, q_all(0.0), (BETA_T - 1.0) * BETA_T * inside / size * sign);
}

/* Φ(F) v α1² α2, and the same of its rate. */
static inline V3 phi(V3 F, R a1, R a2, V3 v) {
    R a = a1 * a2;
    return (V3){-F.x * F.y * v.x + (a - F.y * F.y) * v.y + F.y * a2 * v.z,
                (F.x * F.x - a) * v.x + F.x * F.y * v.y - F.x * a2 * v.z, a1 * (F.y * v.x - F.x * v.y)};
}
static inline V3 phi_rate(V3 F, V3 dF, R a1, R a2, R da1, R da2, V3 v) {
    R da = da1 * a2 + a1 * da2, across = dF.x * F.y + F.x * dF.y;
    return (V3){-across * v.x + (da - 2.0 * F.y * dF.y) * v.y + (dF.y * a2 + F.y * da2) * v.z,
                (2.0 * F.x * dF.x - da) * v.x + across * v.y - (dF.x * a2 + F.x * da2) * v.z,
                (dF.y * a1 + F.y * da1) * v.x - (dF.x * a1 + F.x * da1) * v.y};
}

/* The law, for m = 1 kg and J = I. */
static Command law(R t, const State *x) {
    const double w = 0.15;
    q_sines once = q_sin_cos(w * t), twice = q_sin_cos(2.0 * w * t);
    R zero = q_all(0.0), a = q_all(2.0), b = q_all(4.0);
    R w2 = q_all(2.0 * w), w1 = q_all(w);
    V3 p = {a * twice.sin, b * once.sin, 2.0 + 0.1 * t};
    V3 v = {a * w2 * twice.cos, b * w1 * once.cos, q_all(0.1)};
    V3 A = {-a * w2 * w2 * twice.sin, -b * w1 * w1 * once.sin, zero};
    V3 jerk = {-a * w2 * w2 * w2 * twice.cos, -b * w1 * w1 * w1 * once.cos, zero};
    V3 snap = {a * w2 * w2 * w2 * w2 * twice.sin, b * w1 * w1 * w1 * w1 * once.sin, zero};
    V3 e = sub(x->p, p), ev = sub(x->v, v), gamma, slope, slope2;
    surface(e.x, &slope.x, &slope2.x, &gamma.x);
    surface(e.y, &slope.y, &slope2.y, &gamma.y);
    surface(e.z, &slope.z, &slope2.z, &gamma.z);
    V3 s = add(times(gamma, e), ev);
    V3 T = {q_tanh(s.x), q_tanh(s.y), q_tanh(s.z)};
    V3 F = sub(A, scaled(q_all(K_T), T)), u = {-F.x, -F.y, G - F.z};
    R n = q_sqrt(DOT(u, u)), d0 = q_sqrt((G - F.z) / (2.0 * n) + 0.5), part = 0.5 / (n * d0);
    V3 d = {F.y * part, -F.x * part, zero}, across = CROSS(d, x->q); /* of Q_d, without yaw */
    V3 q = sub(sub(scaled(d0, x->q), scaled(x->q0, d)), across);
    R q0 = d0 * x->q0 + DOT(d, x->q);
    V3 bar = {q.y, -q.x, -q0}, tilt = CROSS(bar, q), tilt_inertial = turned(x->q, x->q0, tilt, -1.0);
    V3 ea = sub(add(scaled(-2.0 * n, tilt_inertial), F), A), ds = add(times(slope, ev), ea);
    V3 D = {1.0 - T.x * T.x, 1.0 - T.y * T.y, 1.0 - T.z * T.z}, kD = scaled(q_all(K_T), D);
    V3 dF = sub(jerk, times(kD, ds));
    R dn = -DOT(u, dF) / n, a2 = n + G - F.z, da2 = dn - dF.z, scale = 1.0 / (n * n * a2);
    V3 flat = phi(F, n, a2, dF), wd = scaled(scale, flat), wd_body = turned(q, q0, wd, 1.0);
    V3 we = sub(x->w, wd_body);
    R dq0;
    V3 dq = rate_of(q, q0, we, &dq0), dbar = {dq.y, -dq.x, -dq0};
    V3 dtilt = add(add(CROSS(x->w, tilt), CROSS(dbar, q)), CROSS(bar, dq));
    V3 ej = sub(sub(sub(dF, jerk), scaled(2.0 * dn, tilt_inertial)),
                scaled(2.0 * n, turned(x->q, x->q0, dtilt, -1.0)));
    V3 dds = add(add(times(slope2, times(ev, ev)), times(slope, ea)), ej);
    V3 dD = scaled(q_all(-2.0), times(T, times(D, ds)));
    V3 ddF = sub(sub(snap, scaled(q_all(K_T), times(dD, ds))), times(kD, dds));
    R relative = 2.0 * dn / n + da2 / a2;
    V3 dwd = scaled(scale, sub(add(phi(F, n, a2, ddF), phi_rate(F, dF, n, a2, dn, da2, dF)), scaled(relative, flat)));
    R coupling = q_all(2.0 * KAPPA / K);
    V3 body = turned(x->q, x->q0, s, 1.0), side = CROSS(bar, body);
    V3 psi = sub(scaled(q_all(-K), q), scaled(coupling * n, side));
    V3 dbody = sub(turned(x->q, x->q0, ds, 1.0), CROSS(x->w, body));
    V3 dside = add(CROSS(dbar, body), CROSS(bar, dbody));
    V3 dpsi = sub(scaled(q_all(-K), dq), scaled(coupling, add(scaled(dn, side), scaled(n, dside))));
    V3 forward = add(sub(turned(q, q0, dwd, 1.0), CROSS(we, wd_body)), dpsi);
    return (Command){n, sub(sub(forward, scaled(q_all(K), sub(we, psi))), scaled(q_all(K), q))};
}

static inline State rate(const State *x, const Command *c, R wind) {
    V3 q = x->q;
    State d;
    d.p = x->v;
    d.v = (V3){-c->thrust * (2.0 * (q.x * q.z + x->q0 * q.y)) + wind, -c->thrust * (2.0 * (q.y * q.z - x->q0 * q.x)) + wind,
               -c->thrust * (x->q0 * x->q0 - q.x * q.x - q.y * q.y + q.z * q.z) + wind + G};
    d.q = rate_of(q, x->q0, x->w, &d.q0);
    d.w = c->torque;
    return d;
}

static inline State moved(const State *x, R h, const State *d) {
    return (State){add(x->p, scaled(h, d->p)), add(x->v, scaled(h, d->v)), add(x->q, scaled(h, d->q)),
                   add(x->w, scaled(h, d->w)), x->q0 + h * d->q0};
}

static inline V3 unit(V3 q, R *q0) {
    R size = 1.0 / q_sqrt(DOT(q, q) + *q0 * *q0);
    *q0 = size * *q0;
    return scaled(size, q);
}

#ifdef ORDER

/* One step by the Taylor series of this order, each lane from its own time over its own length. */
static void step(State *x, const Command *c, R t, R h) {
    V3 p[ORDER + 1] = {x->p}, v[ORDER + 1] = {x->v}, q[ORDER + 1] = {x->q};
    R q0[ORDER + 1] = {x->q0};
    q_sines wind = q_sin_cos(0.1 * t);
    R even = 0.01 * wind.cos, odd = -0.001 * wind.sin; /* coefficients of the wind */
#pragma GCC unroll 16
    for (int k = 0; k < ORDER; k++) {
        const double next = 1.0 / (k + 1);
        R zx = q_all(0.0), zy = zx, zz = zx, rate0, more0;
        for (int i = 0; i <= k; i++) {
            V3 a = q[i], b = q[k - i];
            zx = zx + (a.x * b.z + q0[i] * b.y), zy = zy + (a.y * b.z - q0[i] * b.x);
            zz = zz + (q0[i] * q0[k - i] - a.x * b.x - a.y * b.y + a.z * b.z);
        }
        const R push = k % 2 ? odd : even;
        V3 force = {push - 2.0 * c->thrust * zx, push - 2.0 * c->thrust * zy, push - c->thrust * zz};
        if (!k) force.z = force.z + G;
        V3 rate = rate_of(q[k], q0[k], x->w, &rate0);
        if (k) rate = add(rate, rate_of(q[k - 1], q0[k - 1], c->torque, &more0)), rate0 = rate0 + more0;
        p[k + 1] = scaled(q_all(next), v[k]), v[k + 1] = scaled(q_all(next), force);
        q[k + 1] = scaled(q_all(next), rate), q0[k + 1] = next * rate0;
        if (k % 2) odd = odd * (-0.01 / ((k + 1.0) * (k + 2.0)));
        else even = even * (-0.01 / ((k + 1.0) * (k + 2.0)));
    }
    *x = (State){p[ORDER], v[ORDER], q[ORDER], add(x->w, scaled(h, c->torque)), q0[ORDER]};
#pragma GCC unroll 16
    for (int k = ORDER - 1; k >= 0; k--) {
        x->p = add(p[k], scaled(h, x->p)), x->v = add(v[k], scaled(h, x->v));
        x->q = add(q[k], scaled(h, x->q)), x->q0 = q0[k] + h * x->q0;
    }
    x->q = unit(x->q, &x->q0);
}

#else

/* One step of Runge-Kutta 4, each lane from its own time over its own length. */
static void step(State *x, const Command *c, R t, R h) {
    R half = 0.5 * h, w0 = 0.01 * q_cos(0.1 * t), w1 = 0.01 * q_cos(0.1 * (t + half)), w2 = 0.01 * q_cos(0.1 * (t + h));
    State k1 = rate(x, c, w0), y = moved(x, half, &k1), k2 = rate(&y, c, w1);
    y = moved(x, half, &k2);
    State k3 = rate(&y, c, w1);
    y = moved(x, h, &k3);
    State k4 = rate(&y, c, w2), sum = moved(&k1, q_all(2.0), &k2);
    sum = moved(&sum, q_all(2.0), &k3);
    sum = moved(&sum, q_all(1.0), &k4);
    *x = moved(x, h / 6.0, &sum);
    x->q = unit(x->q, &x->q0);
}

#endif

/* Fly LANES flights from x = `starts`, each sampled at its `count` own `samples` [ns], in steps of `grid` [ns] to `end`;
   `ends` gets the last position and velocity, lane by lane, six arrays of LANES. */
__attribute__((visibility("default"))) void fly(const double *starts, const int64_t *samples, int64_t count, int64_t grid, int64_t end, double *ends) {
    R zero = q_all(0.0), size = q_all(sqrt(0.1699 * 0.1699 + 0.3058 * 0.3058 + 0.1699 * 0.1699 + 0.9212 * 0.9212));
    State x = {{zero, zero, zero}, {zero, zero, zero}, {0.1699 / size, 0.3058 / size, 0.1699 / size},
               {zero, zero, zero}, 0.9212 / size};
    int64_t now[LANES] = {0};
    for (int lane = 0; lane < LANES; lane++) x.p.x = q_with_lane(x.p.x, lane, starts[lane]);
    Command command = law(zero, &x);
    for (int64_t k = 0; k <= count; k++) {
        for (bool all = false; !all;) {
            R t = zero, h = zero;
            all = true;
            for (int lane = 0; lane < LANES; lane++) {
                int64_t until = k < count && samples[lane * count + k] < end ? samples[lane * count + k] : end;
                int64_t next = (now[lane] / grid + 1) * grid;
                next = next < until ? next : until;
                t = q_with_lane(t, lane, (double)now[lane] / 1e9);
                h = q_with_lane(h, lane, (double)(next - now[lane]) / 1e9);
                now[lane] = next, all = all && next == until;
            }
            step(&x, &command, t, h);
        }
        if (k == count) break;
        R t = zero;
        for (int lane = 0; lane < LANES; lane++) t = q_with_lane(t, lane, (double)now[lane] / 1e9);
        command = law(t, &x);
    }
    const R last[6] = {x.p.x, x.p.y, x.p.z, x.v.x, x.v.y, x.v.z};
    for (int i = 0; i < 6; i++)
        for (int lane = 0; lane < LANES; lane++) ends[i * LANES + lane] = q_lane(last[i], lane);
}
