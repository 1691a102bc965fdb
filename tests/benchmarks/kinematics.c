/* The kernels of compd/model in C, to compare: the frame from nine distances, the tripod's forward and inverse
   kinematics. The same mathematics step by step, with the same checks, tolerances and limits. gcc -O2. */
#include <math.h>
#include <string.h>

enum { OK, NOT_FINITE, UNREACHABLE, NO_CONVERGENCE, NEAR_SINGULAR, OTHER_ASSEMBLY };

static const double AMPLIFICATION_LIMIT = 100.0, STEP_TOLERANCE_MM = 1e-6, RESIDUAL_TOLERANCE_MM = 1e-8;
static const double STEP_LIMIT = 0.5, FURTHEST = 0.1, LARGEST = 1e12, SMALLEST_PIVOT = 1e-12, SMALLEST = 1e-300;
static const double SHORTEST_MM = 1e-6;
static const int ITERATION_LIMIT = 30;
static const int PLATE_POINT_OF_DISTANCE[6] = {0, 2, 0, 1, 1, 2};

static int all_finite(const double *x, int n) {
    int result = 1;
    for (int i = 0; i < n; i++) result = result && fabs(x[i]) < LARGEST;
    return result;
}

static double largest(const double *x, int n) {
    double result = 0.0;
    for (int i = 0; i < n; i++)
        if (!(fabs(x[i]) <= result)) result = fabs(x[i]);
    return result;
}

static double smallest(const double *x, int n) {
    double result = x[0];
    for (int i = 1; i < n; i++)
        if (x[i] < result) result = x[i];
    return result;
}

static double factor(double *A, long *pivot, int n) {
    double sign = 1.0;
    for (int k = 0; k < n; k++) {
        int row = k;
        double size = fabs(A[k * n + k]);
        for (int i = k + 1; i < n; i++)
            if (fabs(A[i * n + k]) > size) size = fabs(A[i * n + k]), row = i;
        if (!(size > SMALLEST_PIVOT)) return 0.0;
        pivot[k] = row;
        if (row != k) {
            sign = -sign;
            for (int j = 0; j < n; j++) {
                double swap = A[k * n + j];
                A[k * n + j] = A[row * n + j], A[row * n + j] = swap;
            }
        }
        if (A[k * n + k] < 0.0) sign = -sign;
        double reciprocal = 1.0 / A[k * n + k];
        for (int i = k + 1; i < n; i++) {
            double f = A[i * n + k] * reciprocal;
            A[i * n + k] = f;
            if (f != 0.0)
                for (int j = k + 1; j < n; j++) A[i * n + j] -= f * A[k * n + j];
        }
    }
    return sign;
}

static void solve(const double *LU, const long *pivot, double *x, int n) {
    for (int k = 0; k < n; k++)
        if (pivot[k] != k) {
            double swap = x[k];
            x[k] = x[pivot[k]], x[pivot[k]] = swap;
        }
    for (int k = 0; k < n; k++)
        for (int i = k + 1; i < n; i++) x[i] -= LU[i * n + k] * x[k];
    for (int k = n - 1; k >= 0; k--) {
        x[k] /= LU[k * n + k];
        for (int i = 0; i < k; i++) x[i] -= LU[i * n + k] * x[k];
    }
}

static double inverse_norm(const double *LU, double *X, int n) {
    double total = 0.0;
    for (int i = 0; i < n; i++) {
        for (int j = 0; j < n; j++) X[i * n + j] = 0.0;
        X[i * n + i] = 1.0;
        for (int k = 0; k < i; k++)
            for (int j = 0; j <= k; j++) X[i * n + j] -= LU[i * n + k] * X[k * n + j];
    }
    for (int i = n - 1; i >= 0; i--) {
        for (int k = i + 1; k < n; k++)
            for (int j = 0; j < n; j++) X[i * n + j] -= LU[i * n + k] * X[k * n + j];
        for (int j = 0; j < n; j++) {
            X[i * n + j] /= LU[i * n + i];
            total += X[i * n + j] * X[i * n + j];
        }
    }
    return sqrt(total);
}

