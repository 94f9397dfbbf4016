/* The run of Fig. 4 as one plain program: the anchor of benchmarks/plain_loop.py.
 *
 * The loop consists of the vehicle, the reference, the disturbance and the proposed controller, in
 * the order of operations of auv_fmu.loop.closed_loop, so that it gives the same numbers. There are
 * no ports, checks, choices or noise. Numbers in brackets are the equations of the paper.
 */
#include <math.h>

#define NU 0.2785 /* constant of Lemma 2 */

struct parameters {
    double m11, m22, m33, m44, m55, m66; /* masses and inertias with added ones */
    double d11, d22, d33, d44, d55, d66; /* linear damping */
    double righting_pitch, righting_roll;
    double ell; /* distance of the control point */
    double tau_min[3], tau_max[3];
    double A_f, A_d, omega_d; /* disturbance */
    double K1[3], K2[3], lambda, k_d, gamma, sigma, theta_0[4], eps_t, gate; /* controller */
    double tau_d[3], eta_d0[5], nu_d0[5]; /* reference */
    double eta0[6], nu0[6]; /* vehicle at the start */
    double h; /* time step */
};

struct state {
    double position[3], quaternion[4], nu[6]; /* vehicle */
    double y_hat[3], dy_hat_o[3], theta_hat[4]; /* controller */
    double position_d[3], theta_d, psi_d, nu_d[5]; /* reference */
    double square[3]; /* integral of the square of tau */
    double error; /* |y - y_d| */
};

/* Section 4.1. Variables instead of constants, because a program that loads this may change them. */
struct parameters parameters = {
    25.0, 17.5, 30.0, 22.5, 22.5, 15.0,
    30.0, 30.0, 30.0, 20.0, 20.0, 20.0,
    5.0, 5.0,
    0.35,
    {-80.0, -80.0, -80.0}, {80.0, 80.0, 80.0},
    0.5, 1.0, 0.1,
    {10.0, 10.0, 10.0}, {10.0, 10.0, 10.0}, 1.0, 50.0, 1.0, 0.001,
    {0.0, 0.0, 0.0, 0.0}, 1.0, 1.0,
    {5.0, 1.0, 2.0}, {0.0, 0.0, -2.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0, 0.0},
    {2.0, 6.0, 0.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0, 0.0, 0.0},
    0.02,
};

static inline double norm(const double a[3]) {
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
}

static inline double sign(double x) {
    return x != 0.0 ? copysign(1.0, x) : 0.0;
}

/* (3) */
static inline double limit(double x, double least, double most) {
    return x > most ? most : x < least ? least : x;
}

/* (2): accelerations (u, v, w, q, r). */
static inline void accelerations(const struct parameters *p, const double nu[5], double sin_theta,
                                 const double tau[3], const double tau_w[5], double dnu[5]) {
    double u = nu[0], v = nu[1], w = nu[2], q = nu[3], r = nu[4];
    double righting = p->righting_pitch * sin_theta;
    dnu[0] = (p->m22 * v * r - p->m33 * w * q - p->d11 * u + tau[0] - tau_w[0]) / p->m11;
    dnu[1] = (-p->m11 * u * r - p->d22 * v - tau_w[1]) / p->m22;
    dnu[2] = (p->m11 * u * q - p->d33 * w - tau_w[2]) / p->m33;
    dnu[3] = ((p->m33 - p->m11) * u * w - p->d55 * q - righting + tau[1] - tau_w[3]) / p->m55;
    dnu[4] = ((p->m11 - p->m22) * u * v - p->d66 * r + tau[2] - tau_w[4]) / p->m66;
}

