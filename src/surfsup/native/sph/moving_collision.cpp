#include <algorithm>
#include <cmath>
#include <numeric>

#include "sph/collision_steps.hpp"
#include "sph/crossing.hpp"
#include "sph/moving_solids.hpp"
#include "sph/path_tracing.hpp"

namespace surfsup {
namespace {

// A solid as collision handling sees it: still, or moving with a box around it.
struct Obstacle {
    const SolidQuery* query;
    const LastQuery* last_query;
    bool moves;
    float lower[3], upper[3];
    RigidTransform start;
    RigidStep end;

    void to_own(const float* point, float* own) const {
        if (moves)
            end.place.to_own(point, own);
        else
            std::copy_n(point, 3, own);
    }
};

std::vector<Obstacle> obstacles_of(const SolidQuery& solid, const LastQuery* last_query, const MovingSolids& moving,
                                   float frame_time) {
    std::vector<Obstacle> obstacles;
    if (solid) obstacles.push_back({&solid, last_query, false, {}, {}, {}, {}});
    for (const MovingSolid& body : moving.solids) {
        Obstacle obstacle{&body.query, &body.last_query, true, {}, {}, {}, {}};
        std::copy_n(body.lower, 3, obstacle.lower);
        std::copy_n(body.upper, 3, obstacle.upper);
        obstacle.start = body.motion.step(0, 1, 0, frame_time).place;
        obstacle.end = body.motion.step(0, 1, 1, frame_time);
        obstacles.push_back(obstacle);
    }
    return obstacles;
}

float distance_to_box(const float* point, const float* lower, const float* upper) {
    float square = 0;
    for (int axis = 0; axis < 3; ++axis) {
        const float below = lower[axis] - point[axis], above = point[axis] - upper[axis];
        const float outside = below > 0 ? below : above > 0 ? above : 0;
        square += outside * outside;
    }
    return std::sqrt(square);
}

// The walls, which may move.
class Walls {
public:
    Walls(const Container& container, const std::optional<RigidMotion>& motion, float clearance, float frame_time)
        : moves_(motion) {
        for (int axis = 0; axis < 3; ++axis)
            lower_[axis] = container.lower[axis] + clearance, upper_[axis] = container.upper[axis] - clearance;
        if (motion) step_ = motion->step(0, 1, 1, frame_time);
    }

    // See surfsup::contain.
    bool contain(float* position, float* velocity) const {
        if (!moves_) return surfsup::contain(position, velocity, lower_, upper_);
        float own[3], relative[3], own_velocity[3], wall[3];
        step_.place.to_own(position, own);
        step_.velocity(position, wall);
        for (int axis = 0; axis < 3; ++axis) relative[axis] = velocity[axis] - wall[axis] + step_.place.translation[axis];
        step_.place.to_own(relative, own_velocity);
        if (!surfsup::contain(own, own_velocity, lower_, upper_)) return false;
        step_.place.to_world(own, position);
        step_.velocity(position, wall);
        step_.place.rotate(own_velocity, velocity);
        for (int axis = 0; axis < 3; ++axis) velocity[axis] += wall[axis];
        return true;
    }

private:
    bool moves_;
    float lower_[3], upper_[3];
    RigidStep step_{};
};

// Distances and, on request, normals in the world of particles `subset`.
struct ObstacleQuery {
    std::vector<float> own, distance, normal;