static void turn(double R[3][3], double x, double y, double z) {
    double a = 0.5 * x, b = 0.5 * y, c = 0.5 * z, k = 2.0 / (1.0 + a * a + b * b + c * c);
    for (int j = 0; j < 3; j++) {
        double u = R[0][j], v = R[1][j], w = R[2][j];
        R[0][j] = u + k * (-(b * b + c * c) * u + (a * b - c) * v + (a * c + b) * w);
        R[1][j] = v + k * ((a * b + c) * u - (a * a + c * c) * v + (b * c - a) * w);
        R[2][j] = w + k * ((a * c - b) * u + (b * c + a) * v - (a * a + b * b) * w);
    }
}

static void orthonormalise(double R[3][3]) {
    double s[3][3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) s[i][j] = R[0][i] * R[0][j] + R[1][i] * R[1][j] + R[2][i] * R[2][j];
    for (int i = 0; i < 3; i++) {
        double u = R[i][0], v = R[i][1], w = R[i][2];
        R[i][0] = (1.5 - 0.5 * s[0][0]) * u - 0.5 * s[0][1] * v - 0.5 * s[0][2] * w;
        R[i][1] = (1.5 - 0.5 * s[1][1]) * v - 0.5 * s[0][1] * u - 0.5 * s[1][2] * w;
        R[i][2] = (1.5 - 0.5 * s[2][2]) * w - 0.5 * s[0][2] * u - 0.5 * s[1][2] * v;
    }
}

static void vector_of(double R[3][3], double *vector) {
    double trace = R[0][0] + R[1][1] + R[2][2], x, y, z, w;
    if (trace > 0.0)
        w = 1.0 + trace, x = R[2][1] - R[1][2], y = R[0][2] - R[2][0], z = R[1][0] - R[0][1];
    else if (R[0][0] >= R[1][1] && R[0][0] >= R[2][2])
        x = 1.0 + R[0][0] - R[1][1] - R[2][2], y = R[1][0] + R[0][1], z = R[2][0] + R[0][2], w = R[2][1] - R[1][2];
    else if (R[1][1] >= R[2][2])
        y = 1.0 - R[0][0] + R[1][1] - R[2][2], x = R[1][0] + R[0][1], z = R[2][1] + R[1][2], w = R[0][2] - R[2][0];
    else
        z = 1.0 - R[0][0] - R[1][1] + R[2][2], x = R[2][0] + R[0][2], y = R[2][1] + R[1][2], w = R[1][0] - R[0][1];
    if (w < 0.0) x = -x, y = -y, z = -z, w = -w;
    double sine = sqrt(x * x + y * y + z * z), scale = 2.0 * atan2(sine, w) / fmax(sine, SMALLEST);
    vector[0] = scale * x, vector[1] = scale * y, vector[2] = scale * z;
}

/* --- the frame ------------------------------------------------------------------------------------------- */

static int edges(double b[3][3], const double m[3][3], double *lengths, double J[9][9]) {
    memset(J, 0, 81 * sizeof(double));
    for (int edge = 0; edge < 9; edge++) {
        int near = edge < 3 ? edge : (edge - 3) / 2;
        int far = edge < 3 ? (edge + 1) % 3 : PLATE_POINT_OF_DISTANCE[edge - 3];
        const double *end = edge < 3 ? b[far] : m[far];
        double x = b[near][0] - end[0], y = b[near][1] - end[1], z = b[near][2] - end[2];
        double length = sqrt(x * x + y * y + z * z);
        if (!(length > SHORTEST_MM)) return 0;
        x /= length, y /= length, z /= length;
        lengths[edge] = length;
        J[edge][3 * near] = x, J[edge][3 * near + 1] = y, J[edge][3 * near + 2] = z;
        if (edge < 3) J[edge][3 * far] = -x, J[edge][3 * far + 1] = -y, J[edge][3 * far + 2] = -z;
    }
    return 1;
}

