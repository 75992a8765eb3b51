// The DFSPH solver in Python.
#include <algorithm>
#include <limits>
#include <optional>
#include <tuple>

#include "bindings/arrays.hpp"
#include "sph/neighbor_pairs.hpp"
#include "sph/step.hpp"

namespace {

using Nodes = Array<const float, nb::shape<-1, 2, surfsup::NODES>>;
using NewKernelSums = Array<float, nb::shape<-1, surfsup::KERNEL_SUMS>>;

int32_t checked_count(size_t count) {
    if (count >= static_cast<size_t>(std::numeric_limits<int32_t>::max()) / surfsup::MOTION_ROW)
        throw std::invalid_argument("there are more particles than the native solver can count");
    return static_cast<int32_t>(count);
}

void make_boundary_map(surfsup::BoundaryMap* map, Vector lower, Vector cell, SmallIndices resolution, SmallIndices cell_indices,
                       Nodes nodes) {
    expect(resolution.shape(0), 3, "resolution");
    const int64_t cells = product_of(resolution.data());
    constexpr int32_t MAX_RESOLUTION = 1 << 24;  // whole numbers up to it are exact in single precision
    if (cells < 1 || *std::max_element(resolution.data(), resolution.data() + 3) > MAX_RESOLUTION || nodes.shape(0) == 0)
        throw std::invalid_argument("a boundary map needs cells, and a last one for what is outside");
    expect(cell_indices.shape(0), static_cast<size_t>(cells), "cell_indices");
    for (int64_t k = 0; k < cells; ++k)
        if (cell_indices.data()[k] >= static_cast<int64_t>(nodes.shape(0)) - 1)
            throw std::invalid_argument("a cell index exceeds the number of stored cells");
    new (map) surfsup::BoundaryMap{{lower.data(), lower.data() + 3},
                                   {},
                                   {nodes.data(), nodes.data() + nodes.size()},
                                   {resolution.data(), resolution.data() + 3},
                                   {cell_indices.data(), cell_indices.data() + cells}};
    for (int axis = 0; axis < 3; ++axis) map->cells_per_meter.push_back(1.0f / cell.data()[axis]);
}

// Arrays of a particle's last substep, in the order of surfsup::SubstepRecord.
using Record = std::tuple<NewVectors, NewKernelSums, NewVectors, NewValues, NewVectors, NewValues, NewValues>;

surfsup::SubstepRecord record_of(const std::optional<Record>& record, size_t count) {
    if (!record) return {};
    const auto& [positions, kernel_sums, density_gradient, boundary_density, boundary_gradient, density_error, density_rate] =
        *record;
    for (const size_t rows : {positions.shape(0), kernel_sums.shape(0), density_gradient.shape(0), boundary_density.shape(0),
                              boundary_gradient.shape(0), density_error.shape(0), density_rate.shape(0)})
        expect(rows, count, "an array of the record");
    return {positions.data(),         kernel_sums.data(),   density_gradient.data(), boundary_density.data(),
            boundary_gradient.data(), density_error.data(), density_rate.data()};
}

// What moves: the maps of the solids, boxes around them (K, 2, 3), their queries, poses before and after (K, 2, 7), where each
// particle last queried them (K, count, 3) and the distance there (K, count); and the poses of the walls (2, 7). A pose is a
// position and a quaternion (w, x, y, z).
using Boxes = Array<const float, nb::shape<-1, 2, 3>>;
using Motions = Array<const double, nb::shape<-1, 2, 7>>;
using WallMotion = Array<const double, nb::shape<2, 7>>;
using SolidPositions = Array<float, nb::shape<-1, -1, 3>>;
using SolidDistances = Array<float, nb::ndim<2>>;
using Moving = std::tuple<std::vector<const surfsup::BoundaryMap*>, Boxes, std::vector<nb::object>, Motions, SolidPositions,
                          SolidDistances, std::optional<WallMotion>>;

surfsup::RigidMotion motion_of(const double* poses) {
    surfsup::RigidMotion motion{};
    for (surfsup::Pose* pose : {&motion.start, &motion.end}) {
        std::copy_n(poses, 3, pose->position);
        std::copy_n(poses + 3, 4, pose->rotation);
        poses += 7;
    }
    return motion;
}

surfsup::MovingSolids moving_of(const std::optional<Moving>& moving, size_t count, const surfsup::Isa& isa, int threads) {
    surfsup::MovingSolids result;
    if (!moving) return result;
    const auto& [maps, boxes, queries, motions, query_positions, query_distance, walls] = *moving;
    const float no_rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    for (const size_t rows :
         {boxes.shape(0), queries.size(), motions.shape(0), query_positions.shape(0), query_distance.shape(0)})
        expect(rows, maps.size(), "an array of the moving solids");
    expect(query_positions.shape(1), maps.empty() ? query_positions.shape(1) : count, "query_positions");
    expect(query_distance.shape(1), maps.empty() ? query_distance.shape(1) : count, "query_distance");
    for (size_t k = 0; k < maps.size(); ++k) {
        surfsup::MovingSolid solid{maps[k]->view(no_rotation),
                                   {},
                                   {},
                                   solid_query(queries[k], isa, threads),
                                   {query_positions.data() + 3 * count * k, query_distance.data() + count * k},
                                   motion_of(motions.data() + 14 * k)};
        std::copy_n(boxes.data() + 6 * k, 3, solid.lower);
        std::copy_n(boxes.data() + 6 * k + 3, 3, solid.upper);
        result.solids.push_back(std::move(solid));
    }
    if (walls) result.walls = motion_of(walls->data());
    return result;
}

// Sums of impulses (rows, 6), written to; which of the still solids each particle is at (count), None where there is but one;
// masses of the particles (count), None where all are 1.
using ImpulseRows = Array<double, nb::shape<-1, surfsup::IMPULSE_ROW>>;
using Impulses = std::tuple<ImpulseRows, std::optional<SmallIndices>, std::optional<Values>>;

std::optional<surfsup::ImpulseSums> impulses_of(const std::optional<Impulses>& impulses, size_t count, bool solid,
                                                size_t moving) {
    if (!impulses) return {};
    const auto& [rows, still_solid, masses] = *impulses;
    const size_t others = 1 + moving + (solid ? 1 : 0);
    if (rows.shape(0) < others || (rows.shape(0) > others && !(solid && still_solid)))
        throw std::invalid_argument("the rows of the impulses do not fit the solids");
    if (masses) expect(masses->shape(0), count, "masses");
    const auto still = static_cast<int32_t>(rows.shape(0) - 1 - moving);
    if (still_solid) {
        expect(still_solid->shape(0), count, "still_solid");
        for (size_t i = 0; i < count; ++i)
            if (still_solid->data()[i] < 0 || still_solid->data()[i] >= still)
                throw std::invalid_argument("there is no still solid of that number");
    }
    return surfsup::ImpulseSums{rows.data(), static_cast<int32_t>(rows.shape(0)), still,
                                still_solid ? still_solid->data() : nullptr, masses ? masses->data() : nullptr};
}

// The parameters of each liquid, and in a mixture which of them each particle has (count).
using Liquids = std::tuple<std::vector<surfsup::LiquidParameters>, std::optional<SmallIndices>>;

struct Mixture {
    std::vector<surfsup::LiquidParameters> liquids;
    const int32_t* liquid_of = nullptr;
    std::vector<float> masses;
};

Mixture mixture_of(const std::optional<Liquids>& liquids, size_t count) {
    if (!liquids) return {};
    const auto& [parameters, liquid_of] = *liquids;
    if (parameters.empty() || (parameters.size() > 1 && !liquid_of))
        throw std::invalid_argument("the particles of a mixture need the numbers of their liquids");
    Mixture mixture{parameters, nullptr, {}};
    if (!liquid_of) return mixture;
    expect(liquid_of->shape(0), count, "liquid_of");
    mixture.liquid_of = liquid_of->data();
    mixture.masses.reserve(count);
    for (size_t i = 0; i < count; ++i) {
        if (mixture.liquid_of[i] < 0 || static_cast<size_t>(mixture.liquid_of[i]) >= parameters.size())
            throw std::invalid_argument("there is no liquid of that number");
        mixture.masses.push_back(parameters[static_cast<size_t>(mixture.liquid_of[i])].mass);
    }
    for (const surfsup::LiquidParameters& liquid : parameters)
        if (!liquid.implicit_viscosity || !(liquid.mass > 0))
            throw std::invalid_argument("the liquids of a mixture have masses above zero, and implicit viscosities");
    return mixture;
}

surfsup::StepResult step(surfsup::Solver& solver, Vectors positions, Vectors velocities, Vector gravity, Vector lower,
                         Vector upper, const surfsup::BoundaryMap* boundary_map, Matrix3 rotation, const nb::object& solid,
                         bool handle_collisions, NewVectors query_positions, NewValues query_distance, NewVectors new_positions,
                         NewVectors new_velocities, NewFlags collided, const std::optional<Record>& record,
                         const std::optional<Moving>& moving, const std::optional<Impulses>& impulses,
                         const std::optional<Liquids>& liquids, const std::string& isa, int threads, int64_t max_pairs) {
    const size_t count = positions.shape(0);
    expect(velocities.shape(0), count, "velocities");
    expect(query_positions.shape(0), count, "query_positions");
    expect(query_distance.shape(0), count, "query_distance");
    expect(new_positions.shape(0), count, "new_positions");
    expect(new_velocities.shape(0), count, "new_velocities");
    expect(collided.shape(0), count, "collided");
    const surfsup::Isa& chosen = surfsup::isa_of(isa);
    const surfsup::SolidQuery query = solid_query(solid, chosen, threads);
    if ((moving || liquids) && record) throw std::invalid_argument("a frame with moving solids or a liquid has no record");
    const surfsup::MovingSolids moving_solids = moving_of(moving, count, chosen, threads);
    const auto sums = impulses_of(impulses, count, static_cast<bool>(query), moving_solids.solids.size());
    const Mixture mixture = mixture_of(liquids, count);
    const surfsup::Fluid fluid = {checked_count(count),
                                  positions.data(),
                                  velocities.data(),
                                  nullptr,
                                  nullptr,
                                  nullptr,
                                  gravity.data(),
                                  lower.data(),
                                  upper.data(),
                                  boundary_map ? boundary_map->view(rotation.data()) : surfsup::BoundaryMapView{},
                                  moving ? &moving_solids : nullptr,
                                  sums ? &*sums : nullptr,
                                  mixture.liquids.empty() ? nullptr : mixture.liquids.data(),
                                  mixture.liquid_of,
                                  mixture.masses.empty() ? nullptr : mixture.masses.data()};
    const surfsup::SubstepRecord written = record_of(record, count);
    const nb::gil_scoped_release unlocked;
    return surfsup::step(solver, fluid, query, handle_collisions, {query_positions.data(), query_distance.data()},
                         {new_positions.data(), new_velocities.data(), collided.data()}, written, chosen, threads, max_pairs);
}

void resolve_collisions(Vectors before, NewVectors positions, NewVectors velocities, NewFlags collided, Vector lower,
                        Vector upper, const surfsup::CollisionParameters& parameters, const nb::object& solid,
                        std::optional<NewVectors> query_positions, std::optional<NewValues> query_distance,
                        const std::optional<Impulses>& impulses, const std::string& isa, int threads) {
    const size_t count = positions.shape(0);
    expect(before.shape(0), count, "before");
    expect(velocities.shape(0), count, "velocities");
    expect(collided.shape(0), count, "collided");
    if (query_positions.has_value() != query_distance.has_value())
        throw std::invalid_argument("query_positions and query_distance must be given together");
    if (query_positions) expect(query_positions->shape(0), count, "query_positions");
    if (query_distance) expect(query_distance->shape(0), count, "query_distance");
    const surfsup::SolidQuery query = solid_query(solid, surfsup::isa_of(isa), threads);
    surfsup::LastQuery last_query{};
    if (query_positions) last_query = {query_positions->data(), query_distance->data()};
    const auto sums = impulses_of(impulses, count, static_cast<bool>(query), 0);
    const nb::gil_scoped_release unlocked;
    surfsup::resolve_collisions(before.data(), positions.data(), velocities.data(), collided.data(), checked_count(count),
                                {lower.data(), upper.data()}, parameters, query, query_positions ? &last_query : nullptr,
                                sums ? &*sums : nullptr);
}

void resolve_moving_collisions(Vectors before, NewVectors positions, NewVectors velocities, NewFlags collided, Vector lower,
                               Vector upper, const surfsup::CollisionParameters& parameters, const nb::object& solid,
                               const Moving& moving, float frame_time, const std::optional<Impulses>& impulses,
                               const std::string& isa, int threads) {
    const size_t count = positions.shape(0);
    expect(before.shape(0), count, "before");
    expect(velocities.shape(0), count, "velocities");
    expect(collided.shape(0), count, "collided");
    const surfsup::Isa& chosen = surfsup::isa_of(isa);
    const surfsup::SolidQuery query = solid_query(solid, chosen, threads);
    const surfsup::MovingSolids moving_solids = moving_of(moving, count, chosen, threads);
    const auto sums = impulses_of(impulses, count, static_cast<bool>(query), moving_solids.solids.size());
    const nb::gil_scoped_release unlocked;
    surfsup::resolve_moving_collisions(before.data(), positions.data(), velocities.data(), collided.data(),
                                       checked_count(count), {lower.data(), upper.data()}, parameters, query, nullptr,
                                       moving_solids, frame_time, sums ? &*sums : nullptr);
}

double energy_gain(Vectors positions, Vectors velocities, Vectors new_positions, Vectors new_velocities, Vector gravity,
                   std::optional<Values> masses) {
    const size_t count = positions.shape(0);
    expect(velocities.shape(0), count, "velocities");
    expect(new_positions.shape(0), count, "new_positions");
    expect(new_velocities.shape(0), count, "new_velocities");
    if (masses) expect(masses->shape(0), count, "masses");
    return surfsup::energy_gain(positions.data(), velocities.data(), new_positions.data(), new_velocities.data(),
                                static_cast<int64_t>(count), gravity.data(), masses ? masses->data() : nullptr);
}

void limit_energy_gain(Vectors positions, Vectors velocities, Vectors ballistic_positions, Vectors ballistic_velocities,
                       NewVectors new_positions, NewVectors new_velocities, Vector gravity, double max_gain,
                       float max_delta_velocity, int halvings, std::optional<Values> masses) {
    const size_t count = positions.shape(0);
    for (const size_t rows : {velocities.shape(0), ballistic_positions.shape(0), ballistic_velocities.shape(0),
                              new_positions.shape(0), new_velocities.shape(0)})
        expect(rows, count, "an array of particles");
    if (masses) expect(masses->shape(0), count, "masses");
    const nb::gil_scoped_release unlocked;
    surfsup::limit_energy_gain(positions.data(), velocities.data(), {ballistic_positions.data(), ballistic_velocities.data()},
                               new_positions.data(), new_velocities.data(), static_cast<int64_t>(count), gravity.data(),
                               masses ? masses->data() : nullptr, {max_gain, max_delta_velocity, halvings});
}

// Hands a vector over to NumPy.
nb::ndarray<nb::numpy, int64_t, nb::ndim<1>> to_numpy(std::vector<int64_t>&& values) {
    auto* kept = new std::vector<int64_t>(std::move(values));
    nb::capsule owner(kept, [](void* vector) noexcept { delete static_cast<std::vector<int64_t>*>(vector); });
    return {kept->data(), {kept->size()}, owner};
}

nb::tuple find_neighbor_pairs(Vectors positions, double radius, int64_t max_pairs, int threads) {
    surfsup::NeighborPairs pairs;
    const int32_t count = checked_count(positions.shape(0));
    {
        const nb::gil_scoped_release unlocked;
        pairs = surfsup::find_neighbor_pairs(positions.data(), count, radius, max_pairs, threads);
    }
    return nb::make_tuple(pairs.count, to_numpy(std::move(pairs.starts)), to_numpy(std::move(pairs.receivers)),
                          to_numpy(std::move(pairs.senders)));
}

}  // namespace

