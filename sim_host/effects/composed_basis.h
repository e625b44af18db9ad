/* composed_basis.h: the terms of composed_term, each written once. The laws and the rows of composed_term are made from
 * these lines. So are the equations and C files that Python writes: Python parses the rows' meanings.
 *
 *   X(name, unit of the coefficient, lowest coefficient as a multiple of the range: 0 or -1, odd, expression)
 *
 * Each list belongs to one place and one way to act there. Both determine the factor of the expression: see ROW_ in
 * composed_rows.h. The symbols, in SI units:
 *   V      voltage at this wheel's motor (0 where it floats); other: voltage at the other motor
 *   i, w, theta   current, speed and angle of this wheel
 *   u, r, psi     surge, yaw rate, heading;   x, y: position;   t: time
 *   a, b   specific force ahead and to the right
 *   patch  1 on a strip across x and 0 beside it, with smooth edges: 1 / (1 + ((x - patch_x) / patch_half_width)^8)
 *   sprung the push of a sprung mass, per mass: q = p^2 z + 2 damping p z' with
 *          z'' + q = -u' (or -r') and p = 2 pi frequency
 *
 * The law is the expression times the factor of its place, V or w, for example. So a gain V * V gives a law in V^3, a
 * loss w * w gives a law in w^3, and a loss 1 gives a linear law.
 */
#ifndef BRICKPILOT_EFFECTS_COMPOSED_BASIS_H
#define BRICKPILOT_EFFECTS_COMPOSED_BASIS_H

/* clang-format off */
#define COMPOSED_DRIVE_GAIN(X) \
    X(v, "1/V", -1, 0, fabs(V)) \
    X(v2, "1/V^2", -1, 0, V * V) \
    X(w, "s/rad", -1, 0, fabs(w)) \
    X(t, "1/s", -1, 0, t) \
    X(sin_time, "1", -1, 0, sin(2 * PI * frequency * t)) \
    X(cos_time, "1", -1, 0, cos(2 * PI * frequency * t))

#define COMPOSED_DRIVE_ADD(X) \
    X(abs_v, "1", -1, 0, fabs(V)) \
    X(root_v, "V^0.5", -1, 0, copysign(sqrt(fabs(V)), V)) \
    X(other, "1", -1, 0, other) \
    X(sin_time, "V", -1, 0, sin(2 * PI * frequency * t)) \
    X(cos_time, "V", -1, 0, cos(2 * PI * frequency * t))

#define COMPOSED_WHEEL_LOSS(X) \
    X(linear, "N m s/rad", -1, 0, 1) \
    X(abs_w, "N m s^2/rad^2", -1, 0, fabs(w)) \
    X(w2, "N m s^3/rad^3", -1, 0, w * w) \
    X(w, "N m s^2/rad^2", -1, 0, w) \
    X(t, "N m/rad", -1, 0, t)

#define COMPOSED_WHEEL_DRY(X) \
    X(constant, "N m", -1, 0, 1) \
    X(v, "N m/V", -1, 0, fabs(V)) \
    X(i, "N m/A", -1, 0, fabs(i)) \
    X(root_w, "N m s^0.5/rad^0.5", -1, 0, sqrt(fabs(w))) \
    X(t, "N m/s", -1, 0, t) \
    X(sin_angle, "N m", -1, 0, sin(order * theta)) \
    X(cos_angle, "N m", -1, 0, cos(order * theta))

#define COMPOSED_WHEEL_GAIN(X) \
    X(i, "1/A", -1, 0, fabs(i)) \
    X(i2, "1/A^2", -1, 0, i * i)

#define COMPOSED_WHEEL_PUSH(X) \
    X(spring, "N m/rad", 0, 0, -theta) \
    X(t, "N m/s", -1, 0, t) \
    X(sin_angle, "N m", -1, 0, sin(order * theta)) \
    X(cos_angle, "N m", -1, 0, cos(order * theta)) \
    X(sin_time, "N m", -1, 0, sin(2 * PI * frequency * t)) \
    X(cos_time, "N m", -1, 0, cos(2 * PI * frequency * t))

#define COMPOSED_SURGE_DRY(X) \
    X(constant, "N", -1, 0, 1) \
    X(r, "N s/rad", -1, 0, fabs(r)) \
    X(t, "N/s", -1, 0, t) \
    X(patch, "N", -1, 0, patch)

#define COMPOSED_SURGE_LOSS(X) \
    X(linear, "N s/m", -1, 0, 1) \
    X(abs_u, "N s^2/m^2", -1, 0, fabs(u)) \
    X(u2, "N s^3/m^3", -1, 0, u * u) \
    X(u, "N s^2/m^2", -1, 0, u) \
    X(abs_r, "N s^2/(m rad)", -1, 0, fabs(r)) \
    X(r, "N s^2/(m rad)", -1, 1, r) \
    X(t, "N/m", -1, 0, t) \
    X(patch, "N s/m", -1, 0, patch)

#define COMPOSED_SURGE_PUSH(X) \
    X(constant, "N", -1, 0, 1) \
    X(r, "N s/rad", -1, 1, r) \
    X(abs_r, "N s/rad", -1, 0, fabs(r)) \
    X(r2, "N s^2/rad^2", -1, 0, r * r) \
    X(t, "N/s", -1, 0, t) \
    X(sin_time, "N", -1, 0, sin(2 * PI * frequency * t)) \
    X(cos_time, "N", -1, 0, cos(2 * PI * frequency * t)) \
    X(sin_heading, "N", -1, 1, sin(psi)) \
    X(cos_heading, "N", -1, 0, cos(psi)) \
    X(sin_x, "N", -1, 0, sin(2 * PI * x / wavelength)) \
    X(cos_x, "N", -1, 0, cos(2 * PI * x / wavelength)) \
    X(patch, "N", -1, 0, patch) \
    X(tether, "N/m", 0, 0, -(x * cos(psi) + y * sin(psi))) \
    X(sprung, "kg", 0, 0, sprung)

