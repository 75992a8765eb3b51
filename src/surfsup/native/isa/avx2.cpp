// For processors with AVX2 and FMA.
#define ISA isa_avx2

#include "isa/field_tables.hpp"
#include "isa/sph_table.hpp"

namespace surfsup {
namespace {

#if defined(__AVX2__)
bool supported() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }
#else
bool supported() { return false; }  // another architecture
#endif

}  // namespace

const Isa avx2 = {"avx2", supported, &ISA::SPH, &ISA::SDF, &ISA::LEARNED, no_bfloat16};

}  // namespace surfsup
