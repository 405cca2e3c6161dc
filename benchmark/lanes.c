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
 * The step of core/flight/lanes_step.py written by hand in C, as a yardstick for benchmark/lanes.py.
 *
 * Rows and formulas are those of the Python file, in the same order; compiled without contraction
 * both give the same bits. LANES comes from the command line of the compiler.
 */

#include <math.h>
#include <stdint.h>

typedef double row[LANES];
typedef int64_t whole[LANES];

typedef struct {
    whole cycle;
    row phase, displacement, velocity, sine, cosine, alpha, beta, gamma, restitution, left;
    row duration, effort, moved, velocity_now, sine_now, cosine_now;
    row towards, speed, pull, jerk, ahead, behind, horizon, step, jerk_bound, snap_bound, returns;
    row aimed, aim_error, slowness, longest;
    row next_step, next_towards, next_displacement, next_velocity, next_sine, next_cosine;
    row sine_half, cosine_half, impact_velocity;
    whole has_hit, is_special, count, number, end;
} tile;

typedef struct {
    double s4, s5, s6, s7, s8, bend;
} series;

#define ALWAYS static inline __attribute__((always_inline))
#define EACH for (int i = 0; i < LANES; i++)

static const double two_pi = 6.283185307179586, two_pi_tail = 2.4492935982947064e-16;

ALWAYS double clip(double x) { return x > 0.0 ? x : 0.0; }

ALWAYS double sine_series(double y)
{
    double z = y * y;
    return y * (1.0 / 120 + z * (1.0 / 362880 + z * (1.0 / 6227020800
                + z * (1.0 / 355687428096000))))
        - (1.0 / 6 + z * (1.0 / 5040 + z * (1.0 / 39916800 + z * (1.0 / 1307674368000))));
}

ALWAYS series derivatives(const tile *t, int i)
{
    double alpha = t->alpha[i], beta = t->beta[i], towards = t->towards[i] * alpha;
    double sine = towards * t->sine_now[i], cosine = towards * t->cosine_now[i];
    double relax = t->pull[i] + sine, square = beta * beta;
    double relax_2 = square * relax, relax_3 = beta * relax_2;
    double relax_4 = square * relax_2, relax_5 = square * relax_3, relax_6 = square * relax_4;
    series s = {
        sine + relax_2, cosine - relax_3, relax_4 - sine, -cosine - relax_5, sine + relax_6,
        alpha + (fabs(relax_6) > fabs(relax) ? fabs(relax_6) : fabs(relax)),
    };
    return s;
}

ALWAYS double worst_jerk(double jerk, double jerk_bound, double snap_bound, double longest)
{
    double c = jerk + snap_bound * longest * 0.25;
    c = c < jerk_bound ? c : jerk_bound;
    return clip(c);
}

static void look_ahead(tile *restrict t)
{
    EACH {
        double alpha = t->alpha[i], beta = t->beta[i], velocity = t->velocity_now[i];
        double drive_cosine = alpha * t->cosine_now[i];
        double relax = t->gamma[i] - beta * (velocity - drive_cosine);
        double relax_1 = beta * relax, bound_3 = alpha + fabs(relax_1);
        int rising = velocity > 0.0;
        double towards = rising ? 1.0 : -1.0, u = fabs(velocity);
        double f = towards * (relax - alpha * t->sine_now[i]);
        double upper = clip(-t->displacement[i] - t->moved[i]);
        double lower = clip(1.0 + t->displacement[i] + t->moved[i]);
        double ahead = rising ? upper : lower;
        double discriminant = u * u + 2.0 * f * ahead, root = sqrt(discriminant);
        int moves = u > 0.0;
        int recedes = (discriminant < 0.0) | ((u <= 0.0) & (f <= 0.0));
        double horizon = (recedes ? 2.5 * fabs(f) : moves ? 2.0 * ahead : root)
            / (recedes ? bound_3 : moves ? u + root : f);
        horizon = recedes & !(horizon > 0.3) ? 0.3 : horizon;
        t->horizon[i] = horizon < 10.0 ? horizon : 10.0;
        t->towards[i] = towards;
        t->speed[i] = u;
        t->pull[i] = f;
        t->jerk[i] = towards * (-drive_cosine - relax_1);
        t->jerk_bound[i] = bound_3;
        t->snap_bound[i] = alpha + fabs(beta * relax_1);
        t->ahead[i] = ahead;
        t->behind[i] = rising ? lower : upper;
    }
}

