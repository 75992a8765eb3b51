// For processors with AVX-512: F, BW, DQ and VL.
#define ISA path_avx512
#include "sph/neighbor_search_isa.hpp"
#include "sph/dfsph_isa.hpp"
#include "learned/network_isa.hpp"
#include "learned/convolution_isa.hpp"
#include "sdf/solid_isa.hpp"
#include "sdf/field_isa.hpp"

namespace surfsup {
#if defined(__AVX512F__)
static bool supported() {
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("fma");
}
#else
static bool supported() { return false; }  // not a processor of that kind at all
#endif
const Isa avx512 = {"avx512", supported, ISA::ROWS, ISA::scratch, ISA::look, ISA::approach, ISA::leave, ISA::encode, ISA::layer, ISA::finish,
                     ISA::convolve, ISA::convolve_back, ISA::weigh, ISA::within, sizeof(ISA::Search), ISA::distance, ISA::ask_field, ISA::field_scratch};
}  // namespace surfsup
