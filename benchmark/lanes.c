// Copyright 2026 The gear_rattle_ros authors
//
// Licensed under the Apache License, Version 2.0 (the "License");
// you may not use this file except in compliance with the License.
// You may obtain a copy of the License at
//
//     http://www.apache.org/licenses/LICENSE-2.0
//
// Unless required by applicable law or agreed to in writing, software
// distributed under the License is distributed on an "AS IS" BASIS,
// WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
// See the License for the specific language governing permissions and
// limitations under the License.


/*
 * `stride` of core/flight/lanes_step.py by hand in C, as a yardstick for benchmark/lanes.py.
 *
 * Formulas are those of the Python files, in the same order; compiled without contraction both
 * give the same bits. benchmark/lanes.py writes a header with the type `tile` and the constants
 * in capitals.
 */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#define ALWAYS static inline __attribute__((always_inline))
#define EACH for (int i = 0; i < LANES; i++)
#define COPY(to, from, name) t->name[to] = t->name[from]
#define KEEP(name, value) do { \
        double old = t->name[i], new = (value); \
        t->name[i] = known ? old : new; \
    } while (0)

typedef struct { double sine, cosine; } circular;
typedef struct { double decay, integral, second; } relaxed;
typedef struct { double verdict, wall; } view;
typedef struct { double verdict, wall, s, v; } seen;
typedef struct { double c_1, c_2, c_3, c_4, c_5, c_6, c_7, last; } polynomial;
typedef struct { double moved, velocity, sine, cosine; } motion;

static const double two_pi = 6.283185307179586, two_pi_tail = 2.4492935982947064e-16;
static const double whole_bits = 0x1.8p+52;

ALWAYS int64_t bits(double x) { int64_t k; memcpy(&k, &x, sizeof k); return k; }

ALWAYS double from_bits(int64_t k) { double x; memcpy(&x, &k, sizeof x); return x; }

ALWAYS double ratio(double x, double y) { return (double)((float)x / (float)y); }

ALWAYS double sine_series(double y)
{
    double z = y * y;
    return y * (1.0 / 120 + z * (1.0 / 362880 + z * (1.0 / 6227020800
                + z * (1.0 / 355687428096000))))
        - (1.0 / 6 + z * (1.0 / 5040 + z * (1.0 / 39916800 + z * (1.0 / 1307674368000))));
}

ALWAYS double with_sign(double x, int64_t quadrant)
{
    return from_bits(bits(x) ^ (int64_t)((uint64_t)(quadrant & 2) << 62));
}

ALWAYS circular sine_cosine(double x)
{
    double nearest = x * (2.0 / M_PI) + whole_bits, k = nearest - whole_bits;
    double r = ((x - k * 0x1.921fb544p+0) - k * 0x1.0b4611a6p-34) - k * 0x1.3198a2e037073p-69;
    double y = r * r, z = y * y, sine = r + r * (y * sine_series(y));
    double half = 0.5 * y, w = 1.0 - half;
    double cosine = w + (((1.0 - w) - half) + z * (
        (1.0 / 24 + z * (1.0 / 40320 + z * (1.0 / 479001600 + z * (1.0 / 20922789888000))))
        - y * (1.0 / 720 + z * (1.0 / 3628800 + z * (
            1.0 / 87178291200 + z * (1.0 / 6402373705728000))))));
    int64_t quadrant = bits(nearest);
    bool odd = (quadrant & 1) != 0;
    circular there = {with_sign(odd ? cosine : sine, quadrant),
                      with_sign(odd ? sine : cosine, quadrant + 1)};
    return there;
}