static void stop_ahead_and_aim(tile *restrict t)
{
    EACH {
        double u = t->speed[i], ahead = t->ahead[i], x = t->horizon[i], f = t->pull[i];
        double j = t->jerk[i];
        double c = worst_jerk(j, t->jerk_bound[i], t->snap_bound[i], x);
        double bent = f + c * x * (1.0 / 3.0), root = sqrt(u * u + 2.0 * bent * ahead);
        int moves = u > 0.0;
        double front = (moves ? 2.0 * ahead : root) / (moves ? u + root : bent);
        int reaches = (moves | (bent > 0.0)) & (front < x);
        t->step[i] = reaches ? front : x;

        series s = derivatives(t, i);
        double x2 = 0.5 * x, x3 = (1.0 / 3.0) * x, x4 = 0.25 * x, x5 = 0.2 * x;
        double x6 = (1.0 / 6.0) * x;
        double way = x * (u + x2 * (f + x3 * (j + x4 * (s.s4 + x5 * (
            s.s5 + x6 * (s.s6 + (1.0 / 7.0) * x * s.s7))))));
        double speed = u + x * (f + x2 * (j + x3 * (s.s4 + x4 * (
            s.s5 + x5 * (s.s6 + x6 * s.s7)))));
        double acceleration = f + x * (j + x2 * (s.s4 + x3 * (s.s5 + x4 * (s.s6 + x5 * s.s7))));
        double inverse = 1.0 / speed, newton = (way - ahead) * inverse;
        double bending = (0.5 * acceleration) * (inverse * newton);
        double change = newton + newton * bending;
        t->aimed[i] = x - change;
        t->aim_error[i] = (newton * newton) * (
            1.25 * fabs(acceleration * bending)
            + (0.57 * (s.bend + t->jerk_bound[i])) * fabs(newton));
        t->slowness[i] = (fabs(bending) < 0.5) & moves ? inverse : -1.0;
        t->longest[i] = x + fabs(change);
    }
}

static void stop_behind(tile *restrict t)
{
    EACH {
        double u = t->speed[i], f = t->pull[i], front = t->step[i];
        double c = worst_jerk(-t->jerk[i], t->jerk_bound[i], t->snap_bound[i], front);
        double q = c * front * (1.0 / 3.0) - f, behind = t->behind[i];
        double way = u + sqrt(u * u + 2.0 * q * behind);
        int bends = way * c < 3.0 * f * q;
        double back = (bends ? 3.0 * f : way) / (bends ? c : q);
        int returns = (front * (0.5 * q * front - u) > behind) & (back < front);
        t->step[i] = returns ? back : front;
        t->returns[i] = returns ? 1.0 : 0.0;
    }
}

static void close_in(tile *restrict t)
{
    EACH {
        double u = t->speed[i], f = t->pull[i], j = t->jerk[i], x = t->aimed[i];
        series s = derivatives(t, i);
        double impact_speed = u + x * (f + 0.5 * x * (j + (1.0 / 3.0) * x * (
            s.s4 + 0.25 * x * (s.s5 + 0.2 * x * (
                s.s6 + (1.0 / 6.0) * x * (s.s7 + (1.0 / 7.0) * x * s.s8))))));
        double power = x * x;
        power = power * power;
        double error = t->aim_error[i] + s.bend * (power * power * (1.0 / 40320.0));
        double slowness = t->slowness[i], margin = 2.0 * error * slowness;
        double longest = t->longest[i], jerk_bound = t->jerk_bound[i];
        double c = (1.0 / 3.0) * t->snap_bound[i] * longest - j;
        c = c < jerk_bound ? c : jerk_bound;
        c = clip(c);
        int certain = (slowness > 0.0) & (longest < 2.0) & (x >= margin)
            & (u + longest * (f - 0.5 * c * longest) > 0.0)
            & (margin * (impact_speed - (1.25 * s.bend) * margin) >= error);
        double d = t->duration[i];
        int ends = certain & (error < 1e-16 * impact_speed * (d + x));
        double near = x - margin, step = t->step[i];
        int returns = t->returns[i] != 0.0;
        step = certain & ((near > step) | returns) ? near : step;
        double towards = returns & !certain ? -t->towards[i] : t->towards[i];
        double before = ends ? impact_speed : towards * t->velocity_now[i];
        int is_active = t->left[i] > 0.0;
        int hits = (ends | (d + step == d)) & is_active;
        t->next_step[i] = is_active ? (ends ? x : step) : 0.0;
        t->next_towards[i] = towards;
        t->has_hit[i] = hits;
        t->effort[i] = is_active & !hits ? t->effort[i] + 1.0 : 0.0;
        t->impact_velocity[i] = towards * clip(before);
    }
}

