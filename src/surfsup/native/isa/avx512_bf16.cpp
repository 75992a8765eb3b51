// For processors with AVX-512 BF16: only what multiplies matrices of bfloat16. The rest is in
// avx512_fields.cpp.
#define ISA isa_avx512_bf16
#define SIXTEEN_LANES

#include "isa/isa.hpp"
#include "learned/message_passing_isa.hpp"

namespace surfsup {

#if defined(__AVX512BF16__) && (defined(__clang__) || __GNUC__ >= 11)
const MessagePassingKernels* avx512_bf16() {
    static constexpr MessagePassingKernels kernels = ISA::message_passing_kernels<ISA::Bfloat16>();
    return __builtin_cpu_supports("avx512bf16") ? &kernels : nullptr;
}
#else
const MessagePassingKernels* avx512_bf16() { return nullptr; }  // another architecture, or an old compiler
#endif

}  // namespace surfsup