static int place_base(double b[3][3], double R[3][3], double *origin) {
    double p[3], y[3], q[3];
    for (int j = 0; j < 3; j++) {
        origin[j] = (b[0][j] + b[1][j] + b[2][j]) / 3.0;
        p[j] = b[1][j] - b[0][j], y[j] = b[0][j] - origin[j], q[j] = b[2][j] - b[0][j];
    }
    double z[3] = {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]};
    double y_length = sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]);
    double z_length = sqrt(z[0] * z[0] + z[1] * z[1] + z[2] * z[2]);
    if (!(z_length > SHORTEST_MM * y_length)) return 0;
    for (int j = 0; j < 3; j++) y[j] /= y_length, z[j] /= z_length;
    R[0][0] = y[1] * z[2] - y[2] * z[1], R[1][0] = y[2] * z[0] - y[0] * z[2], R[2][0] = y[0] * z[1] - y[1] * z[0];
    for (int j = 0; j < 3; j++) R[j][1] = y[j], R[j][2] = z[j];
    return 1;
}

static int frame_newton(const double *l, const double m[3][3], double b[3][3], long *iterations, double J[9][9]) {
    double limit = STEP_LIMIT * smallest(l, 9), x[9], first_sign = 0.0, sign = 0.0, step = INFINITY;
    long pivot[9];
    while (step > STEP_TOLERANCE_MM) {
        if (*iterations == ITERATION_LIMIT) return NO_CONVERGENCE;
        if (!edges(b, m, x, J)) return NEAR_SINGULAR;
        for (int i = 0; i < 9; i++) x[i] = l[i] - x[i];
        sign = factor(&J[0][0], pivot, 9);
        if (*iterations == 0) first_sign = sign;
        if (sign == 0.0) return NEAR_SINGULAR;
        solve(&J[0][0], pivot, x, 9);
        step = largest(x, 9);
        double shortened = limit / fmax(step, limit);
        for (int i = 0; i < 9; i++) b[i / 3][i % 3] += shortened * x[i];
        ++*iterations;
    }
    return sign == first_sign ? OK : OTHER_ASSEMBLY;
}

static int supports_from(const double *l, const double m[3][3], double b[3][3], long *iterations, double *residual) {
    if (!all_finite(l, 9) || !all_finite(&b[0][0], 9) || !all_finite(&m[0][0], 9)) return NOT_FINITE;
    if (!(smallest(l, 9) > 0.0)) return UNREACHABLE;
    double J[9][9], X[9][9], x[9];
    int reason = frame_newton(l, m, b, iterations, J);
    if (reason == NO_CONVERGENCE || reason == NEAR_SINGULAR) return reason;
    if (inverse_norm(&J[0][0], &X[0][0], 9) > AMPLIFICATION_LIMIT) return NEAR_SINGULAR;
    if (!edges(b, m, x, J)) return NEAR_SINGULAR;
    for (int i = 0; i < 9; i++) x[i] -= l[i];
    *residual = largest(x, 9);
    return *residual > RESIDUAL_TOLERANCE_MM ? NO_CONVERGENCE : reason;
}

