// The table of this translation unit's instruction set. NAME and `supported` are defined by the file that includes it.
#include "learned/convolution_isa.hpp"
#include "sdf/field_isa.hpp"
#include "sdf/solid_isa.hpp"
#include "sph/dfsph_isa.hpp"
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
                  ISA::convolve,
                  ISA::convolve_values_gradient,
                  ISA::convolve_weights_gradient,
                  ISA::distance,
                  ISA::ask_field,
                  ISA::field_scratch};
}  // namespace surfsup
