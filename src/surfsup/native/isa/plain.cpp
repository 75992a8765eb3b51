// For every processor.
#define ISA isa_plain

#include "isa/field_tables.hpp"
#include "isa/sph_table.hpp"

namespace surfsup {
namespace {

bool supported() { return true; }

}  // namespace

const Isa plain = {"plain", supported, &ISA::SPH, &ISA::SDF, &ISA::LEARNED, no_bfloat16};

}  // namespace surfsup