/* Columns of the rotation of a unit quaternion, body to earth. */
static inline void rotation_from_quaternion(const double quaternion[4], double R[3][3]) {
    double a = quaternion[0], b = quaternion[1], c = quaternion[2], d = quaternion[3];
    R[0][0] = 1 - 2 * (c * c + d * d);
    R[0][1] = 2 * (b * c + a * d);
    R[0][2] = 2 * (b * d - a * c);
    R[1][0] = 2 * (b * c - a * d);
    R[1][1] = 1 - 2 * (b * b + d * d);
    R[1][2] = 2 * (c * d + a * b);
    R[2][0] = 2 * (b * d + a * c);
    R[2][1] = 2 * (c * d - a * b);
    R[2][2] = 1 - 2 * (b * b + c * c);
}

/* Disturbance (56), and a step of the vehicle: (1) and (2), with the terms that roll adds. */
static inline void step_vehicle(const struct parameters *p, struct state *x, double R[3][3],
                                const double tau[3], double t) {
    double h = p->h, A_f = p->A_f, waves = p->A_d * sin(p->omega_d * t);
    double u = x->nu[0], v = x->nu[1], w = x->nu[2], p_ = x->nu[3], q = x->nu[4], r = x->nu[5];
    double a = x->quaternion[0], b = x->quaternion[1], c = x->quaternion[2], d = x->quaternion[3];
    double without_roll[5] = {u, v, w, q, r}, dnu[5];
    double tau_w[5] = {
        A_f * sign(u) + waves,
        A_f * sign(v) + waves - p->m33 * w * p_,
        A_f * sign(w) + waves + p->m22 * v * p_,
        A_f * sign(q) + waves - (p->m66 - p->m44) * p_ * r,
        A_f * sign(r) + waves - (p->m44 - p->m55) * p_ * q,
    };
    accelerations(p, without_roll, -R[0][2], tau, tau_w, dnu);
    double dp = ((p->m22 - p->m33) * v * w + (p->m55 - p->m66) * q * r - p->d44 * p_ -
                 p->righting_roll * R[1][2] - (A_f * sign(p_) + waves)) / p->m44;
    for (int i = 0; i < 3; i++) x->position[i] += h * (R[0][i] * u + R[1][i] * v + R[2][i] * w);
    x->nu[0] = u + h * dnu[0];
    x->nu[1] = v + h * dnu[1];
    x->nu[2] = w + h * dnu[2];
    x->nu[3] = p_ + h * dp;
    x->nu[4] = q + h * dnu[3];
    x->nu[5] = r + h * dnu[4];
    double turned[4] = {
        a + h * (-0.5 * (b * p_ + c * q + d * r)),
        b + h * (0.5 * (a * p_ + c * r - d * q)),
        c + h * (0.5 * (a * q + d * p_ - b * r)),
        d + h * (0.5 * (a * r + b * q - c * p_)),
    };
    double length = sqrt(turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2] +
                         turned[3] * turned[3]);
    for (int i = 0; i < 4; i++) x->quaternion[i] = turned[i] / length;
}

struct reference {
    double y_d[3], dy_d[3], ddy_d[3];
};

/* T_1 of (1) times a vector, of an attitude without roll. */
struct tilt {
    double c_theta, s_theta, c_psi, s_psi;
};

static inline void tilted(const struct tilt *T, double a, double b, double c, double x[3]) {
    x[0] = T->c_psi * T->c_theta * a - T->s_psi * b + T->s_theta * T->c_psi * c;
    x[1] = T->s_psi * T->c_theta * a + T->c_psi * b + T->s_theta * T->s_psi * c;
    x[2] = T->c_theta * c - T->s_theta * a;
}

static inline struct tilt tilt_of(const struct state *x) {
    struct tilt T = {cos(x->theta_d), sin(x->theta_d), cos(x->psi_d), sin(x->psi_d)};
    return T;
}

/* (9), of the reference. */
static inline void desired_point(const struct parameters *p, const struct state *x,
                                 const struct tilt *T, double y_d[3]) {
    y_d[0] = x->position_d[0] + p->ell * (T->c_psi * T->c_theta);
    y_d[1] = x->position_d[1] + p->ell * (T->s_psi * T->c_theta);
    y_d[2] = x->position_d[2] - p->ell * T->s_theta;
}