ALWAYS relaxed relax(double d, double beta)
{
    double x = beta * d, y = x * x;
    double second = (1.0 / 2 + y * (1.0 / 24 + y * (1.0 / 720 + y * (1.0 / 40320 + y * (
        1.0 / 3628800 + y * (1.0 / 479001600 + y * (1.0 / 87178291200 + y * (
            1.0 / 20922789888000)))))))
        - x * (1.0 / 6 + y * (1.0 / 120 + y * (1.0 / 5040 + y * (1.0 / 362880 + y * (
            1.0 / 39916800 + y * (1.0 / 6227020800 + y * (1.0 / 1307674368000 + y * (
                1.0 / 355687428096000)))))))));
    double first = 1.0 - x * second;
    relaxed there = {1.0 - x * first, d * first, d * d * second};
    return there;
}

ALWAYS relaxed relax_twice(double d, double beta)
{
    relaxed half = relax(0.5 * d, beta);
    relaxed there = {half.decay * half.decay, half.integral + half.decay * half.integral,
                     2.0 * half.second + half.integral * half.integral};
    return there;
}

ALWAYS relaxed relax_short(double d, double beta)
{
    double half = 0.5 * d, x = beta * half, y = x * x;
    double second = 0.4999999912630972 + y * (0.04165925535933733 + y * 0.0013248179642864888)
        + x * (-0.16666603660680485 + y * (-0.00830117044582246 + y * -0.00013742419086074865));
    double first = 1.0 - x * second, decay = 1.0 - x * first, integral = half * first;
    relaxed there = {decay * decay, integral + integral * decay,
                     2.0 * (half * half * second) + integral * integral};
    return there;
}

ALWAYS view examine(double s_a, double v_a, double s_b, double v_b, double h, double decay,
                    double force, double beta, double blur, double growth, bool from_zero)
{
    bool rising = v_a > 0.0;
    double speed = fabs(v_a), last = fabs(v_b), lower_a = 1.0 + s_a, lower_b = 1.0 + s_b;
    double ahead = rising ? -s_a : lower_a, left = rising ? -s_b : lower_b;
    bool at_upper = -s_b < lower_b;
    double room = at_upper ? -s_b : lower_b;
    double f = 2.0 * (force + beta * speed);
    double most = speed * (f * (last * h + decay * (ahead - left))
                           - last * (speed + decay * last));
    double away = ahead - blur;
    bool good = (v_a * v_b > 0.0) | (most < (f * (speed * decay + last)) * away)
        | (from_zero & (speed * (speed * speed) < ((9.0 / 8.0) * growth) * (away * away))
           & (18.0 * speed < growth * (h * h)) & (away > 0.0));
    bool sharp = last > blur, sure = good & sharp;
    bool meets = (room < -blur) & (sure | (rising == at_upper)), safe = (room > blur) & sure;
    view there = {
        meets ? BRACKETED : safe ? FURTHER : sharp & !good ? TURNS : OPEN,
        meets ? (at_upper ? 1.0 : -1.0) : rising ? 1.0 : -1.0};
    return there;
}

ALWAYS seen look_on(const tile *t, int i, double at_fall, double h, double s_a, double v_a)
{
    bool falls = at_fall > 0.0;
    double free = v_a - (falls ? t->fall_cosine[i] : t->rise_cosine[i]);
    double centre = s_a - (falls ? t->fall_sine[i] : t->rise_sine[i]);
    double decay = falls ? t->low_decay[i] : t->high_decay[i];
    double v_b = (free * decay + (falls ? t->low_gain[i] : t->high_gain[i]))
        + (falls ? t->rise_cosine[i] : t->fall_cosine[i]);
    double s_b = (centre + (free * (falls ? t->low_integral[i] : t->high_integral[i])
                            + (falls ? t->low_drift[i] : t->high_drift[i])))
        + (falls ? t->rise_sine[i] : t->fall_sine[i]);
    view found = examine(s_a, v_a, s_b, v_b, h, decay, falls ? t->low_force[i] : t->high_force[i],
                         t->beta[i], t->blur[i], falls ? t->low_growth[i] : t->high_growth[i],
                         true);
    seen there = {found.verdict, found.wall, s_b, v_b};
    return there;
}

