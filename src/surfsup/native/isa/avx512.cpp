// For processors with AVX-512: F, BW, DQ and VL.
#define ISA isa_avx512
#define ISA_NAME "avx512"
#define NAME avx512
#define BFLOAT16 avx512_bf16

namespace surfsup {
#if defined(__AVX512F__)
static bool supported() {
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("fma");
}
#else
static bool supported() { return false; }  // another architecture
#endif
}  // namespace surfsup

#include "isa/table.hpp"
