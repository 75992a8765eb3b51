// The table of this translation unit's instruction set. NAME, BFLOAT16 and `supported` are defined by the file that includes
// it.
#include "learned/convolution_isa.hpp"
#include "learned/message_passing_isa.hpp"
#include "sdf/csg_tree_isa.hpp"
#include "sdf/neural_field_isa.hpp"
#include "sph/dfsph_isa.hpp"
#include "sph/impulses_isa.hpp"
#include "sph/liquid_isa.hpp"
#include "sph/neighbor_search_isa.hpp"

namespace surfsup {
const Isa NAME = {ISA_NAME,
                  supported,
                  ISA::ROWS,
                  ISA::find_neighbors,
                  ISA::find_within,
                  sizeof(ISA::Search),
                  ISA::compute_pressures,
                  ISA::apply_pressures,
                  ISA::measure_liquid,
                  ISA::find_surface_normals,
                  ISA::apply_tension,
                  ISA::prepare_viscosity,
                  ISA::multiply_viscosity,
                  ISA::sum_liquid_impulses,
                  ISA::sum_impulses,
                  ISA::convolve,
                  ISA::convolve_values_gradient,
                  ISA::convolve_weights_gradient,
                  ISA::message_passing_kernels<ISA::Float32>(),
                  BFLOAT16,
                  ISA::evaluate_tree,
                  ISA::sample_field,
                  ISA::field_scratch_size};
}  // namespace surfsup