/* Definition 1: the reference by (9), (10) and its derivative, and a step of (1) and (2). */
static inline void step_reference(const struct parameters *p, struct state *x,
                                  struct reference *now) {
    static const double undisturbed[5] = {0.0, 0.0, 0.0, 0.0, 0.0};
    double h = p->h, ell = p->ell, velocity[3], dnu[5];
    double u = x->nu_d[0], v = x->nu_d[1], w = x->nu_d[2], q = x->nu_d[3], r = x->nu_d[4];
    struct tilt T = tilt_of(x);
    accelerations(p, x->nu_d, T.s_theta, p->tau_d, undisturbed, dnu);
    double a2 = v + ell * r, a3 = w - ell * q, roll_rate = r * -T.s_theta / T.c_theta;
    desired_point(p, x, &T, now->y_d);
    tilted(&T, u, a2, a3, now->dy_d);
    tilted(&T, dnu[0] + q * a3 - r * a2, dnu[1] + ell * dnu[4] + r * u - roll_rate * a3,
           dnu[2] - ell * dnu[3] + roll_rate * a2 - q * u, now->ddy_d);
    tilted(&T, u, v, w, velocity);
    for (int i = 0; i < 3; i++) x->position_d[i] += h * velocity[i];
    x->theta_d += h * q;
    x->psi_d += h * (r / T.c_theta);
    for (int i = 0; i < 5; i++) x->nu_d[i] += h * dnu[i];
}

/* J^T F below (14), by the Euler angles that the controller is told. */
static inline void actuator_command(const double R[3][3], const double F[3], double ell,
                                    double tau[3]) {
    double pitch_sine = R[0][2] > 1.0 ? -1.0 : R[0][2] < -1.0 ? 1.0 : -R[0][2];
    double phi = atan2(R[1][2], R[2][2]), theta = asin(pitch_sine), psi = atan2(R[0][1], R[0][0]);
    double c_phi = cos(phi), s_phi = sin(phi), c_theta = cos(theta), s_theta = sin(theta);
    double c_psi = cos(psi), s_psi = sin(psi);
    tau[0] = c_psi * c_theta * F[0] + s_psi * c_theta * F[1] + -s_theta * F[2];
    tau[1] = -ell * ((s_theta * c_psi * c_phi + s_psi * s_phi) * F[0] +
                     (s_theta * s_psi * c_phi - c_psi * s_phi) * F[1] + c_theta * c_phi * F[2]);
    tau[2] = ell * ((s_theta * c_psi * s_phi - s_psi * c_phi) * F[0] +
                    (s_theta * s_psi * s_phi + c_psi * c_phi) * F[1] + c_theta * s_phi * F[2]);
}

