// For processors with AVX2 and FMA.
#define PATH path_avx2
#include "search_path.hpp"
#include "sweeps_path.hpp"
#include "network_path.hpp"
#include "convolution_path.hpp"
#include "solid_path.hpp"
#include "field_path.hpp"

namespace surfsup {
#if defined(__AVX2__)
static bool supported() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
#else
static bool supported() { return false; }  // not a processor of that kind at all
#endif
const Path avx2 = {"avx2", supported, PATH::ROWS, PATH::scratch, PATH::look, PATH::approach, PATH::leave, PATH::encode, PATH::layer, PATH::finish,
                     PATH::convolve, PATH::convolve_back, PATH::weigh, PATH::within, sizeof(PATH::Search), PATH::distance, PATH::ask_field, PATH::field_scratch};
}  // namespace surfsup