ALWAYS circular zero_of(const tile *t, int i, double at_fall)
{
    circular there = {at_fall > 0.0 ? t->fall_sine[i] : t->rise_sine[i],
                      at_fall > 0.0 ? t->fall_cosine[i] : t->rise_cosine[i]};
    return there;
}

ALWAYS bool is_strike(double s_a, double v_a, double c_1, double c_3)
{
    double ahead = v_a > 0.0 ? -s_a : 1.0 + s_a;
    return (27.0 * fabs(c_3)) * (ahead * ahead)
        < (4.0 * STRIKES * STRIKES) * (fabs(c_1) * (c_1 * c_1));
}

ALWAYS polynomial interpolate(double h, double s_a, double v_a, double sine_a, double cosine_a,
                              double s_b, double v_b, circular b, double beta, double gamma)
{
    double a_a = (gamma - sine_a) + beta * (cosine_a - v_a);
    double a_b = (gamma - b.sine) + beta * (b.cosine - v_b);
    double half = (0.5 * h) * h, third = ((1.0 / 3.0) * h) * half;
    double c_1 = h * v_a, c_2 = half * a_a, c_3 = -third * (cosine_a + beta * (sine_a + a_a));
    double last = half * a_b, c_23 = c_2 + c_3, c_33 = c_23 + 2.0 * c_3;
    double r_0 = (s_b - s_a) - (c_1 + c_23), r_1 = (h * v_b - c_1) - (c_2 + c_33);
    double r_2 = last - c_33, r_3 = -third * (b.cosine + beta * (b.sine + a_b)) - c_3;
    double q_1 = r_1 - 4.0 * r_0, q_2 = r_2 - 4.0 * q_1 - 6.0 * r_0;
    double q_3 = r_3 - 4.0 * q_2 - 6.0 * q_1 - 4.0 * r_0, rest = q_2 - 3.0 * q_3;
    polynomial p = {c_1, c_2, c_3, r_0 - q_1 + (q_2 - q_3), q_1 - q_2 - rest, rest, q_3, last};
    return p;
}

ALWAYS double slope_at(double x, polynomial p)
{
    return p.c_1 + x * (2.0 * p.c_2 + x * (3.0 * p.c_3 + x * (4.0 * p.c_4 + x * (
        5.0 * p.c_5 + x * (6.0 * p.c_6 + x * (7.0 * p.c_7))))));
}

static void see_first(tile *restrict t)
{
    EACH {
        double phase = t->phase[i], alpha = t->alpha[i], beta = t->beta[i], gamma = t->gamma[i];
        double displacement = t->displacement[i], velocity = t->velocity[i];
        double free = velocity - alpha * t->cosine[i], relax = fabs(gamma - beta * free);
        double blur = BLUR * (fabs(free) + (alpha + (3.0 * two_pi) * fabs(gamma)));
        double to_fall = t->fall[i] - phase, to_rise = t->rise[i] - phase;
        to_fall = to_fall < 0.0 ? to_fall + two_pi : to_fall;
        to_rise = to_rise < 0.0 ? to_rise + two_pi : to_rise;
        bool falls = to_fall < to_rise;
        double d = falls ? to_fall : to_rise;
        relaxed z = relax_short(d, beta);
        double v_b = (free * z.decay + gamma * z.integral)
            + (falls ? t->fall_cosine[i] : t->rise_cosine[i]);
        double s_b = ((displacement - alpha * t->sine[i])
                      + (free * z.integral + gamma * z.second))
            + (falls ? t->fall_sine[i] : t->rise_sine[i]);
        view found = examine(displacement, velocity, s_b, v_b, d, z.decay,
                             falls ? t->high_force[i] : t->low_force[i], beta, blur, 0.0, false);
        t->first_verdict[i] = found.verdict;
        t->first_wall[i] = found.wall;
        t->at_fall[i] = falls ? 1.0 : 0.0;
        t->length[i] = d;
        t->following[i] = fabs(to_fall - to_rise);
        t->first_s[i] = s_b;
        t->first_v[i] = v_b;
        t->bend[i] = alpha + relax;
        t->snap[i] = alpha + 0.07 * relax;
        t->blur[i] = blur;
    }
}