static void strike(tile *restrict t)
{
    EACH {
        int hits = t->has_hit[i] != 0;
        double d = t->duration[i] + t->next_step[i], phase = t->phase[i], x = hits ? d : 0.0;
        double total = phase + x, part = total - phase;
        double rounding = (phase - (total - part)) + (x - part);
        double periods = floor(total / two_pi);
        double rest = (total - periods * two_pi) + (rounding - periods * two_pi_tail);
        int under = rest < 0.0;
        rest = under ? rest + two_pi : rest;
        periods = under ? periods - 1.0 : periods;
        int over = rest >= two_pi;
        rest = over ? clip(rest - two_pi) : rest;
        periods = over ? periods + 1.0 : periods;
        int same = total < two_pi;
        t->cycle[i] += (int64_t)(same ? 0.0 : periods);
        t->phase[i] = same ? total : rest;
        t->duration[i] = hits ? 0.0 : d;
        t->left[i] -= hits ? 1.0 : 0.0;
        double after = -t->restitution[i] * t->impact_velocity[i];
        t->next_velocity[i] = hits ? after : t->velocity[i];
        t->next_displacement[i] = hits ? (t->next_towards[i] > 0.0 ? 0.0 : -1.0)
                                       : t->displacement[i];
    }
}

static void turn(tile *restrict t)
{
    EACH {
        double d = t->duration[i];
        int begins = d == 0.0;
        double x = begins ? t->phase[i] : 0.5 * d;
        double k = rint(x * (2.0 / M_PI));
        double r = ((x - k * 0x1.921fb544p+0) - k * 0x1.0b4611a6p-34) - k * 0x1.3198a2e037073p-69;
        double y = r * r, z = y * y, sine = r + r * (y * sine_series(y));
        double half = 0.5 * y, w = 1.0 - half;
        double cosine = w + (((1.0 - w) - half) + z * (
            (1.0 / 24 + z * (1.0 / 40320 + z * (1.0 / 479001600 + z * (1.0 / 20922789888000))))
            - y * (1.0 / 720 + z * (1.0 / 3628800 + z * (
                1.0 / 87178291200 + z * (1.0 / 6402373705728000))))));
        int64_t quadrant = (int64_t)k;
        int odd = (quadrant & 1) != 0;
        double s = (1.0 - (double)(quadrant & 2)) * (odd ? cosine : sine);
        double c = (1.0 - (double)((quadrant + 1) & 2)) * (odd ? sine : cosine);
        t->next_sine[i] = begins ? s : t->sine[i];
        t->next_cosine[i] = begins ? c : t->cosine[i];
        t->sine_half[i] = begins ? 0.0 : s;
        t->cosine_half[i] = begins ? 1.0 : c;
    }
}

static int64_t fly(tile *restrict t)
{
    int64_t specials = 0;
    EACH {
        double alpha = t->alpha[i], beta = t->beta[i], gamma = t->gamma[i], d = t->duration[i];
        double v0 = t->next_velocity[i], sin_p = t->next_sine[i], cos_p = t->next_cosine[i];
        t->velocity[i] = v0;
        t->displacement[i] = t->next_displacement[i];
        t->sine[i] = sin_p;
        t->cosine[i] = cos_p;
        double x = beta * d, y = x * x;
        double second = (1.0 / 2 + y * (1.0 / 24 + y * (1.0 / 720 + y * (1.0 / 40320 + y * (
            1.0 / 3628800 + y * (1.0 / 479001600 + y * (1.0 / 87178291200 + y * (
                1.0 / 20922789888000)))))))
            - x * (1.0 / 6 + y * (1.0 / 120 + y * (1.0 / 5040 + y * (1.0 / 362880 + y * (
                1.0 / 39916800 + y * (1.0 / 6227020800 + y * (1.0 / 1307674368000 + y * (
                    1.0 / 355687428096000)))))))));
        double first = 1.0 - x * second, decay = 1.0 - x * first, integral = d * first;
        second = d * d * second;
        double sin_half = t->sine_half[i], versine = 2.0 * sin_half * sin_half;
        double sine = 2.0 * sin_half * t->cosine_half[i], square = d * d;
        double defect = d > 1.0 ? sine - d : d * (square * sine_series(square));
        t->moved[i] = v0 * integral + gamma * second
            + alpha * (cos_p * (defect + beta * second) - sin_p * versine);
        t->velocity_now[i] = v0 * decay + gamma * integral
            + alpha * (cos_p * (beta * integral - versine) - sin_p * sine);
        t->sine_now[i] = sin_p + (cos_p * sine - sin_p * versine);
        t->cosine_now[i] = cos_p - (cos_p * versine + sin_p * sine);
        int special = ((t->has_hit[i] != 0) & (fabs(v0) < 1e-10))
            | ((t->left[i] > 0.0) & ((x >= 1.0) | (d >= 64.0 * two_pi)
                                     | (t->effort[i] > 64.0 + 4.0 * d)));
        t->is_special[i] = special;
        specials += special;
    }
    return specials;
}

int64_t take_steps(tile *t, int64_t steps)
{
    int64_t specials = 0;
    for (int64_t k = 0; k < steps; k++) {
        look_ahead(t);
        stop_ahead_and_aim(t);
        stop_behind(t);
        close_in(t);
        strike(t);
        turn(t);
        specials += fly(t);
        EACH t->count[i] += t->has_hit[i];
    }
    return specials;
}