static int frame_row(const double *l, const double m[3][3], const double guess[3][3], const double offsets[][3],
                     const long *carriers, long n, const double *zero_origin, const double zero_R[3][3],
                     double b[3][3], double *origin, double R[3][3], double joints[][3], double *displacement,
                     double *rotation, long *iterations, double *residual) {
    memcpy(b, guess, 9 * sizeof(double));
    *iterations = 0, *residual = NAN;
    int reason = supports_from(l, m, b, iterations, residual);
    if (reason != OK) return reason;
    if (!place_base(b, R, origin)) return NEAR_SINGULAR;
    double turned[3][3];
    for (int i = 0; i < 3; i++) {
        displacement[i] = origin[i] - zero_origin[i];
        for (int j = 0; j < 3; j++)
            turned[i][j] = R[i][0] * zero_R[j][0] + R[i][1] * zero_R[j][1] + R[i][2] * zero_R[j][2];
    }
    vector_of(turned, rotation);
    if (fmax(largest(displacement, 3) / smallest(l, 9), largest(rotation, 3)) > FURTHEST) return OTHER_ASSEMBLY;
    for (long i = 0; i < n; i++)
        for (int j = 0; j < 3; j++)
            joints[i][j] = b[carriers[i]][j] +
                           (R[j][0] * offsets[i][0] + R[j][1] * offsets[i][1] + R[j][2] * offsets[i][2]);
    return OK;
}

/* One frame geometry for all rows; `stride` 0 solves the first row again and again, as a live loop would. */
void frame_rows(long rows, long stride, long n, const double *l, const double m[3][3], const double guess[3][3],
                const double offsets[][3], const long *carriers, const double *zero_origin, const double zero_R[3][3],
                double (*b)[3][3], double (*origin)[3], double (*R)[3][3], double (*joints)[3],
                double (*displacement)[3], double (*rotation)[3], long *iterations, double *residual, long *reason) {
    for (long row = 0; row < rows; row++) {
        long i = row * stride;
        reason[i] = frame_row(l + 9 * i, m, guess, offsets, carriers, n, zero_origin, zero_R, b[i], origin[i], R[i],
                              joints + n * i, displacement[i], rotation[i], iterations + i, residual + i);
    }
}

/* --- the tripod ------------------------------------------------------------------------------------------ */

static int close_links(const double *p, double R[3][3], const double a[3][3], const double c[3][3],
                       const double e[3][3], double radius, double *value, double J[6][6]) {
    for (int i = 0; i < 3; i++) {
        double r[3], d[3];
        for (int j = 0; j < 3; j++) {
            r[j] = R[j][0] * c[i][0] + R[j][1] * c[i][1] + R[j][2] * c[i][2];
            d[j] = p[j] + r[j] - a[i][j];
        }
        double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        if (!(length > SHORTEST_MM)) return 0;
        double x = d[0] / length, y = d[1] / length, z = d[2] / length;
        value[i] = length;
        J[i][0] = x, J[i][1] = y, J[i][2] = z;
        J[i][3] = (r[1] * z - r[2] * y) / radius;
        J[i][4] = (r[2] * x - r[0] * z) / radius;
        J[i][5] = (r[0] * y - r[1] * x) / radius;
    }
    for (int i = 0; i < 3; i++) {
        double x[3], q[3];
        for (int j = 0; j < 3; j++) {
            x[j] = R[j][0] * e[i][0] + R[j][1] * e[i][1] + R[j][2] * e[i][2];
            q[j] = p[j] - a[i][j];
        }
        value[3 + i] = q[0] * x[0] + q[1] * x[1] + q[2] * x[2] + c[i][0] * e[i][0] + c[i][1] * e[i][1] + c[i][2] * e[i][2];
        J[3 + i][0] = x[0], J[3 + i][1] = x[1], J[3 + i][2] = x[2];
        J[3 + i][3] = (x[1] * q[2] - x[2] * q[1]) / radius;
        J[3 + i][4] = (x[2] * q[0] - x[0] * q[2]) / radius;
        J[3 + i][5] = (x[0] * q[1] - x[1] * q[0]) / radius;
    }
    return 1;
}

static double platform_radius(const double c[3][3]) {
    double total = 0.0;
    for (int j = 0; j < 3; j++) {
        double mean = (c[0][j] + c[1][j] + c[2][j]) / 3.0;
        for (int i = 0; i < 3; i++) total += (c[i][j] - mean) * (c[i][j] - mean);
    }
    return sqrt(total / 3.0);
}