/* (16) to (24): force at the control point, and a step of observer and adaptive law. */
static inline void step_controller(const struct parameters *p, struct state *x, const double y[3],
                                   const struct reference *now, double F[3]) {
    double h = p->h, lambda = p->lambda, k_d = p->k_d;
    double s_z[3], s_ez[3], dy_hat[3], dy_r[3], ddy_r[3], dy_o[3], r_hat[3], z[3];
    for (int i = 0; i < 3; i++) z[i] = y[i] - x->y_hat[i];
    if (p->gate != 0.0 && !(norm(z) <= p->gate)) {
        for (int i = 0; i < 3; i++) x->y_hat[i] = y[i], x->dy_hat_o[i] = z[i] = 0.0;
    }
    for (int i = 0; i < 3; i++) {
        double e_z = x->y_hat[i] - now->y_d[i];
        s_z[i] = tanh(z[i]);
        s_ez[i] = tanh(e_z);
        dy_r[i] = now->dy_d[i] - lambda * s_ez[i]; /* (16) */
        dy_hat[i] = x->dy_hat_o[i] + lambda * s_z[i] + k_d * z[i]; /* (23) */
        dy_o[i] = dy_hat[i] - lambda * s_z[i]; /* (18) */
        double de = dy_hat[i] - now->dy_d[i];
        ddy_r[i] = now->ddy_d[i] - lambda * (1.0 - s_ez[i] * s_ez[i]) * de; /* Remark 3 */
        r_hat[i] = de + lambda * s_ez[i] + lambda * s_z[i]; /* below (21) */
    }
    double speed = norm(dy_r), G[4] = {1.0, speed, speed * speed, norm(ddy_r)}; /* below (20) */
    double rho_hat = G[0] * x->theta_hat[0] + G[1] * x->theta_hat[1] + G[2] * x->theta_hat[2] +
                     G[3] * x->theta_hat[3];
    double steepness = NU * rho_hat, r_norm = norm(r_hat);
    for (int i = 0; i < 3; i++) {
        F[i] = -p->K1[i] * tanh(dy_o[i] - dy_r[i]) - p->K2[i] * s_ez[i] - p->K2[i] * s_z[i] -
               rho_hat * tanh(steepness * r_hat[i] / p->eps_t); /* (21) */
        x->y_hat[i] += h * dy_hat[i];
        x->dy_hat_o[i] += h * (ddy_r[i] + k_d * lambda * s_z[i]); /* (51) */
    }
    for (int i = 0; i < 4; i++) { /* (22) */
        double forgotten = p->sigma * (x->theta_hat[i] - p->theta_0[i]);
        x->theta_hat[i] += h * (p->gamma * (G[i] * r_norm - forgotten));
    }
}

/* (9) */
static inline void control_point(const struct parameters *p, const struct state *x, double R[3][3],
                                 double y[3]) {
    rotation_from_quaternion(x->quaternion, R);
    for (int i = 0; i < 3; i++) y[i] = x->position[i] + p->ell * R[0][i];
}

static struct state start(const struct parameters *p) {
    struct state x = {0};
    double R[3][3], c[3], s[3];
    for (int i = 0; i < 3; i++) {
        c[i] = cos(p->eta0[3 + i] / 2);
        s[i] = sin(p->eta0[3 + i] / 2);
        x.position[i] = p->eta0[i];
        x.position_d[i] = p->eta_d0[i];
    }
    x.quaternion[0] = c[0] * c[1] * c[2] + s[0] * s[1] * s[2];
    x.quaternion[1] = s[0] * c[1] * c[2] - c[0] * s[1] * s[2];
    x.quaternion[2] = c[0] * s[1] * c[2] + s[0] * c[1] * s[2];
    x.quaternion[3] = c[0] * c[1] * s[2] - s[0] * s[1] * c[2];
    x.theta_d = p->eta_d0[3];
    x.psi_d = p->eta_d0[4];
    for (int i = 0; i < 6; i++) x.nu[i] = p->nu0[i];
    for (int i = 0; i < 5; i++) x.nu_d[i] = p->nu_d0[i];
    for (int i = 0; i < 4; i++) x.theta_hat[i] = p->theta_0[i];
    control_point(p, &x, R, x.y_hat);
    return x;
}

/* All states after some steps. */
void run(long steps, struct state *end) {
    const struct parameters p = parameters;
    struct state x = start(&p);
    double R[3][3], y[3], y_d[3], F[3], tau[3], t = 0.0;
    for (long k = 0; k < steps; k++) {
        struct reference now;
        double next = (double)(k + 1) * p.h;
        control_point(&p, &x, R, y);
        step_reference(&p, &x, &now);
        step_controller(&p, &x, y, &now, F);
        actuator_command((const double(*)[3])R, F, p.ell, tau);
        for (int i = 0; i < 3; i++) {
            tau[i] = limit(tau[i], p.tau_min[i], p.tau_max[i]);
            x.square[i] += tau[i] * tau[i] * (next - t);
        }
        step_vehicle(&p, &x, R, tau, t);
        t = next;
    }
    const struct tilt T = tilt_of(&x);
    desired_point(&p, &x, &T, y_d);
    control_point(&p, &x, R, y);
    for (int i = 0; i < 3; i++) y[i] -= y_d[i];
    x.error = norm(y);
    *end = x;
}
