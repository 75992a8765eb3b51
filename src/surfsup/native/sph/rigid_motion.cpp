#include "sph/rigid_motion.hpp"

#include <cmath>

namespace surfsup {
namespace {

// Spherical linear interpolation of unit quaternions along the shorter arc (K. Shoemake, "Animating rotation with quaternion
// curves", SIGGRAPH 1985).
void interpolate_rotation(const double* one, const double* other, double part, double* result) {
    double cosine = 0;
    for (int k = 0; k < 4; ++k) cosine += one[k] * other[k];
    const double sign = cosine < 0 ? -1 : 1, angle = std::acos(std::fmin(1.0, sign * cosine)), sine = std::sin(angle);
    const double first = sine > 1e-9 ? std::sin((1 - part) * angle) / sine : 1 - part,
                 second = sign * (sine > 1e-9 ? std::sin(part * angle) / sine : part);
    double square = 0;
    for (int k = 0; k < 4; ++k) {
        result[k] = first * one[k] + second * other[k];
        square += result[k] * result[k];
    }
    for (int k = 0; k < 4; ++k) result[k] /= std::sqrt(square);
}

struct Place {
    double rotation[9], position[3];
};

Place place_at(const RigidMotion& motion, double part) {
    Place place{};
    for (int axis = 0; axis < 3; ++axis)
        place.position[axis] = (1 - part) * motion.start.position[axis] + part * motion.end.position[axis];
    double q[4];
    interpolate_rotation(motion.start.rotation, motion.end.rotation, part, q);
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double matrix[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                              2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                              2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    for (int k = 0; k < 9; ++k) place.rotation[k] = matrix[k];
    return place;
}

}  // namespace

RigidStep RigidMotion::step(double from, double to, double now, double time) const {
    const Place before = place_at(*this, from), after = place_at(*this, to), present = place_at(*this, now);
    RigidStep step{};
    for (int row = 0; row < 3; ++row) {
        step.place.translation[row] = static_cast<float>(present.position[row]);
        step.drift[row] = static_cast<float>((after.position[row] - before.position[row]) / time);
        for (int column = 0; column < 3; ++column) {
            const int k = 3 * row + column;
            step.place.rotation[k] = static_cast<float>(present.rotation[k]);
            double change = 0;  // (after - before) present^T: from the arm now to its displacement
            for (int j = 0; j < 3; ++j)
                change += (after.rotation[3 * row + j] - before.rotation[3 * row + j]) * present.rotation[3 * column + j];
            step.turn[k] = static_cast<float>(change / time);
        }
    }
    return step;
}

}  // namespace surfsup