static void see_second(tile *restrict t)
{
    EACH {
        double at_fall = t->at_fall[i], s_1 = t->first_s[i], v_1 = t->first_v[i];
        double d_1 = t->length[i], h_2 = t->following[i], first = t->first_verdict[i];
        seen second = look_on(t, i, at_fall, h_2, s_1, v_1);
        circular zero = zero_of(t, i, at_fall);
        bool further = first == FURTHER, falls = (at_fall > 0.0) != further;
        t->verdict[i] = further ? second.verdict : first;
        t->wall[i] = further ? second.wall : t->first_wall[i];
        t->next_at_fall[i] = falls ? 1.0 : 0.0;
        t->since[i] = further ? d_1 : 0.0;
        t->next_length[i] = further ? h_2 : d_1;
        t->next_following[i] = further ? two_pi - h_2 : h_2;
        t->c_0[i] = further ? s_1 : t->displacement[i];
        t->v_a[i] = further ? v_1 : t->velocity[i];
        t->sine_a[i] = further ? zero.sine : t->alpha[i] * t->sine[i];
        t->cosine_a[i] = further ? zero.cosine : t->alpha[i] * t->cosine[i];
        t->s_b[i] = further ? second.s : s_1;
        t->v_b[i] = further ? second.v : v_1;
    }
}

static int64_t fit(tile *restrict t)
{
    int64_t more = 0;
    EACH {
        double h = t->next_length[i], s_a = t->c_0[i], v_a = t->v_a[i], verdict = t->verdict[i];
        polynomial p = interpolate(
            h, s_a, v_a, t->sine_a[i], t->cosine_a[i], t->s_b[i], t->v_b[i],
            zero_of(t, i, t->next_at_fall[i]), t->beta[i], t->gamma[i]);
        t->c_1[i] = p.c_1;
        t->c_2[i] = p.c_2;
        t->c_3[i] = p.c_3;
        t->c_4[i] = p.c_4;
        t->c_5[i] = p.c_5;
        t->c_6[i] = p.c_6;
        t->c_7[i] = p.c_7;
        t->last[i] = p.last;
        bool strikes = (verdict == TURNS) & (t->since[i] > 0.0)
            & is_strike(s_a, v_a, p.c_1, p.c_3);
        verdict = strikes ? BRACKETED : verdict;
        t->next_verdict[i] = verdict;
        t->low[i] = 0.0;
        t->high[i] = 1.0;
        more += (verdict == TURNS ? 1 : 0) + (verdict == FURTHER ? WAITS : 0);
    }
    return more;
}

static void see_further(tile *restrict t)
{
    EACH {
        bool known = t->next_verdict[i] != FURTHER;
        double at_fall = t->next_at_fall[i], since = t->since[i] + t->next_length[i];
        double h = t->next_following[i], s_a = t->s_b[i], v_a = t->v_b[i];
        circular a = zero_of(t, i, at_fall);
        seen next = look_on(t, i, at_fall, h, s_a, v_a);
        polynomial p = interpolate(h, s_a, v_a, a.sine, a.cosine, next.s, next.v,
                                   zero_of(t, i, 1.0 - at_fall), t->beta[i], t->gamma[i]);
        bool strikes = (next.verdict == TURNS) & is_strike(s_a, v_a, p.c_1, p.c_3);
        double verdict = strikes ? BRACKETED : next.verdict;
        KEEP(next_verdict, verdict); KEEP(wall, next.wall); KEEP(next_at_fall, 1.0 - at_fall);
        KEEP(since, since); KEEP(next_length, h); KEEP(next_following, two_pi - h);
        KEEP(c_0, s_a); KEEP(c_1, p.c_1); KEEP(c_2, p.c_2); KEEP(c_3, p.c_3); KEEP(c_4, p.c_4);
        KEEP(c_5, p.c_5); KEEP(c_6, p.c_6); KEEP(c_7, p.c_7); KEEP(last, p.last);
        KEEP(s_b, next.s); KEEP(v_b, next.v);
    }
}

