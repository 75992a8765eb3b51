// The sums over neighbors with this translation unit's instruction set.
#pragma once

#include "isa/isa.hpp"
#include "sph/dfsph_isa.hpp"
#include "sph/impulses_isa.hpp"
#include "sph/liquid_isa.hpp"
#include "sph/neighbor_search_isa.hpp"

namespace ISA {
namespace {

constexpr surfsup::SphKernels SPH = {
    ROWS,           find_neighbors,       find_within,   sizeof(Search),    compute_pressures,  apply_pressures,
    measure_liquid, find_surface_normals, apply_tension, prepare_viscosity, multiply_viscosity, sum_liquid_impulses,
    sum_impulses};

}  // namespace
}  // namespace ISA
