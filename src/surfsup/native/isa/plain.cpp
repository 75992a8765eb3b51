// For every processor.
#define ISA path_plain
#include "sph/neighbor_search_isa.hpp"
#include "sph/dfsph_isa.hpp"
#include "learned/network_isa.hpp"
#include "learned/convolution_isa.hpp"
#include "sdf/solid_isa.hpp"
#include "sdf/field_isa.hpp"

namespace surfsup {
static bool supported() { return true; }
const Isa plain = {"plain", supported, ISA::ROWS, ISA::scratch, ISA::look, ISA::approach, ISA::leave, ISA::encode, ISA::layer, ISA::finish,
                     ISA::convolve, ISA::convolve_back, ISA::weigh, ISA::within, sizeof(ISA::Search), ISA::distance, ISA::ask_field, ISA::field_scratch};
}  // namespace surfsup
