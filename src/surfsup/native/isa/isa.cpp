#include "isa/isa.hpp"

#include <stdexcept>

namespace surfsup {

std::vector<const Isa*> instruction_sets() {
    std::vector<const Isa*> found;
    for (const Isa* isa : {&avx512, &avx2, &plain})
        if (isa->supported()) found.push_back(isa);
    return found;
}

const Isa& isa_of(const std::string& name) {
    for (const Isa* isa : instruction_sets())
        if (isa->name == name) return *isa;
    throw std::invalid_argument("this processor does not support the instruction set '" + name + "'");
}

}  // namespace surfsup
