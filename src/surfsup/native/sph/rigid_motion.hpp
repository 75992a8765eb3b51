// The motion of a rigid solid between two poses.
#pragma once

// The code of an instruction set must not share these functions with other code.
#define SURFSUP_INLINE [[gnu::always_inline]] inline

namespace surfsup {

// Position and unit quaternion (w, x, y, z) of a solid's frame.
struct Pose {
    double position[3], rotation[4];
};

// From the frame of a solid to the world: rotate (row by row), then translate.
struct RigidTransform {
    float rotation[9], translation[3];

    SURFSUP_INLINE void to_own(const float* point, float* own) const {
        const float x = point[0] - translation[0], y = point[1] - translation[1], z = point[2] - translation[2];
        for (int axis = 0; axis < 3; ++axis) own[axis] = x * rotation[axis] + y * rotation[3 + axis] + z * rotation[6 + axis];
    }
    SURFSUP_INLINE void rotate(const float* own, float* vector) const {
        for (int row = 0; row < 3; ++row)
            vector[row] = rotation[3 * row] * own[0] + rotation[3 * row + 1] * own[1] + rotation[3 * row + 2] * own[2];
    }
    SURFSUP_INLINE void to_world(const float* own, float* point) const {
        rotate(own, point);
        for (int axis = 0; axis < 3; ++axis) point[axis] += translation[axis];
    }
};

// Where a solid is at one time, and the velocity of its points until a later one.
struct RigidStep {
    RigidTransform place;
    float turn[9], drift[3];

    // Mean velocity, m/s, of the material point that is at `point` now.
    SURFSUP_INLINE void velocity(const float* point, float* velocity) const {
        float arm[3];
        for (int axis = 0; axis < 3; ++axis) arm[axis] = point[axis] - place.translation[axis];
        for (int row = 0; row < 3; ++row)
            velocity[row] = turn[3 * row] * arm[0] + turn[3 * row + 1] * arm[1] + turn[3 * row + 2] * arm[2] + drift[row];
    }
};

// Moves on a straight line at constant speed and turns about a fixed axis at constant rate, by less than half a turn.
struct RigidMotion {
    Pose start, end;

    // The step between two fractions of the motion, which take `time` seconds; `place` is that at the fraction `now`.
    RigidStep step(double from, double to, double now, double time) const;
};

}  // namespace surfsup