static void decide(tile *restrict t, int end)
{
    for (int i = LANES; i < end; i++) {
        double wall = t->wall[i], h = t->next_length[i], blur = t->blur[i];
        double s_b = t->s_b[i], c_0 = t->c_0[i], c_1 = t->c_1[i], c_2 = t->c_2[i];
        double c_3 = t->c_3[i], c_4 = t->c_4[i], c_5 = t->c_5[i], c_6 = t->c_6[i];
        double c_7 = t->c_7[i];
        polynomial p = {c_1, c_2, c_3, c_4, c_5, c_6, c_7, 0.0};
        double first = fabs(c_1), x = ratio(first, first + h * fabs(t->v_b[i]));
        for (int k = 0; k < 2; k++) {
            double f_0 = slope_at(x, p);
            double f_1 = 2.0 * c_2 + x * (6.0 * c_3 + x * (12.0 * c_4 + x * (
                20.0 * c_5 + x * (30.0 * c_6 + x * (42.0 * c_7)))));
            double half = 3.0 * c_3 + x * (12.0 * c_4 + x * (30.0 * c_5 + x * (
                60.0 * c_6 + x * (105.0 * c_7))));
            x = x - ratio(f_0 * f_1, f_1 * f_1 - f_0 * half);
        }
        bool within = (x > 0.0) & (x < 1.0);
        x = within ? x : 0.5;
        double way = x * (c_1 + x * (c_2 + x * (c_3 + x * (c_4 + x * (
            c_5 + x * (c_6 + x * c_7))))));
        double speed = slope_at(x, p);
        double early = x > ASIDE ? x - ASIDE : 0.0, late = x < 1.0 - ASIDE ? x + ASIDE : 1.0;
        double before = wall * slope_at(early, p), after = wall * slope_at(late, p);
        double square = h * h;
        square = square * square;
        double snap = t->snap[i] * (square * square);
        double spread = blur * (1.0 + h);
        double unsure = snap * REMAINDER_1 + spread;
        double error = snap * REMAINDER + spread;
        double reached = wall * way;
        double most = reached + error + (2.0 * ASIDE) * (fabs(speed) + unsure);
        bool rising = wall > 0.0;
        double ahead = rising ? -c_0 : 1.0 + c_0, beyond = rising ? -(1.0 + s_b) : s_b;
        bool strikes = within & (reached - error > ahead);
        bool passes = within & (before > unsure) & (after < -unsure) & (most < ahead);
        bool returns = passes & (beyond > spread), clears = passes & (beyond < -spread);
        t->next_verdict[i] = strikes | returns ? BRACKETED : clears ? FURTHER : OPEN;
        t->wall[i] = returns ? -wall : wall;
        t->low[i] = returns ? x : 0.0;
        t->high[i] = strikes ? x : 1.0;
    }
}

static void see_on(tile *restrict t)
{
    for (int round = 0; round < ROUNDS; round++) {
        int k = LANES, further = 0;
        EACH {
            if (t->next_verdict[i] == TURNS) {
                t->lane[k] = i;
                COPY(k, i, wall); COPY(k, i, next_length); COPY(k, i, snap); COPY(k, i, blur);
                COPY(k, i, c_0); COPY(k, i, c_1); COPY(k, i, c_2); COPY(k, i, c_3);
                COPY(k, i, c_4); COPY(k, i, c_5); COPY(k, i, c_6); COPY(k, i, c_7);
                COPY(k, i, s_b); COPY(k, i, v_b);
                k++;
            } else
                further += t->next_verdict[i] == FURTHER;
        }
        if (k > LANES) {
            decide(t, LANES + (k - LANES + VECTOR - 1) / VECTOR * VECTOR);
            for (int i = LANES; i < k; i++) {
                int64_t j = t->lane[i];
                COPY(j, i, next_verdict); COPY(j, i, wall); COPY(j, i, low); COPY(j, i, high);
                further += t->next_verdict[i] == FURTHER;
            }
        }
        if (further == 0)
            return;
        see_further(t);
    }
    EACH t->next_verdict[i] = t->next_verdict[i] == TURNS ? OPEN : t->next_verdict[i];
}

