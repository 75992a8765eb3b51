// For processors with AVX2 and FMA.
#define ISA path_avx2
#include "sph/neighbor_search_isa.hpp"
#include "sph/dfsph_isa.hpp"
#include "learned/network_isa.hpp"
#include "learned/convolution_isa.hpp"
#include "sdf/solid_isa.hpp"
#include "sdf/field_isa.hpp"

namespace surfsup {
#if defined(__AVX2__)
static bool supported() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
#else
static bool supported() { return false; }  // not a processor of that kind at all
#endif
const Isa avx2 = {"avx2", supported, ISA::ROWS, ISA::scratch, ISA::look, ISA::approach, ISA::leave, ISA::encode, ISA::layer, ISA::finish,
                     ISA::convolve, ISA::convolve_back, ISA::weigh, ISA::within, sizeof(ISA::Search), ISA::distance, ISA::ask_field, ISA::field_scratch};
}  // namespace surfsup