static int known(const double a[3][3], const double c[3][3], const double e[3][3], const double *p, double R[3][3]) {
    return all_finite(&R[0][0], 9) && all_finite(&a[0][0], 9) && all_finite(&c[0][0], 9) && all_finite(&e[0][0], 9) &&
           all_finite(p, 3);
}

static int turned_over(double R[3][3], const double guess[3][3]) {
    double trace = 0.0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) trace += R[i][j] * guess[i][j];
    return trace < 1.0;
}

static int pose_newton(const double a[3][3], const double c[3][3], const double e[3][3], const double *l, double *p,
                       double R[3][3], double radius, long *iterations, double J[6][6]) {
    double limit = STEP_LIMIT * radius, x[6], first_sign = 0.0, sign = 0.0, step = INFINITY;
    long pivot[6];
    while (step > STEP_TOLERANCE_MM) {
        if (*iterations == ITERATION_LIMIT) return NO_CONVERGENCE;
        if (!close_links(p, R, a, c, e, radius, x, J)) return NEAR_SINGULAR;
        for (int i = 0; i < 6; i++) x[i] = i < 3 ? l[i] - x[i] : -x[i];
        sign = factor(&J[0][0], pivot, 6);
        if (*iterations == 0) first_sign = sign;
        if (sign == 0.0) return NEAR_SINGULAR;
        solve(&J[0][0], pivot, x, 6);
        step = largest(x, 6);
        double shortened = limit / fmax(step, limit);
        for (int i = 0; i < 3; i++) p[i] += shortened * x[i];
        shortened /= radius;
        turn(R, shortened * x[3], shortened * x[4], shortened * x[5]);
        ++*iterations;
    }
    orthonormalise(R);
    return sign == first_sign ? OK : OTHER_ASSEMBLY;
}

static int forward_row(const double a[3][3], const double c[3][3], const double e[3][3], const double *l,
                       const double *guess_p, const double guess_R[3][3], double *p, double R[3][3], double *closed,
                       long *iterations, double *residual) {
    memcpy(p, guess_p, 3 * sizeof(double)), memcpy(R, guess_R, 9 * sizeof(double)), memcpy(closed, l, 3 * sizeof(double));
    *iterations = 0, *residual = NAN;
    if (!known(a, c, e, p, R) || !all_finite(l, 3)) return NOT_FINITE;
    if (smallest(l, 3) <= 0.0) return UNREACHABLE;
    double radius = platform_radius(c), J[6][6], X[6][6], x[6];
    if (!(radius > 0.0)) return NEAR_SINGULAR;
    int reason = pose_newton(a, c, e, l, p, R, radius, iterations, J);
    if (reason == NO_CONVERGENCE || reason == NEAR_SINGULAR) return reason;
    if (inverse_norm(&J[0][0], &X[0][0], 6) > AMPLIFICATION_LIMIT) return NEAR_SINGULAR;
    if (!close_links(p, R, a, c, e, radius, x, J)) return NEAR_SINGULAR;
    for (int i = 0; i < 3; i++) x[i] -= l[i];
    *residual = largest(x, 6);
    if (*residual > RESIDUAL_TOLERANCE_MM) return NO_CONVERGENCE;
    return reason == OK && turned_over(R, guess_R) ? OTHER_ASSEMBLY : reason;
}

void forward_rows(long rows, long stride, const double a[3][3], const double c[3][3], const double e[3][3],
                  const double *l, const double *guess_p, const double guess_R[3][3], double (*p)[3],
                  double (*R)[3][3], double (*closed)[3], long *iterations, double *residual, long *reason) {
    for (long row = 0; row < rows; row++) {
        long i = row * stride;
        reason[i] = forward_row(a, c, e, l + 3 * i, guess_p, guess_R, p[i], R[i], closed[i], iterations + i, residual + i);
    }
}