static void estimate(tile *restrict t)
{
    EACH {
        double wall = t->wall[i], low = t->low[i], high = t->high[i], s_b = t->s_b[i];
        double c_0 = t->c_0[i], c_1 = t->c_1[i], c_2 = t->c_2[i], c_3 = t->c_3[i];
        double c_4 = t->c_4[i], c_5 = t->c_5[i], c_6 = t->c_6[i], c_7 = t->c_7[i];
        bool rising = wall > 0.0;
        double z_a = rising ? c_0 : 1.0 + c_0, z_b = rising ? s_b : 1.0 + s_b;
        double slope_b = t->next_length[i] * t->v_b[i];
        bool leaves = z_a == 0.0;
        double a_0 = leaves ? c_1 : z_a, a_1 = leaves ? c_2 : c_1, a_2 = leaves ? c_3 : c_2;
        bool convex = (wall * slope_b > 0.0) & (wall * (z_b - z_a - c_1) > 0.0) & !leaves;
        double f_0 = convex ? z_b : a_0, f_1 = convex ? slope_b : a_1;
        double half = convex ? t->last[i] : a_2;
        double x = (convex ? 1.0 : 0.0) - ratio(f_0 * f_1, f_1 * f_1 - f_0 * half);
        double middle = leaves ? high : 0.5 * (low + high);
        t->x[i] = (x > low) & (x < high) ? x : middle;
        t->a_0[i] = a_0;
        t->a_1[i] = a_1;
        t->a_2[i] = a_2;
        t->a_3[i] = leaves ? c_4 : c_3;
        t->a_4[i] = leaves ? c_5 : c_4;
        t->a_5[i] = leaves ? c_6 : c_5;
        t->a_6[i] = leaves ? c_7 : c_6;
        t->a_7[i] = leaves ? 0.0 : c_7;
    }
}

ALWAYS double improve(const tile *t, int i, double x)
{
    double low = t->low[i], high = t->high[i], a_0 = t->a_0[i], a_1 = t->a_1[i], a_2 = t->a_2[i];
    double a_3 = t->a_3[i], a_4 = t->a_4[i], a_5 = t->a_5[i], a_6 = t->a_6[i], a_7 = t->a_7[i];
    double y = x * x, z = y * y;
    double f_0 = ((a_0 + x * a_1) + y * (a_2 + x * a_3))
        + z * ((a_4 + x * a_5) + y * (a_6 + x * a_7));
    double f_1 = ((a_1 + x * (2.0 * a_2)) + y * (3.0 * a_3 + x * (4.0 * a_4)))
        + z * ((5.0 * a_5 + x * (6.0 * a_6)) + y * (7.0 * a_7));
    double half = ((a_2 + x * (3.0 * a_3)) + y * (6.0 * a_4 + x * (10.0 * a_5)))
        + z * (15.0 * a_6 + x * (21.0 * a_7));
    x = x - ratio(f_0 * f_1, f_1 * f_1 - f_0 * half);
    x = x > low ? x : low;
    return x < high ? x : high;
}

static void approach(tile *restrict t) { EACH t->next_x[i] = improve(t, i, t->x[i]); }

static int64_t approach_again(tile *restrict t)
{
    int64_t late = 0;
    EACH {
        double x = improve(t, i, t->next_x[i]), again = t->again[i];
        double d = t->since[i] + t->next_length[i] * x;
        d = again > 0.0 ? again : d;
        t->next_step[i] = d;
        late += t->beta[i] * d >= 1.0 ? 1 : 0;
    }
    return late;
}