void add_solver(nb::module_& module) {
    using surfsup::BoundaryParameters, surfsup::CollisionParameters, surfsup::SolverParameters, surfsup::StepResult;
    module.def("find_neighbor_pairs", find_neighbor_pairs, array("positions"), "radius"_a, "max_pairs"_a, "threads"_a);
    module.def("energy_gain", energy_gain, array("positions"), array("velocities"), array("new_positions"),
               array("new_velocities"), array("gravity"), array("masses").none() = nb::none());
    module.def("limit_energy_gain", limit_energy_gain, array("positions"), array("velocities"), array("ballistic_positions"),
               array("ballistic_velocities"), array("new_positions"), array("new_velocities"), array("gravity"), "max_gain"_a,
               "max_delta_velocity"_a, "halvings"_a, array("masses").none() = nb::none());
    module.def("resolve_collisions", resolve_collisions, array("before"), array("positions"), array("velocities"),
               array("collided"), array("lower"), array("upper"), "parameters"_a, "solid"_a.none(),
               array("query_positions").none(), array("query_distance").none(), array("impulses").none(), "isa"_a, "threads"_a);

    module.def("resolve_moving_collisions", resolve_moving_collisions, array("before"), array("positions"), array("velocities"),
               array("collided"), array("lower"), array("upper"), "parameters"_a, "solid"_a.none(), "moving"_a, "frame_time"_a,
               array("impulses").none(), "isa"_a, "threads"_a);

    nb::class_<surfsup::BoundaryMap>(module, "BoundaryMap")
        .def("__init__", make_boundary_map, array("lower"), array("cell"), array("resolution"), array("cell_indices"),
             array("nodes"));
    nb::class_<BoundaryParameters>(module, "BoundaryParameters")
        .def(nb::init<>())
        .def_rw("distance_offset", &BoundaryParameters::distance_offset)
        .def_rw("min_distance", &BoundaryParameters::min_distance)
        .def_rw("strength", &BoundaryParameters::strength)
        .def_rw("wall_cell", &BoundaryParameters::wall_cell)
        .def_rw("min_wall_distance", &BoundaryParameters::min_wall_distance)
        .def_rw("fraction_start", &BoundaryParameters::fraction_start)
        .def_rw("fraction_step", &BoundaryParameters::fraction_step)
        .def_rw("plane_fraction", &BoundaryParameters::plane_fraction);
    nb::class_<CollisionParameters>(module, "CollisionParameters")
        .def(nb::init<>())
        .def_rw("clearance", &CollisionParameters::clearance)
        .def_rw("tolerance", &CollisionParameters::tolerance)
        .def_rw("lipschitz_bound", &CollisionParameters::lipschitz_bound)
        .def_rw("rounds", &CollisionParameters::rounds);
    nb::class_<SolverParameters>(module, "SolverParameters")
        .def(nb::init<>())
        .def_rw("kernel_support", &SolverParameters::kernel_support)
        .def_rw("frame_time", &SolverParameters::frame_time)
        .def_rw("substeps", &SolverParameters::substeps)
        .def_rw("self_density", &SolverParameters::self_density)
        .def_rw("divergence_relaxation", &SolverParameters::divergence_relaxation)
        .def_rw("density_relaxation", &SolverParameters::density_relaxation)
        .def_rw("divergence_deadband", &SolverParameters::divergence_deadband)
        .def_rw("min_squared_gradient", &SolverParameters::min_squared_gradient)
        .def_rw("max_density_error", &SolverParameters::max_density_error)
        .def_rw("viscosity", &SolverParameters::viscosity)
        .def_rw("viscosity_softening", &SolverParameters::viscosity_softening)
        .def_rw("max_energy_gain", &SolverParameters::max_energy_gain)
        .def_rw("boundary", &SolverParameters::boundary)
        .def_rw("collision", &SolverParameters::collision);
    using surfsup::LiquidParameters;
    nb::class_<LiquidParameters>(module, "LiquidParameters")
        .def(nb::init<>())
        .def_rw("mass", &LiquidParameters::mass)
        .def_rw("implicit_viscosity", &LiquidParameters::implicit_viscosity)
        .def_rw("viscosity", &LiquidParameters::viscosity)
        .def_rw("friction", &LiquidParameters::friction)
        .def_rw("cohesion", &LiquidParameters::cohesion)
        .def_rw("curvature", &LiquidParameters::curvature)
        .def_rw("adhesion", &LiquidParameters::adhesion)
        .def_rw("tolerance", &LiquidParameters::tolerance)
        .def_rw("max_iterations", &LiquidParameters::max_iterations);
    nb::class_<StepResult>(module, "StepResult")
        .def_ro("pairs", &StepResult::pairs)
        .def_ro("outer_work", &StepResult::outer_work)
        .def_ro("finished", &StepResult::finished);
    nb::class_<surfsup::Solver>(module, "Solver")
        .def(nb::init<SolverParameters>(), "parameters"_a)
        .def("step", step, nb::kw_only(), array("positions"), array("velocities"), array("gravity"), array("lower"),
             array("upper"), "boundary_map"_a.none(), array("rotation"), "solid"_a.none(), "handle_collisions"_a,
             array("query_positions"), array("query_distance"), array("new_positions"), array("new_velocities"),
             array("collided"), array("record").none(), array("moving").none(), array("impulses").none(),
             array("liquids").none(), "isa"_a, "threads"_a, "max_pairs"_a);
}