#define COMPOSED_YAW_DRY(X) \
    X(constant, "N m", -1, 0, 1) \
    X(u, "N s", -1, 0, fabs(u)) \
    X(t, "N m/s", -1, 0, t) \
    X(patch, "N m", -1, 0, patch)

#define COMPOSED_YAW_LOSS(X) \
    X(linear, "N m s/rad", -1, 0, 1) \
    X(abs_r, "N m s^2/rad^2", -1, 0, fabs(r)) \
    X(r2, "N m s^3/rad^3", -1, 0, r * r) \
    X(r, "N m s^2/rad^2", -1, 1, r) \
    X(abs_u, "N s^2/rad", -1, 0, fabs(u)) \
    X(u, "N s^2/rad", -1, 0, u) \
    X(t, "N m/rad", -1, 0, t) \
    X(patch, "N m s/rad", -1, 0, patch)

#define COMPOSED_YAW_PUSH(X) \
    X(constant, "N m", -1, 1, 1) \
    X(u, "N s", -1, 1, u) \
    X(abs_u, "N s", -1, 1, fabs(u)) \
    X(u2, "N s^2/m", -1, 1, u * u) \
    X(signed_u2, "N s^2/m", -1, 1, u * fabs(u)) \
    X(t, "N m/s", -1, 1, t) \
    X(sin_time, "N m", -1, 1, sin(2 * PI * frequency * t)) \
    X(cos_time, "N m", -1, 1, cos(2 * PI * frequency * t)) \
    X(sin_heading, "N m", -1, 0, sin(psi)) \
    X(cos_heading, "N m", -1, 1, cos(psi)) \
    X(sin_x, "N m", -1, 1, sin(2 * PI * x / wavelength)) \
    X(cos_x, "N m", -1, 1, cos(2 * PI * x / wavelength)) \
    X(spring, "N m/rad", 0, 0, -psi) \
    X(sprung, "kg m^2", 0, 0, sprung)

#define COMPOSED_FLOOR_ADD(X) \
    X(sin_x, "1", -1, 0, sin(2 * PI * x / wavelength)) \
    X(cos_x, "1", -1, 0, cos(2 * PI * x / wavelength)) \
    X(patch, "1", -1, 0, patch)

#define COMPOSED_ENCODER_GAIN(X) \
    X(one, "1", -1, 0, 1) \
    X(abs_w, "s/rad", -1, 0, fabs(w)) \
    X(t, "1/s", -1, 0, t) \
    X(sin_angle, "1", -1, 0, sin(order * theta)) \
    X(cos_angle, "1", -1, 0, cos(order * theta))

#define COMPOSED_GYRO_ADD(X) \
    X(signed_r2, "s/rad", -1, 0, r * fabs(r)) \
    X(r3, "s^2/rad^2", -1, 0, r * r * r) \
    X(abs_r, "1", -1, 1, fabs(r)) \
    X(r2, "s/rad", -1, 1, r * r) \
    X(u, "rad/m", -1, 1, u) \
    X(abs_u, "rad/m", -1, 1, fabs(u)) \
    X(a, "rad s/m", -1, 1, a) \
    X(b, "rad s/m", -1, 0, b) \
    X(t, "rad/s^2", -1, 1, t) \
    X(t2, "rad/s^3", -1, 1, t * t) \
    X(sin_time, "rad/s", -1, 1, sin(2 * PI * frequency * t)) \
    X(cos_time, "rad/s", -1, 1, cos(2 * PI * frequency * t)) \
    X(current_sum, "rad/(s A)", -1, 1, i_left + i_right) \
    X(current_difference, "rad/(s A)", -1, 0, i_left - i_right)

#define COMPOSED_ACCEL_SURGE_ADD(X) \
    X(a, "1", -1, 0, a) \
    X(signed_a2, "s^2/m", -1, 0, a * fabs(a)) \
    X(a2, "s^2/m", -1, 0, a * a) \
    X(a3, "s^4/m^2", -1, 0, a * a * a) \
    X(b, "1", -1, 1, b) \
    X(abs_u, "1/s", -1, 0, fabs(u)) \
    X(r, "m/(s rad)", -1, 1, r) \
    X(t, "m/s^3", -1, 0, t) \
    X(sin_time, "m/s^2", -1, 0, sin(2 * PI * frequency * t)) \
    X(cos_time, "m/s^2", -1, 0, cos(2 * PI * frequency * t)) \
    X(current_sum, "m/(s^2 A)", -1, 0, i_left + i_right)

#define COMPOSED_ACCEL_SWAY_ADD(X) \
    X(b, "1", -1, 0, b) \
    X(signed_b2, "s^2/m", -1, 0, b * fabs(b)) \
    X(b2, "s^2/m", -1, 1, b * b) \
    X(b3, "s^4/m^2", -1, 0, b * b * b) \
    X(a, "1", -1, 1, a) \
    X(abs_u, "1/s", -1, 1, fabs(u)) \
    X(r, "m/(s rad)", -1, 0, r) \
    X(t, "m/s^3", -1, 1, t) \
    X(sin_time, "m/s^2", -1, 1, sin(2 * PI * frequency * t)) \
    X(cos_time, "m/s^2", -1, 1, cos(2 * PI * frequency * t)) \
    X(current_difference, "m/(s^2 A)", -1, 0, i_left - i_right)

/* clang-format on */

#endif
