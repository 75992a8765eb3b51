// For processors with AVX2 and FMA.
#define ISA isa_avx2
#define ISA_NAME "avx2"
#define NAME avx2
#define BFLOAT16 no_bfloat16

namespace surfsup {
#if defined(__AVX2__)
static bool supported() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
#else
static bool supported() { return false; }  // another architecture
#endif
}  // namespace surfsup

#include "isa/table.hpp"
