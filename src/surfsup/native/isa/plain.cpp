// For every processor.
#define ISA isa_plain
#define ISA_NAME "plain"
#define NAME plain
#define BFLOAT16 no_bfloat16

namespace surfsup {
static bool supported() { return true; }
}  // namespace surfsup

#include "isa/table.hpp"