static int attitude_from(const double a[3][3], const double c[3][3], const double e[3][3], const double *tip,
                         const double *tool, double R[3][3], long *iterations) {
    double J[3][3], x[3], first_sign = 0.0, sign = 0.0, step = INFINITY;
    long pivot[3];
    while (step > 0.0) {
        if (*iterations == ITERATION_LIMIT) return NO_CONVERGENCE;
        double reach = 0.0;
        for (int i = 0; i < 3; i++) {
            double u[3], v[3];
            for (int j = 0; j < 3; j++) {
                u[j] = R[j][0] * e[i][0] + R[j][1] * e[i][1] + R[j][2] * e[i][2];
                v[j] = tip[j] - a[i][j];
            }
            reach = fmax(reach, sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]));
            J[i][0] = u[1] * v[2] - u[2] * v[1], J[i][1] = u[2] * v[0] - u[0] * v[2], J[i][2] = u[0] * v[1] - u[1] * v[0];
            x[i] = -(v[0] * u[0] + v[1] * u[1] + v[2] * u[2]);
            for (int j = 0; j < 3; j++) x[i] -= (c[i][j] - tool[j]) * e[i][j];
        }
        sign = factor(&J[0][0], pivot, 3);
        if (sign == 0.0) return NEAR_SINGULAR;
        if (*iterations == 0) first_sign = sign;
        solve(&J[0][0], pivot, x, 3);
        step = largest(x, 3);
        double shortened = STEP_LIMIT / fmax(step, STEP_LIMIT);
        turn(R, shortened * x[0], shortened * x[1], shortened * x[2]);
        ++*iterations;
        if (step * reach <= STEP_TOLERANCE_MM) step = 0.0;
    }
    orthonormalise(R);
    return sign == first_sign ? OK : OTHER_ASSEMBLY;
}

static int inverse_row(const double a[3][3], const double c[3][3], const double e[3][3], const double *tip,
                       const double *tool, const double guess_R[3][3], double *p, double R[3][3], double *lengths,
                       long *iterations, double *residual) {
    memcpy(R, guess_R, 9 * sizeof(double));
    *iterations = 0, *residual = NAN;
    if (!known(a, c, e, tip, R) || !all_finite(tool, 3)) return NOT_FINITE;
    int reason = attitude_from(a, c, e, tip, tool, R, iterations);
    if (reason != OK) return reason;
    if (turned_over(R, guess_R)) return OTHER_ASSEMBLY;
    for (int i = 0; i < 3; i++) p[i] = tip[i] - (R[i][0] * tool[0] + R[i][1] * tool[1] + R[i][2] * tool[2]);
    double radius = platform_radius(c), J[6][6], X[6][6], x[6];
    long pivot[6];
    if (!(radius > 0.0)) return NEAR_SINGULAR;
    if (!close_links(p, R, a, c, e, radius, x, J)) return UNREACHABLE;
    memcpy(lengths, x, 3 * sizeof(double));
    *residual = largest(x + 3, 3);
    if (*residual > RESIDUAL_TOLERANCE_MM) return NO_CONVERGENCE;
    if (factor(&J[0][0], pivot, 6) == 0.0 || inverse_norm(&J[0][0], &X[0][0], 6) > AMPLIFICATION_LIMIT)
        return NEAR_SINGULAR;
    return OK;
}

void inverse_rows(long rows, long stride, const double a[3][3], const double c[3][3], const double e[3][3],
                  const double *tip, const double *tool, const double guess_R[3][3], double (*p)[3],
                  double (*R)[3][3], double (*lengths)[3], long *iterations, double *residual, long *reason) {
    for (long row = 0; row < rows; row++) {
        long i = row * stride;
        reason[i] = inverse_row(a, c, e, tip + 3 * i, tool, guess_R, p[i], R[i], lengths[i], iterations + i, residual + i);
    }
}
