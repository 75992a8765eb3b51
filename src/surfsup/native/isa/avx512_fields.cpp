// Signed distances and networks for processors with AVX-512. Their rows are long: they fill sixteen lanes.
#define ISA isa_avx512_fields
#define SIXTEEN_LANES

#include "isa/field_tables.hpp"

namespace surfsup {

const SdfKernels avx512_sdf = ISA::SDF;
const LearnedKernels avx512_learned = ISA::LEARNED;

}  // namespace surfsup