    void run(const Obstacle& obstacle, const float* positions, const std::vector<int32_t>& subset, bool with_normal) {
        own.resize(3 * subset.size()), distance.resize(subset.size()), normal.resize(3 * subset.size());
        for (size_t k = 0; k < subset.size(); ++k)
            obstacle.to_own(positions + 3 * static_cast<int64_t>(subset[k]), &own[3 * k]);
        (*obstacle.query)(own.data(), static_cast<int32_t>(subset.size()), distance.data(),
                          with_normal ? normal.data() : nullptr);
        if (!with_normal || !obstacle.moves) return;
        for (size_t k = 0; k < subset.size(); ++k) {
            float rotated[3];
            obstacle.end.place.rotate(&normal[3 * k], rotated);
            std::copy_n(rotated, 3, &normal[3 * k]);
        }
    }
};

// The particles that may be nearer than the clearance to a moving solid, and those whose path may enter it.
struct Candidates {
    std::vector<int32_t> near, crossing;
};

Candidates candidates_of(const Obstacle& obstacle, const float* before, const float* positions, int32_t count,
                         const CollisionParameters& parameters) {
    Candidates found;
    for (int32_t i = 0; i < count; ++i) {
        const int64_t at = 3 * static_cast<int64_t>(i);
        float from[3], to[3];
        obstacle.start.to_own(before + at, from);
        obstacle.end.place.to_own(positions + at, to);
        const float path = distance_between(from, to), room = distance_to_box(to, obstacle.lower, obstacle.upper);
        if (room > parameters.clearance + path) continue;  // a NaN passes
        if (room > parameters.clearance && !(path > parameters.clearance)) continue;
        const float* last = obstacle.last_query->positions + at;
        const float known = obstacle.last_query->distance[i];
        if (!(parameters.lipschitz_bound * distance_between(last, to) < known - parameters.clearance)) found.near.push_back(i);
        if (path > MIN_SWEPT_PATH * parameters.clearance &&
            !(parameters.lipschitz_bound * (distance_between(last, from) + path) < known))
            found.crossing.push_back(i);
    }
    return found;
}

// Shortens the paths of particles `crossing` to where they enter the solid. In its frame its own motion is part of the path.
void stop_at_entry(const Obstacle& obstacle, const float* before, float* positions, bool* collided,
                   const std::vector<int32_t>& crossing, const CollisionParameters& parameters) {
    std::vector<Path> paths;
    for (const int32_t i : crossing) {
        Path path{i, {}, {}, 0};
        obstacle.start.to_own(before + 3 * static_cast<int64_t>(i), path.from);
        obstacle.end.place.to_own(positions + 3 * static_cast<int64_t>(i), path.to);
        path.length = distance_between(path.from, path.to);
        if (path.length > 0) paths.push_back(path);
    }
    for (const Path& path : entering_paths(*obstacle.query, std::move(paths), parameters, parameters.clearance)) {
        float entry[3];
        path.point_at(path.cut, entry);
        obstacle.end.place.to_world(entry, positions + 3 * static_cast<int64_t>(path.particle));
        collided[path.particle] = true;
    }
}

}  // namespace

void resolve_moving_collisions(const float* before, float* positions, float* velocities, bool* collided, int32_t count,
                               const Container& container, const CollisionParameters& parameters, const SolidQuery& solid,
                               const LastQuery* last_query, const MovingSolids& moving, float frame_time,
                               const ImpulseSums* impulses) {
    const Walls walls(container, moving.walls, parameters.clearance, frame_time);
    const std::vector<Obstacle> obstacles = obstacles_of(solid, last_query, moving, frame_time);
    const auto row_of = [&](size_t number, int64_t particle) {
        if (!obstacles[number].moves) return impulses->still_row(particle);
        return impulses->moving_row(static_cast<int32_t>(number) - (solid ? 1 : 0));
    };
    std::vector<std::vector<int32_t>> active(obstacles.size());
    std::fill_n(collided, count, false);
    for (size_t number = 0; number < obstacles.size(); ++number) {
        const Obstacle& obstacle = obstacles[number];
        if (!obstacle.moves)
            for (const int32_t i : stop_crossings(*obstacle.query, obstacle.last_query, before, positions, count, parameters))
                collided[i] = true;
        if (!obstacle.moves && obstacle.last_query) {
            active[number] = possibly_near(positions, *obstacle.last_query, count, parameters);
        } else if (!obstacle.moves) {
            active[number].resize(static_cast<size_t>(count));
            std::iota(active[number].begin(), active[number].end(), 0);
        } else {
            Candidates found = candidates_of(obstacle, before, positions, count, parameters);
            stop_at_entry(obstacle, before, positions, collided, found.crossing, parameters);
            // A particle that stopped is near, wherever it was going.
            for (const int32_t i : found.crossing)
                if (collided[i]) found.near.push_back(i);
            std::sort(found.near.begin(), found.near.end());
            found.near.erase(std::unique(found.near.begin(), found.near.end()), found.near.end());
            active[number] = std::move(found.near);
        }
    }
    for (int32_t i = 0; i < count; ++i) {
        const int64_t at = 3 * static_cast<int64_t>(i);
        VelocityWatch watch(impulses, i, positions + at, velocities + at);
        if (!walls.contain(positions + at, velocities + at)) continue;
        watch.add_to(0);
        collided[i] = true;
    }
    ObstacleQuery query;
    std::vector<int32_t> projected;
    for (int round = 0; round < parameters.rounds; ++round) {
        projected.clear();
        for (size_t number = 0; number < obstacles.size(); ++number) {
            const Obstacle& obstacle = obstacles[number];
            if (active[number].empty()) continue;
            query.run(obstacle, positions, active[number], true);
            for (size_t k = 0; k < active[number].size(); ++k) {
                const int64_t i = active[number][k];
                float *position = positions + 3 * i, *velocity = velocities + 3 * i;
                if (round == 0 && obstacle.moves) {
                    std::copy_n(&query.own[3 * k], 3, obstacle.last_query->positions + 3 * i);
                    obstacle.last_query->distance[i] = query.distance[k];
                }
                const float depth = parameters.clearance - query.distance[k];
                if (!(depth > parameters.tolerance)) continue;
                VelocityWatch watch(impulses, i, position, velocity);
                float wall[3] = {0, 0, 0};
                if (obstacle.moves) obstacle.end.velocity(position, wall);
                for (int axis = 0; axis < 3; ++axis) velocity[axis] -= wall[axis];
                project(position, velocity, depth, &query.normal[3 * k]);
                for (int axis = 0; axis < 3; ++axis) velocity[axis] += wall[axis];
                if (impulses) watch.add_to(row_of(number, i));
                walls.contain(position, velocity);
                watch.add_to(0);
                collided[i] = true;
                projected.push_back(active[number][k]);
            }
        }
        if (projected.empty()) return;
        std::sort(projected.begin(), projected.end());
        projected.erase(std::unique(projected.begin(), projected.end()), projected.end());
        for (auto& particles : active) particles = projected;
    }
    for (size_t number = 0; number < obstacles.size(); ++number) {
        const Obstacle& obstacle = obstacles[number];
        query.run(obstacle, positions, projected, false);
        for (size_t k = 0; k < projected.size(); ++k) {
            if (!(query.distance[k] < 0)) continue;
            // It stays where it was in the frame of the solid, and moves with it.
            const int64_t at = 3 * static_cast<int64_t>(projected[k]);
            VelocityWatch watch(impulses, projected[k], positions + at, velocities + at);
            std::copy_n(before + at, 3, positions + at);
            std::fill_n(velocities + at, 3, 0.0f);
            if (obstacle.moves) {
                float own[3];
                obstacle.start.to_own(before + at, own);
                obstacle.end.place.to_world(own, positions + at);
                obstacle.end.velocity(positions + at, velocities + at);
            }
            if (impulses) watch.add_to(row_of(number, projected[k]));
            walls.contain(positions + at, velocities + at);
            watch.add_to(0);
        }
    }
}

}  // namespace surfsup