static void halve(tile *restrict t)
{
    EACH {
        circular half = sine_cosine(0.5 * t->next_step[i]);
        t->sine_half[i] = half.sine;
        t->cosine_half[i] = half.cosine;
    }
}

ALWAYS motion flown(const tile *t, int i, double d, relaxed z)
{
    double v0 = t->velocity[i], sin_p = t->sine[i], cos_p = t->cosine[i];
    double alpha = t->alpha[i], beta = t->beta[i], gamma = t->gamma[i];
    double sin_half = t->sine_half[i], versine = 2.0 * sin_half * sin_half;
    double sine = 2.0 * sin_half * t->cosine_half[i], square = d * d;
    double series = d * (square * sine_series(square));
    double defect = d > 1.0 ? sine - d : series;
    motion there = {
        v0 * z.integral + gamma * z.second
            + alpha * (cos_p * (defect + beta * z.second) - sin_p * versine),
        v0 * z.decay + gamma * z.integral
            + alpha * (cos_p * (beta * z.integral - versine) - sin_p * sine),
        sin_p + (cos_p * sine - sin_p * versine), cos_p - (cos_p * versine + sin_p * sine)};
    return there;
}

static void arrive(tile *restrict t)
{
    EACH {
        double d = t->next_step[i];
        motion there = flown(t, i, d, relax(d, t->beta[i]));
        t->there[i] = there.moved;
        t->there_velocity[i] = there.velocity;
        t->there_sine[i] = there.sine;
        t->there_cosine[i] = there.cosine;
    }
}

static void arrive_late(tile *restrict t)
{
    EACH {
        double d = t->next_step[i];
        motion there = flown(t, i, d, relax_twice(d, t->beta[i]));
        bool late = t->beta[i] * d >= 1.0;
        t->there[i] = late ? there.moved : t->there[i];
        t->there_velocity[i] = late ? there.velocity : t->there_velocity[i];
    }
}

static void come_near(tile *restrict t)
{
    EACH {
        double wall = t->wall[i], drive = wall * t->alpha[i];
        double drive_cosine = drive * t->there_cosine[i];
        double beta = t->beta[i], speed = wall * t->there_velocity[i];
        double s = t->displacement[i], moved = t->there[i];
        double ahead = wall > 0.0 ? -s - moved : 1.0 + s + moved;
        double relax = wall * t->gamma[i] - beta * (speed - drive_cosine);
        double pull = relax - drive * t->there_sine[i], jerk = -drive_cosine - beta * relax;
        double inverse = ratio(1.0, speed), y = ahead * inverse, q = pull * inverse;
        t->x[i] = y - (0.5 * (y * y)) * (q - y * (q * q - (1.0 / 3.0) * (jerk * inverse)));
        t->slowness[i] = inverse;
        t->ahead[i] = ahead;
        t->speed[i] = speed;
        t->pull[i] = pull;
        t->jerk[i] = jerk;
    }
}

