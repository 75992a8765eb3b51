// For processors with AVX-512: F, BW, DQ and VL.
#define PATH path_avx512
#include "search_path.hpp"
#include "sweeps_path.hpp"
#include "network_path.hpp"
#include "convolution_path.hpp"
#include "solid_path.hpp"
#include "field_path.hpp"

namespace surfsup {
#if defined(__AVX512F__)
static bool supported() {
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("fma");
}
#else
static bool supported() { return false; }  // not a processor of that kind at all
#endif
const Path avx512 = {"avx512", supported, PATH::ROWS, PATH::scratch, PATH::look, PATH::approach, PATH::leave, PATH::encode, PATH::layer, PATH::finish,
                     PATH::convolve, PATH::convolve_back, PATH::weigh, PATH::within, sizeof(PATH::Search), PATH::distance, PATH::ask_field, PATH::field_scratch};
}  // namespace surfsup