static void conclude(tile *restrict t)
{
    EACH {
        double d = t->next_step[i], since = t->since[i], length = t->next_length[i];
        double until = since + length, verdict = t->next_verdict[i], wall = t->wall[i];
        double x = t->x[i], inverse = t->slowness[i], ahead = t->ahead[i], speed = t->speed[i];
        double pull = t->pull[i], jerk = t->jerk[i], beta = t->beta[i], bend = t->bend[i];
        double drive = wall * t->alpha[i], drive_sine = drive * t->there_sine[i];
        double relax = (beta * beta) * (pull + drive_sine), s4 = drive_sine + relax;
        relax = beta * relax;
        double s5 = drive * t->there_cosine[i] - relax, s6 = beta * relax - drive_sine;
        double x2 = 0.5 * x, x3 = (1.0 / 3.0) * x, x4 = 0.25 * x, x5 = 0.2 * x;
        double way = x * (speed + x2 * (pull + x3 * (jerk + x4 * (
            s4 + x5 * (s5 + (1.0 / 6.0) * x * s6)))));
        double speed_there = speed + x * (pull + x2 * (jerk + x3 * (s4 + x4 * (s5 + x5 * s6))));
        double e = 1.0 - speed_there * inverse, e2 = e * e;
        double slowness = inverse * ((1.0 + e) * (1.0 + e2)), miss = way - ahead;
        double newton = miss * slowness, time = x - newton;
        double impact_speed = speed_there - newton * (pull + x * (jerk + x2 * s4));
        double total = d + time, power = time * time;
        power = power * power * power;
        double error = bend * (newton * newton + 0.00025 * (fabs(time) * power))
            + fabs(miss) * (e2 * e2);
        bool within = (total > since) & (total < until) & (speed > 0.0);
        bool ends = ((fabs(x) + fabs(newton)) * (1.0 + beta) < NEAREST)
            & (error < LAST_ERROR * (impact_speed * total))
            & ((8.0 * bend) * error < impact_speed * impact_speed) & within;
        bool fresh = (t->left[i] > 0.0) & (t->search[i] == 0.0);
        bool known = fresh & (verdict == BRACKETED) & (beta * d < SERIES_MAXIMUM);
        bool hits = known & ends, again = known & within & !ends & !(t->again[i] > 0.0);
        bool fails = fresh & !(hits | again) & (verdict != TURNS);
        t->next_again[i] = again ? total : 0.0;
        t->next_search[i] = fails ? SEARCHED + 1.0 : t->search[i];
        double behind = since + (verdict == FURTHER ? length : 0.0);
        t->duration[i] += fails ? behind : 0.0;
        t->has_hit[i] = hits;
        t->next_step[i] = hits ? total : 0.0;
        t->impact_velocity[i] = wall * impact_speed;
    }
}

static int64_t take_off(tile *restrict t)
{
    int64_t found = 0;
    EACH {
        bool hits = t->has_hit[i] != 0;
        double phase = t->phase[i], d = t->next_step[i];
        double total = phase + d, part = total - phase;
        double rounding = (phase - (total - part)) + (d - part);
        double periods = ((total * (1.0 / two_pi) - 0.5) + whole_bits) - whole_bits;
        double rest = (total - periods * two_pi) + (rounding - periods * two_pi_tail);
        bool early = rest < 0.0;
        periods = early ? periods - 1.0 : periods;
        rest = early ? rest + two_pi : rest;
        bool late = rest >= two_pi;
        rest = late ? rest - two_pi : rest;
        periods = late ? periods + 1.0 : periods;
        t->cycle[i] += bits(periods + whole_bits) - bits(whole_bits);
        t->phase[i] = rest;
        double left = t->left[i] - (hits ? 1.0 : 0.0), search = t->next_search[i];
        double after = -t->restitution[i] * t->impact_velocity[i];
        bool special = hits & (fabs(after) < STICKING_SPEED);
        t->left[i] = left;
        t->next_velocity[i] = hits ? after : t->velocity[i];
        t->next_displacement[i] = hits ? (t->wall[i] > 0.0 ? 0.0 : -1.0) : t->displacement[i];
        t->is_special[i] = special;
        t->again[i] = t->next_again[i];
        t->search[i] = search;
        found += (special ? 1 : 0) + ((left > 0.0) & (search > 0.0) ? WAITS : 0);
    }
    return found;
}

static void orient(tile *restrict t)
{
    EACH {
        t->velocity[i] = t->next_velocity[i];
        t->displacement[i] = t->next_displacement[i];
        circular there = sine_cosine(t->phase[i]);
        t->sine[i] = there.sine;
        t->cosine[i] = there.cosine;
    }
}

int64_t stride(tile *t, int64_t turns)
{
    see_first(t);
    see_second(t);
    if (fit(t) >= turns)
        see_on(t);
    estimate(t);
    approach(t);
    int64_t late = approach_again(t);
    halve(t);
    arrive(t);
    if (late > 0)
        arrive_late(t);
    come_near(t);
    conclude(t);
    int64_t found = take_off(t);
    orient(t);
    return found;
}
